"""The robot's memory of samples that are not yet known to be stored ashore."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Protocol

from robot_link.messages import LogId, PositionNed


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
    """What the link needs of such a memory; its numbers count from 0 and are never used twice."""

    @property
    def log(self) -> LogId:
        """Name of this log; a robot that lost its memory must take a new one."""
        ...

    def append(self, measurement: Measurement) -> int:
        """Keep a measurement and return its number."""
        ...

    def get(self, sequence: int) -> Measurement | None:
        """Return a measurement; None where it may be forgotten."""
        ...

    def forget(self, sequences: Iterable[int]) -> None:
        """Note that these are stored ashore; unknown numbers do not matter."""
        ...

    def kept(self) -> list[int]:
        """Return the numbers of all that is kept, ascending."""
        ...


class MemorySampleLog:
    """A log that lives as long as its process."""

    def __init__(self, log: LogId) -> None:
        self.log = log
        self._next = 0
        self._kept: dict[int, Measurement] = {}

    def append(self, measurement: Measurement) -> int:
        """Keep a measurement and return its number."""
        sequence = self._next
        self._kept[sequence] = measurement
        self._next += 1
        return sequence

    def get(self, sequence: int) -> Measurement | None:
        """Return a measurement; None where it was forgotten."""
        return self._kept.get(sequence)

    def forget(self, sequences: Iterable[int]) -> None:
        """Drop measurements that are stored ashore."""
        for sequence in sequences:
            self._kept.pop(sequence, None)

    def kept(self) -> list[int]:
        """Return the numbers of all that is kept, ascending."""
        return list(self._kept)
