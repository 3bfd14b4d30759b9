"""Who speaks under a robot's system id besides the robot.

A radio that has an address is known by it. On a line without addresses the numbers tell: a robot
numbers its frames modulo 256, so the frames of two are two sequences that take turns.
"""

from collections import deque
from dataclasses import dataclass

from robot_link.messages import SystemId
from robot_link.transport.datagram import Address

TOLD_S = 60.0
"""How long after it was last heard a duplicate is spoken of."""
_ADDRESSES = 8
_LOST_MAX = 16
"""Frames in a row that may be lost and the next one still be known for the same sequence's."""
_QUIET_FRAMES = 64
"""A sequence of which none of so many frames was is over: numbers come round after 256."""
_TURNS = 8
_TURNS_S = 10.0
"""One robot that loses much may seem to take turns with itself, but not so often in so short."""


@dataclass(slots=True)
class _Duplicate:
    address: Address
    frames: int
    heard_s: float


class DuplicateWatch:
    """Notes radios that speak under a system id that belongs to another one.

    Who notes them does not obey them; this only remembers, for the operator.
    """

    def __init__(self) -> None:
        self._duplicates: dict[tuple[SystemId, Address], _Duplicate] = {}

    def note(self, system: SystemId, address: Address, now_s: float) -> bool:
        """Note a frame of a radio that is not the one of this system id.

        Returns:
            Whether it is news: this radio was not heard under this id for a while.
        """
        duplicate = self._duplicates.get((system, address))
        if duplicate is None:
            while len(self._duplicates) >= _ADDRESSES:
                oldest = min(self._duplicates, key=lambda key: self._duplicates[key].heard_s)
                del self._duplicates[oldest]
            duplicate = self._duplicates[system, address] = _Duplicate(
                address, 0, now_s - 2 * TOLD_S
            )
        is_news = now_s - duplicate.heard_s > TOLD_S
        duplicate.frames += 1
        duplicate.heard_s = now_s
        return is_news

    def sentence(self, system: SystemId, now_s: float) -> str:
        """Say which radios speak under a system id that is not theirs, or ""."""
        found = [
            duplicate
            for (other, _), duplicate in self._duplicates.items()
            if other == system and now_s - duplicate.heard_s <= TOLD_S
        ]
        if not found:
            return ""
        radios = ", ".join(f"{duplicate.address:016X}" for duplicate in found)
        return (
            f"another radio ({radios}) speaks as system {system}; it is not obeyed:"
            " give one of the two robots another system id"
        )


class NumberWatch:
    """Notices two robots on one line by the numbers of their frames."""

    def __init__(self) -> None:
        self._newest: int | None = None
        self._other: int | None = None
        self._unheard = 0
        """Frames since the other sequence went on."""
        self._turns: deque[float] = deque(maxlen=_TURNS)
        self._seen_s: float | None = None

    def note(self, number: int, now_s: float) -> bool:
        """Take the number of the next frame; a router may bring each frame twice.

        Returns:
            Whether it is news that two robots speak: they did not for a while.
        """
        if number == self._newest:
            return False
        gap, other_gap = _gap(self._newest, number), _gap(self._other, number)
        self._unheard += 1
        if other_gap < gap:
            self._turns.append(now_s)
        if other_gap < gap or gap > _LOST_MAX:
            self._newest, self._other = number, self._newest
            self._unheard = 0
        else:
            self._newest = number
            if self._unheard > _QUIET_FRAMES:
                self._other = None
        if len(self._turns) < _TURNS or now_s - self._turns[0] > _TURNS_S:
            return False
        is_news = not self.is_double(now_s)
        self._seen_s = now_s
        return is_news

    def is_double(self, now_s: float) -> bool:
        """Tell whether two robots spoke of late."""
        return self._seen_s is not None and now_s - self._seen_s <= TOLD_S


def _gap(before: int | None, number: int) -> float:
    """Return how far a number is behind a sequence; infinite where it does not go on with it."""
    gap = float("inf") if before is None else (number - before) % 256
    return gap if 0 < gap <= _LOST_MAX else float("inf")
