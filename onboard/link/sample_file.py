"""The robot's memory of samples and heard tags in a file: what was not ashore outlives the program.

A line (``robot_link.sample_line``) is written whenever a sample is kept, and whenever samples are
known to be stored ashore. So a program that is killed loses nothing. A power cut may take the last
seconds, which the operating system still held, and half a line; a line that is not whole is passed
over. What is kept is bounded by nothing but the time without a station: some 200 bytes a sample.
"""

import logging
from collections.abc import Iterable
from pathlib import Path

from robot_link.messages import LogId
from robot_link.sample_line import entry_line, read_line, stored_line
from robot_link.sample_log import LogEntry, MemorySampleLog, SampleKey
from robot_link.whole_file import replace_file

_SPARE_LINES = 1024
"""The file is written anew when it has twice as many lines as samples, and so many more."""
_RETRY_LINES = 64
"""After so many lines that a disk did not take, it is asked to take all of them."""

_log = logging.getLogger(__name__)


class FileSampleLog:
    """Samples of this log and of older ones, in memory and in one file.

    A disk that refuses does not bring the robot down: what it takes no more is kept in memory until
    it takes it. A file that cannot be read is never replaced, only added to.

    Args:
        path: The file.
        log: The log to append to.
    """

    def __init__(self, path: Path, log: LogId) -> None:
        self._path = path
        kept = _read(path)
        self._memory = MemorySampleLog(log, kept)
        self._lines = 0
        self._owed: int | None = None
        """Lines that the disk did not take; None while it takes them."""
        self._is_readable = kept is not None
        self._rewrite()

    @property
    def next_key(self) -> SampleKey:
        """Name that the next entry gets."""
        return self._memory.next_key

    def append(self, entry: LogEntry) -> SampleKey:
        """Keep an entry and return its name."""
        key = self._memory.append(entry)
        self._write(entry_line(key, entry))
        return key

    def get(self, key: SampleKey) -> LogEntry | None:
        """Return an entry; None where it was forgotten."""
        return self._memory.get(key)

    def forget(self, keys: Iterable[SampleKey]) -> None:
        """Drop entries that are stored ashore."""
        known = [key for key in keys if self._memory.get(key) is not None]
        self._memory.forget(known)
        for log in dict.fromkeys(key.log for key in known):
            self._write(stored_line(log, [key.sequence for key in known if key.log == log]))
        if self._lines > 2 * len(self._memory) + _SPARE_LINES:
            self._rewrite()

    def kept(self) -> list[SampleKey]:
        """Return the names of all that is kept, ascending."""
        return self._memory.kept()

    def _rewrite(self) -> None:
        """Replace the file by one without what was forgotten or could not be read."""
        if not self._is_readable:
            return
        lines = [
            entry_line(key, entry)
            for key in self._memory.kept()
            if (entry := self._memory.get(key)) is not None
        ]
        try:
            replace_file(self._path, b"".join(lines))
        except OSError as error:
            self._give_up(error)
        else:
            self._owed = None
        self._lines = len(lines)

    def _write(self, line: bytes) -> None:
        self._lines += 1
        if self._owed is not None:
            self._owed += 1
            if self._owed >= _RETRY_LINES:
                self._rewrite()
            return
        try:
            with self._path.open("ab") as file:
                file.write(line)
        except OSError as error:
            self._give_up(error)

    def _give_up(self, error: OSError) -> None:
        if self._owed is None:
            _log.warning("cannot keep samples in %s: %s", self._path, error)
        self._owed = 0


def _read(path: Path) -> dict[SampleKey, LogEntry] | None:
    """Return what a file holds that was not known to be ashore; None if it cannot be read."""
    kept: dict[SampleKey, LogEntry] = {}
    try:
        lines = path.read_bytes().splitlines()
    except FileNotFoundError:
        return kept
    except OSError as error:
        _log.warning("cannot read the samples in %s, they stay there: %s", path, error)
        return None
    bad = 0
    for line in lines:
        try:
            found = read_line(line)
        except ValueError:
            bad += 1
            continue
        if isinstance(found, list):
            for key in found:
                kept.pop(key, None)
        else:
            kept[found[0]] = found[1]
    if bad:
        _log.warning("%d of %d lines of %s are none", bad, len(lines), path)
    return kept
