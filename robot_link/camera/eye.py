"""What a camera's process does with each picture: look, and tell."""

import os
import time
from typing import Final, Protocol

import cv2

from autonomy.vision import corner_kernel
from autonomy.vision.corner_kernel import Picture
from robot_link.camera.board import find_board
from robot_link.camera.detector import TagDetector
from robot_link.camera.picture import PictureError, grey_picture, jpeg_of, light_state
from robot_link.camera.sighting import (
    BoardView,
    Order,
    Sighting,
    SourceReport,
    SourceSettings,
    SourceState,
    nearest_first,
)
from robot_link.camera.source.frame import Frame
from robot_link.camera.source.newest import Newest
from robot_link.camera.uri import CameraUri
from robot_link.camera.wire import CameraWireError, FromCamera, framed

_REPORT_S: Final = 1.0
_LOOK_S: Final = 0.1
"""Longest wait for a picture before the state is looked at."""
_WHOLE_S, _DEEP_EVERY = 1.0, 5
_WHOLE_DECIMATE, _DEEP_DECIMATE, _EACH_DECIMATE = 1.5, 1.0, 2.0
"""Once a second the whole picture is searched, at full resolution every fifth time, which takes
twice as long; where there are no regions, each other picture coarsely."""
_PREVIEW_S: Final = 0.5
_SILENT_S: Final = 3.0
_LIGHT_WORDS: Final[dict[SourceState, str]] = {
    "dark": "the picture is black",
    "glare": "most of the picture is white",
}


class Wishes(Protocol):
    """What the station wishes of this camera now."""

    settings: SourceSettings
    order: Order


class Eye:
    """Looks at the pictures of one camera and says what it sees."""

    def __init__(self, uri: CameraUri, orders: Wishes, output: int) -> None:
        """Get ready.

        Args:
            uri: The camera.
            orders: Is asked before each picture.
            output: File descriptor to which messages are written.
        """
        self._orders, self._output = orders, output
        self._newest = Newest(uri, orders.settings)
        self._camera = orders.settings.camera
        self._detector = TagDetector()
        self._frame_number = 0
        self._wholes = 0
        self._whole_s = self._preview_s = self._report_s = -1e9
        self._boards = 0
        self._refused: dict[str, int] = {}
        self._size: tuple[int, int] | None = None
        self._light: SourceState = "opening"
        self._last: bytes | None = None
        self._picture_s = -1e9
        """When a new picture came, or the camera was first asked for one."""
        self._rate = _Rate()
        self._told: tuple[SourceState, str] | None = None

    def run(self) -> None:
        """Look and tell until nobody listens."""
        cv2.setNumThreads(1)
        corner_kernel.warm_up()  # before the first picture, so that none is late
        self._picture_s = time.monotonic()
        self._newest.start()
        try:
            while True:
                frame = self._newest.take(_LOOK_S)
                if frame is not None:
                    self._look(frame)
                self._report()
        except BrokenPipeError:
            return

    def _look(self, frame: Frame) -> None:
        if isinstance(frame.content, bytes):
            if frame.content == self._last:
                self._refuse("the same picture again")
                return
            self._last = frame.content
        begun_s = time.thread_time()
        try:
            grey = grey_picture(frame.content)
        except PictureError as error:
            self._refuse(str(error))
            return
        self._picture_s = time.monotonic()
        self._rate.note(self._picture_s)
        self._size = (grey.shape[1], grey.shape[0])
        self._light = light_state(grey)
        self._see(frame, grey, begun_s)
        self._show(frame)
        self._frame_number += 1

    def _see(self, frame: Frame, grey: Picture, begun_s: float) -> None:
        """Say which tags are in a picture, and where the board is, if somebody asks."""
        order = self._orders.order
        decimate = self._decimate(has_regions=bool(order.regions))
        found = self._detector.find(grey, order.regions, decimate)
        size = (grey.shape[1], grey.shape[0])
        self._say(
            Sighting(
                self._camera,
                self._frame_number,
                frame.taken_at,
                frame.arrived_at,
                size,
                "region" if decimate is None else "whole",
                nearest_first(found.tags),
                found.twice,
                1e3 * (time.thread_time() - begun_s),
            )
        )
        if order.board_views > self._boards:
            self._boards += 1
            self._say(BoardView(self._camera, self._frame_number, size, find_board(grey)))

    def _decimate(self, *, has_regions: bool) -> float | None:
        """Return how finely the whole picture is searched this time; ``None``: not at all."""
        now_s = time.monotonic()
        if now_s - self._whole_s < _WHOLE_S:
            return None if has_regions else _EACH_DECIMATE
        self._whole_s = now_s
        self._wholes += 1
        return _WHOLE_DECIMATE if self._wholes % _DEEP_EVERY else _DEEP_DECIMATE

    def _show(self, frame: Frame) -> None:
        now_s = time.monotonic()
        if not self._orders.order.wants_previews or now_s - self._preview_s < _PREVIEW_S:
            return
        self._preview_s = now_s
        try:
            self._say(jpeg_of(frame.content))
        except (PictureError, CameraWireError) as error:
            self._refuse(str(error))

    def _refuse(self, reason: str) -> None:
        self._refused[reason] = self._refused.get(reason, 0) + 1

    def _report(self) -> None:
        now_s = time.monotonic()
        told = self._state(now_s)
        if told == self._told and now_s - self._report_s < _REPORT_S:
            return
        self._told, self._report_s = told, now_s
        self._say(
            SourceReport(
                self._camera,
                *told,
                self._frame_number,
                self._newest.dropped,
                dict(self._refused),
                self._size,
                self._rate.frames_per_s(now_s),
            )
        )

    def _state(self, now_s: float) -> tuple[SourceState, str]:
        source = self._newest
        if source.failure:
            return ("silent" if source.has_ended else "failed"), source.failure
        if now_s - self._picture_s > _SILENT_S:
            return "silent", self._silence()
        return self._light, _LIGHT_WORDS.get(self._light, "")

    def _silence(self) -> str:
        if self._newest.pictures == 0:
            return f"no picture came yet for {_SILENT_S:g} s"
        if not self._refused:
            return f"no picture for {_SILENT_S:g} s"
        reason = max(self._refused, key=lambda one: self._refused[one])
        return f"no picture that can be looked at for {_SILENT_S:g} s; most often: {reason}"

    def _say(self, message: FromCamera) -> None:
        rest = memoryview(framed(message))
        while rest:
            rest = rest[os.write(self._output, rest) :]


class _Rate:
    """How many pictures come a second, over the last few."""

    _KEPT: Final = 20

    def __init__(self) -> None:
        self._times_s: list[float] = []

    def note(self, now_s: float) -> None:
        self._times_s = [*self._times_s[1 - self._KEPT :], now_s]

    def frames_per_s(self, now_s: float) -> float:
        times = [time_s for time_s in self._times_s if now_s - time_s < _SILENT_S]
        return (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0
