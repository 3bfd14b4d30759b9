"""The robot's memory of samples and heard tags in a file: what was not ashore outlives the program.

A line is written whenever a sample is kept, and whenever samples are known to be stored ashore;
each begins with its own checksum::

    1f0a3b52 {"log": 1, "sequence": 0, "variable": "chlorophyll", "value": 2.5, ...}
    9b20cc41 {"log": 1, "sequence": 1, "receiver": 450052, "tag": "A69-1601-179", ...}
    77a1c09e {"log": 1, "stored": [0]}

So a program that is killed loses nothing. A power cut may take the last seconds, which the
operating system still held, and half a line; a line that is not whole is passed over. What is kept
is bounded by nothing but the time without a station: some 200 bytes a sample.
"""

import json
import logging
import zlib
from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from robot_link.mavlink.detection import entry_message
from robot_link.messages import LogId
from robot_link.sample_log import HeardTag, LogEntry, Measurement, MemorySampleLog, SampleKey
from robot_link.whole_file import replace_file

_SPARE_LINES = 1024
"""The file is written anew when it has twice as many lines as samples, and so many more."""
_RETRY_LINES = 64
"""After so many lines that a disk did not take, it is asked to take all of them."""
_CHECKSUM_DIGITS = 8

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
        self._write(_entry_line(key, entry))
        return key

    def get(self, key: SampleKey) -> LogEntry | None:
        """Return an entry; None where it was forgotten."""
        return self._memory.get(key)

    def forget(self, keys: Iterable[SampleKey]) -> None:
        """Drop entries that are stored ashore."""
        known = [key for key in keys if self._memory.get(key) is not None]
        self._memory.forget(known)
        for log in dict.fromkeys(key.log for key in known):
            self._write(_line({"log": log, "stored": [key[1] for key in known if key.log == log]}))
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
            _entry_line(key, entry)
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
            _take(_content(line), kept)
        except (ValueError, KeyError, TypeError):
            bad += 1
    if bad:
        _log.warning("%d of %d lines of %s are none", bad, len(lines), path)
    return kept


def _take(content: Mapping[str, Any], kept: dict[SampleKey, LogEntry]) -> None:
    """Do what a line says.

    Raises:
        ValueError: If a value is none.
        KeyError: If one lacks, or the variable is unknown.
        TypeError: If one is of another type.
    """
    log = LogId(int(content["log"]))
    if "stored" in content:
        for sequence in content["stored"]:
            kept.pop(SampleKey(log, int(sequence)), None)
        return
    key = SampleKey(log, int(content["sequence"]))
    entry = _entry(content)
    entry_message(key.log, key.sequence, entry)
    kept[key] = entry


def _entry(content: Mapping[str, Any]) -> LogEntry:
    north_m, east_m, depth_m = content["position_ned"]
    position_ned = float(north_m), float(east_m), float(depth_m)
    position_std_m = float(content["position_std_m"])
    measured_at = datetime.fromisoformat(content["measured_at"])
    if "tag" in content:
        sensor = content["sensor"]
        return HeardTag(
            receiver=int(content["receiver"]),
            tag=str(content["tag"]),
            sensor=None if sensor is None else int(sensor),
            position_ned=position_ned,
            position_std_m=position_std_m,
            measured_at=measured_at,
        )
    return Measurement(
        variable=str(content["variable"]),
        value=float(content["value"]),
        position_ned=position_ned,
        position_std_m=position_std_m,
        measured_at=measured_at,
    )


def _entry_line(key: SampleKey, entry: LogEntry) -> bytes:
    what = (
        {"receiver": entry.receiver, "tag": entry.tag, "sensor": entry.sensor}
        if isinstance(entry, HeardTag)
        else {"variable": entry.variable, "value": float(entry.value)}
    )
    return _line(
        {
            "log": key.log,
            "sequence": key.sequence,
            **what,
            "position_ned": [float(one) for one in entry.position_ned],
            "position_std_m": float(entry.position_std_m),
            "measured_at": entry.measured_at.isoformat(),
        }
    )


def _line(content: Mapping[str, Any]) -> bytes:
    text = json.dumps(content).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _content(line: bytes) -> Mapping[str, Any]:
    """Return what a line says.

    Raises:
        ValueError: If it is not whole.
    """
    checksum, text = line[:_CHECKSUM_DIGITS], line[_CHECKSUM_DIGITS + 1 :]
    if int(checksum, 16) != zlib.crc32(text):
        raise ValueError("a line is not whole")
    content = json.loads(text)
    if not isinstance(content, dict):
        raise TypeError("a line holds no values")
    return content
