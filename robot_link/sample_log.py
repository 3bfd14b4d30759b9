"""The robot's memory of samples that are not yet known to be stored ashore."""

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


class SampleLog(Protocol):
    """What the link needs of such a memory.

    It appends to one log, whose numbers count from 0 and are never used twice. It may hold samples
    of older logs, too: those that were not ashore when the robot was switched off.
    """

    def append(self, measurement: Measurement) -> SampleKey:
        """Keep a measurement and return its name."""
        ...

    def get(self, key: SampleKey) -> Measurement | None:
        """Return a measurement; None where it may be forgotten."""
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

    def __init__(self, log: LogId, kept: Mapping[SampleKey, Measurement] | None = None) -> None:
        self._log = log
        self._kept: dict[SampleKey, Measurement] = dict(sorted((kept or {}).items()))
        self._next = 1 + max((key.sequence for key in self._kept if key.log == log), default=-1)

    def __len__(self) -> int:
        return len(self._kept)

    def append(self, measurement: Measurement) -> SampleKey:
        """Keep a measurement and return its name."""
        key = SampleKey(self._log, self._next)
        self._kept[key] = measurement
        self._next += 1
        return key

    def get(self, key: SampleKey) -> Measurement | None:
        """Return a measurement; None where it was forgotten."""
        return self._kept.get(key)

    def forget(self, keys: Iterable[SampleKey]) -> None:
        """Drop measurements that are stored ashore."""
        for key in keys:
            self._kept.pop(key, None)

    def kept(self) -> list[SampleKey]:
        """Return the names of all that is kept, ascending."""
        return list(self._kept)
