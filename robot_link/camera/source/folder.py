"""A folder of pictures, shown one after the other: for tests, and for what was kept.

A picture whose name tells when it was taken (``20261122T150405.123Z.jpg``, or so with the camera's
id before it, as kept pictures are named) is shown as if the first one were taken now, and the next
one as long after it as their names say, at most 10 s.
"""

import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from robot_link.camera.sighting import SourceSettings
from robot_link.camera.source.frame import (
    Frame,
    Frames,
    SourceEndedError,
    SourceError,
    arrived,
)
from robot_link.camera.uri import FileUri, is_below
from robot_link.camera.wire import BODY_MAX

_NAME: Final = "%Y%m%dT%H%M%S.%fZ"
_ENDINGS: Final = (".jpg", ".jpeg", ".png")
_LONGEST_PAUSE: Final = timedelta(seconds=10)


def folder_frames(uri: FileUri, settings: SourceSettings) -> Frames:
    """Return the pictures of a folder in the order of their names."""
    try:
        folder = uri.path(settings.folder)
    except ValueError as error:
        raise SourceError(str(error)) from None
    if not folder.is_dir():
        raise SourceError(f"there is no folder {uri.name} in GRACE_CAMERA_DIR")
    pictures = [
        path
        for path in sorted(folder.iterdir())
        if path.suffix.lower() in _ENDINGS and is_below(path, folder) and path.is_file()
    ]
    if not pictures:
        raise SourceError(f"the folder {uri.name} has no picture (.jpg, .jpeg, .png)")
    shown_at, before = datetime.now(UTC), None
    for path in pictures:
        taken_at = _time_of(path)
        if taken_at is None:
            yield arrived(_content(path), settings.latency_s or 0.0)
            time.sleep(1.0 / uri.fps)
            continue
        pause = timedelta() if before is None else max(taken_at - before, timedelta())
        shown_at, before = shown_at + min(pause, _LONGEST_PAUSE), taken_at
        time.sleep(max((shown_at - datetime.now(UTC)).total_seconds(), 0.0))
        yield Frame(_content(path), shown_at, max(shown_at, datetime.now(UTC)))
    raise SourceEndedError(f"all {len(pictures)} pictures of the folder were shown")


def _content(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(BODY_MAX + 1)
    except OSError as error:
        raise SourceError(f"{path.name} cannot be read: {error.strerror}") from None


def _time_of(path: Path) -> datetime | None:
    try:
        return datetime.strptime(path.stem.rpartition("-")[2], _NAME).replace(tzinfo=UTC)
    except ValueError:
        return None
