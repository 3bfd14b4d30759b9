"""The robot's memory of samples and heard tags that are not yet known to be stored ashore."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import NamedTuple, Protocol

from robot_link.messages import LogId, PositionNed


class SampleKey(NamedTuple):
    """Names one sample of a robot for good; those of older logs come first."""

    log: LogId
    sequence: int


@dataclass(frozen=True, slots=True)
class Measurement:
    """One measurement of a field, where the robot believes that it took it."""

    variable: str
    """Key of a declared variable."""
    value: float
    position_ned: PositionNed
    position_std_m: float
    measured_at: datetime


@dataclass(frozen=True, slots=True)
class HeardTag:
    """One transmission of an acoustic tag, where the robot believes that it heard it."""

    receiver: int
    """Serial number of the receiver."""
    tag: str
    """Such as ``A69-1601-179``."""
    sensor: int | None
    """Raw value of the tag's sensor."""
    position_ned: PositionNed
    position_std_m: float
    measured_at: datetime


LogEntry = Measurement | HeardTag
"""What is kept under one count of numbers until it is known to be stored ashore."""


class SampleLog(Protocol):
    """What the link needs of such a memory.

    It appends to one log, whose numbers count from 0 and are never used twice. It may hold samples
    of older logs, too: those that were not ashore when the robot was switched off.
    """

    @property
    def next_key(self) -> SampleKey:
        """Name that the next entry gets."""
        ...

    def append(self, entry: LogEntry) -> SampleKey:
        """Keep an entry and return its name."""
        ...

    def get(self, key: SampleKey) -> LogEntry | None:
        """Return an entry; None where it may be forgotten."""
        ...

    def forget(self, keys: Iterable[SampleKey]) -> None:
        """Note that these are stored ashore; unknown ones do not matter."""
        ...

    def kept(self) -> list[SampleKey]:
        """Return the names of all that is kept, ascending."""
        ...


class MemorySampleLog:
    """A memory that lives as long as its process.

    Args:
        log: The log to append to; a robot that may have lost its memory must take a new one.
        kept: What was not ashore when the robot was switched off.
    """

    def __init__(self, log: LogId, kept: Mapping[SampleKey, LogEntry] | None = None) -> None:
        self._log = log
        self._kept: dict[SampleKey, LogEntry] = dict(sorted((kept or {}).items()))
        self._next = 1 + max((key.sequence for key in self._kept if key.log == log), default=-1)

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def next_key(self) -> SampleKey:
        """Name that the next entry gets."""
        return SampleKey(self._log, self._next)

    def append(self, entry: LogEntry) -> SampleKey:
        """Keep an entry and return its name."""
        key = self.next_key
        self._kept[key] = entry
        self._next += 1
        return key

    def get(self, key: SampleKey) -> LogEntry | None:
        """Return an entry; None where it was forgotten."""
        return self._kept.get(key)

    def forget(self, keys: Iterable[SampleKey]) -> None:
        """Drop entries that are stored ashore."""
        for key in keys:
            self._kept.pop(key, None)

    def kept(self) -> list[SampleKey]:
        """Return the names of all that is kept, ascending."""
        return list(self._kept)
