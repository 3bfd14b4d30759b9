"""Ranges that arrive late: the bank is rolled back to when they held, and time is replayed.

An acoustic answer travels, is decoded and queued; meanwhile the robot has swum on. Applied on
arrival it would be taken for a range of now. Applied at its own time and followed by everything
that happened since, it gives exactly the estimate that it would have given in order.
"""

from collections import deque
from dataclasses import dataclass, replace

from autonomy.tracking.filter.bank import Bank, BankInput
from autonomy.tracking.reading import RangeHeard

LONGEST_AGE_S = 30.0
"""A range older than this is not used."""
SAME_TIME_S = 1e-6


@dataclass(slots=True, eq=False)
class _Past:
    time_s: float
    before: Bank
    given: BankInput
    measured: list[tuple[float, float]]
    """When each range held and what it was, in that order."""


class Timeline:
    """A bank and what it was given over the last ``LONGEST_AGE_S``.

    Args:
        bank: Where it begins; the timeline owns it from now on.
    """

    def __init__(self, bank: Bank) -> None:
        self._bank = bank
        self._past: deque[_Past] = deque()
        self._now_s = 0.0

    @property
    def bank(self) -> Bank:
        """The bank as of now."""
        return self._bank

    def step(self, given: BankInput, ranges: tuple[RangeHeard, ...]) -> int:
        """Let time pass, then take in ranges, each at the step nearest to when it held.

        Args:
            given: Everything but ranges.
            ranges: Finite, not negative, as are their ages.

        Returns:
            How many were too old, or held before the timeline began.
        """
        self._now_s += given.dt_s
        self._past.append(_Past(self._now_s, self._bank.copy(), given, []))
        while self._past[0].time_s < self._now_s - LONGEST_AGE_S:
            self._past.popleft()
        first, too_old = len(self._past) - 1, 0
        for heard in ranges:
            index = self._index(self._now_s - heard.age_s)
            if index is None:
                too_old += 1
                continue
            measured = self._past[index].measured
            measured.append((round(self._now_s - heard.age_s, 6), float(heard.range_m)))
            measured.sort()
            first = min(first, index)
        self._replay(first)
        return too_old

    def follow_instead(
        self,
        relative_ne_m: tuple[float, float],
        covariance_m2: tuple[float, float, float],
        velocity_ne_m_s: tuple[float, float],
    ) -> None:
        """Let the bank follow another place from now on, as ``Bank.follow_instead`` says.

        What is already past cannot be replayed with it: ranges that held before are too old.
        """
        self._bank.follow_instead(relative_ne_m, covariance_m2, velocity_ne_m_s)
        self._past.clear()

    def _index(self, time_s: float) -> int | None:
        """Return the step nearest to a time, the later one of two."""
        past = self._past
        if time_s < past[0].time_s - past[0].given.dt_s - SAME_TIME_S:
            return None
        for index in range(len(past) - 1, 0, -1):
            middle = 0.5 * (past[index - 1].time_s + past[index].time_s)
            if time_s >= middle - SAME_TIME_S:
                return index
        return 0

    def _replay(self, first: int) -> None:
        bank = self._past[first].before.copy()
        for index in range(first, len(self._past)):
            entry = self._past[index]
            if index > first:
                entry.before = bank.copy()
            bank.step(replace(entry.given, ranges_m=tuple(r for _, r in entry.measured)))
        self._bank = bank
