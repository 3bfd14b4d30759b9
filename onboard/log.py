"""The robot's own log on board: what happened, and where it believed to be, as text files.

``events-<start>.txt`` has a line for each event, ``track-<start>.csv`` one for each few seconds.
The station downloads them; the oldest are deleted so that the disk never fills.
"""

import logging
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Protocol, TextIO

from robot_link.messages import StateReport
from robot_link.track_line import TRACK_HEADER, track_line

TRACK_PERIOD_S = 5.0
_FILES_KEPT = 8
"""Of each kind."""
_BYTES_MAX = 4_000_000
"""A file that is longer takes no more."""

_log = logging.getLogger(__name__)


class OnboardLog(Protocol):
    """Where a robot writes what it does."""

    def note(self, sentence: str) -> None:
        """Write down that something happened."""
        ...

    def track(self, state: StateReport) -> None:
        """Write down where the robot believes to be; more often than needed does not matter."""
        ...

    def close(self) -> None:
        """Write out what is held back."""
        ...


class NoLog:
    """The log of a robot that has no disk."""

    def note(self, sentence: str) -> None:
        """Forget it."""

    def track(self, state: StateReport) -> None:
        """Forget it."""

    def close(self) -> None:
        """Do nothing."""


class FileLog:
    """A log in one folder; belongs to one event loop, and writes a little at a time.

    Args:
        folder: Where the files are; nothing else should be.
        started_at: Names the files.
    """

    def __init__(self, folder: Path, started_at: datetime) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        name = f"{started_at:%Y%m%dT%H%M%SZ}"
        for kind in ("events", "track"):
            for old in sorted(folder.glob(f"{kind}-*"))[: 1 - _FILES_KEPT]:
                old.unlink()
        self._at = started_at
        self._events = _opened(folder / f"events-{name}.txt", "")
        self._track = _opened(folder / f"track-{name}.csv", TRACK_HEADER)
        self._tracked_at: datetime | None = None

    def note(self, sentence: str) -> None:
        """Write an event with the time of the last state."""
        _write(self._events, f"{self._at:%Y-%m-%dT%H:%M:%SZ} {sentence}")

    def track(self, state: StateReport) -> None:
        """Write a state if the last one was written long enough ago."""
        self._at = at = state.measured_at
        before = self._tracked_at
        if before is not None and 0.0 <= (at - before).total_seconds() < TRACK_PERIOD_S:
            return
        self._tracked_at = at
        _write(self._track, track_line(state))

    def close(self) -> None:
        """Write out what is held back."""
        for file in (self._events, self._track):
            with suppress(OSError):
                file.close()


def _opened(path: Path, header: str) -> TextIO:
    file = path.open("a", encoding="utf-8", buffering=1)
    if header and file.tell() == 0:
        file.write(header + "\n")
    return file


def _write(file: TextIO, line: str) -> None:
    """Write a line unless the file is full; a disk that takes no more ends the file."""
    try:
        if not file.closed and file.tell() < _BYTES_MAX:
            file.write(line + "\n")
    except OSError as error:
        _log.warning("%s ends: %s", file.name, error)
        with suppress(OSError):
            file.close()
