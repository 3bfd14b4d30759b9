"""A folder of pictures, shown one after the other: for tests, and for what was kept.

A picture whose name tells when it was taken (``20261122T150405.123Z.jpg``) is shown as taken and
arrived then, and the next one as long after it as their names say.
"""

import time
from datetime import UTC, datetime
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
_LONGEST_PAUSE_S: Final = 10.0


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
    before: datetime | None = None
    for path in pictures:
        taken_at = _time_of(path)
        if before is not None and taken_at is not None:
            pause_s = (taken_at - before).total_seconds()
            time.sleep(min(max(pause_s, 0.0), _LONGEST_PAUSE_S))
        before = taken_at
        frame = arrived(_content(path), settings.latency_s or 0.0)
        yield frame if taken_at is None else Frame(frame.content, taken_at, taken_at)
        if taken_at is None:
            time.sleep(1.0 / uri.fps)
    raise SourceEndedError(f"all {len(pictures)} pictures of the folder were shown")


def _content(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(BODY_MAX + 1)
    except OSError as error:
        raise SourceError(f"{path.name} cannot be read: {error.strerror}") from None


def _time_of(path: Path) -> datetime | None:
    try:
        return datetime.strptime(path.stem, _NAME).replace(tzinfo=UTC)
    except ValueError:
        return None
