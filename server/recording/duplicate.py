"""Which measurements of two sources are the same, where no log numbers them."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray

SAME_US: Final = 1000
"""Within a millisecond is at the same moment."""
_SHARE: Final = 1e-6
_QUANTUM: Final = 1e-9
"""Values are the same within the greater of this share of them and this."""


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """What each new measurement is to those that are kept."""

    known: IntArray
    """Index of the one that it is, -1 for one that is new, shape ``(n,)``."""
    differs: BoolArray
    """Whether it was measured at the same moment as that, but has another value, shape ``(n,)``."""
    is_denser: bool
    """Whether the new source tells more often than the kept one, and so is believed."""


def matches(known_us: IntArray, known: FloatArray, new_us: IntArray, new: FloatArray) -> Matches:
    """Match measurements of one channel, each at most once, the nearest in time first.

    They are the same if less than half of the denser source's median interval lies between them
    and their values agree to a millionth. A measurement of the same millisecond that has another
    value differs.

    Args:
        known_us: Moments of kept measurements, ascending, shape ``(m,)``, microseconds.
        known: Their values, shape ``(m,)``.
        new_us: Moments of new ones, ascending, shape ``(n,)``.
        new: Their values, shape ``(n,)``.
    """
    found = np.full(len(new_us), -1, dtype=np.int64)
    differs = np.zeros(len(new_us), dtype=np.bool_)
    if not len(known_us) or not len(new_us):
        return Matches(found, differs, is_denser=False)
    interval, new_interval = _interval(known_us), _interval(new_us)
    reach_us = max(SAME_US + 1, -(-min(interval, new_interval) // 2))
    pairs = _pairs(known_us, new_us, reach_us)
    apart_us = np.abs(known_us[pairs[0]] - new_us[pairs[1]])
    limit = np.maximum(_QUANTUM, _SHARE * np.abs(known[pairs[0]]))
    is_equal = np.abs(known[pairs[0]] - new[pairs[1]]) <= limit
    is_candidate = is_equal | (apart_us <= SAME_US)
    order = np.lexsort((pairs[0], apart_us, ~is_equal))
    taken = np.zeros(len(known_us), dtype=np.bool_)
    for pair in order[is_candidate[order]].tolist():
        first, second = pairs[0][pair], pairs[1][pair]
        if taken[first] or found[second] >= 0:
            continue
        taken[first] = True
        found[second], differs[second] = first, not is_equal[pair]
    return Matches(found, differs, is_denser=new_interval < interval)


def _interval(at_us: IntArray) -> int:
    """Return the median interval, the longest there is for fewer than two moments."""
    return int(np.median(np.diff(at_us))) if len(at_us) > 1 else np.iinfo(np.int64).max // 4


def _pairs(known_us: IntArray, new_us: IntArray, reach_us: int) -> tuple[IntArray, IntArray]:
    """Return the indices of all pairs that are nearer to each other than a reach."""
    reach_us = min(reach_us, int(max(known_us[-1], new_us[-1]) - min(known_us[0], new_us[0])) + 1)
    first = np.searchsorted(known_us, new_us - reach_us, side="right")
    last = np.searchsorted(known_us, new_us + reach_us, side="left")
    count = np.maximum(0, last - first)
    second = np.repeat(np.arange(len(new_us)), count)
    begin = np.repeat(np.cumsum(count) - count, count)
    return np.repeat(first, count) + np.arange(len(second)) - begin, second
