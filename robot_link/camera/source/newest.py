"""The newest picture of a source, opened again whenever it ends; those that wait are dropped."""

import threading
import time
from typing import Final

from robot_link.camera.sighting import SourceSettings
from robot_link.camera.source.device import device_frames
from robot_link.camera.source.folder import folder_frames
from robot_link.camera.source.frame import Frame, Frames, SourceEndedError, SourceError
from robot_link.camera.source.http import http_frames
from robot_link.camera.source.stream import film_frames, rtsp_frames
from robot_link.camera.uri import CameraUri, DeviceUri, FileUri, HttpUri, RtspUri

_PAUSES_S: Final = (1.0, 2.0, 4.0)
"""Before a source is opened again; the last one from then on."""
_EARLY: Final = 0.8
"""A picture counts as too soon after the last one below this part of the interval."""


def open_source(uri: CameraUri, settings: SourceSettings) -> Frames:
    """Return the pictures of the source that a URI names."""
    match uri:
        case DeviceUri():
            return device_frames(uri, settings)
        case HttpUri():
            return http_frames(uri, settings)
        case RtspUri():
            return rtsp_frames(uri, settings)
        case FileUri(is_video=True):
            return film_frames(uri, settings)
        case FileUri():
            return folder_frames(uri, settings)


class Newest:
    """Reads a source in a thread of its own and keeps the newest picture.

    Of more pictures a second than the URI asks for, only as many are kept.
    """

    def __init__(self, uri: CameraUri, settings: SourceSettings) -> None:
        self._uri, self._settings = uri, settings
        self._interval_s = 0.0 if isinstance(uri, FileUri) else _EARLY / uri.fps
        self._changed = threading.Condition()
        self._frame: Frame | None = None
        self._kept_s = -1e9
        self.pictures = 0
        self.dropped = 0
        self.failure = ""
        """Why the source gives nothing now; empty while it does."""
        self.has_ended = False
        """It has shown all that it has."""
        self._thread = threading.Thread(target=self._read, name="camera source", daemon=True)

    def start(self) -> None:
        """Begin to read; the thread ends with the process."""
        self._thread.start()

    def take(self, timeout_s: float) -> Frame | None:
        """Return the newest picture that nobody took, waiting for it; ``None`` if none comes."""
        with self._changed:
            self._changed.wait_for(lambda: self._frame is not None, timeout_s)
            frame, self._frame = self._frame, None
            return frame

    def _read(self) -> None:
        attempts = 0
        while not self.has_ended:
            try:
                for frame in open_source(self._uri, self._settings):
                    attempts = 0
                    self._keep(frame)
            except SourceEndedError as end:
                self.failure, self.has_ended = str(end), True
            except SourceError as error:
                self.failure = str(error)
            except Exception as error:  # noqa: BLE001 - whatever a library raises, it is told
                self.failure = f"the camera cannot be read: {error}"
            if not self.has_ended:
                time.sleep(_PAUSES_S[min(attempts, len(_PAUSES_S) - 1)])
                attempts += 1

    def _keep(self, frame: Frame) -> None:
        now_s = time.monotonic()
        with self._changed:
            self.pictures += 1
            self.failure = ""
            if now_s - self._kept_s < self._interval_s:
                self.dropped += 1
                return
            self.dropped += self._frame is not None
            self._kept_s, self._frame = now_s, frame
            self._changed.notify()
