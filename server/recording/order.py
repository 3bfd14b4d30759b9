"""Puts blame for times that do not ascend on as few rows as possible."""

from bisect import bisect_left
from collections.abc import Sequence


def ascending(times: Sequence[float]) -> list[int]:
    """Return the indices of the longest strictly ascending part of ``times``.

    One row with a time far ahead is left out alone, instead of all the rows that follow it. Of
    rows with the same time the first is kept.
    """
    ends: list[float] = []
    """Smallest last time of an ascending part of each length."""
    last: list[int] = []
    before: list[int] = []
    for index, time in enumerate(times):
        length = bisect_left(ends, time)
        before.append(last[length - 1] if length else -1)
        if length == len(ends):
            ends.append(time)
            last.append(index)
        elif time < ends[length]:
            ends[length] = time
            last[length] = index
    kept: list[int] = []
    index = last[-1] if last else -1
    while index >= 0:
        kept.append(index)
        index = before[index]
    return kept[::-1]
