"""Which rows of a series stay when it is thinned."""

from typing import Final

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from db.sample_tables import FINE_S

_S: Final = 1_000_000
_HOUR_US: Final = 3600 * _S


def kept_rows(
    at_us: IntArray, value: FloatArray, period_s: int, marks: IntArray | None = None
) -> BoolArray:
    """Return which rows of whole hours of a series stay.

    Of each hour: the first row of each period, counted from the hour's beginning; the smallest and
    the largest value of each ``FINE_S``, so that sums of stretches keep their extremes; the last
    row; and where a mark changes, the row on either side. Thinned once more, nothing more goes.

    Args:
        at_us: Moments, ascending, shape ``(n,)``, microseconds from the epoch.
        value: Shape ``(n,)``; NaN where a row has none.
        period_s: Of which one row stays, 1 .. 3600 s.
        marks: What a row is marked with, shape ``(n, m)``.

    Returns:
        Shape ``(n,)``.
    """
    rows = len(at_us)
    kept = np.zeros(rows, dtype=np.bool_)
    if rows == 0:
        return kept
    hour = at_us // _HOUR_US
    period = hour * _HOUR_US + (at_us % _HOUR_US) // (period_s * _S)
    kept |= _is_first(period)
    kept |= _is_last(hour)
    if marks is not None and rows > 1:
        changes = np.any(marks[1:] != marks[:-1], axis=1)
        kept[1:] |= changes
        kept[:-1] |= changes
    starts = np.flatnonzero(_is_first(at_us // (FINE_S * _S)))
    for begin, end in zip(starts, [*starts[1:], rows], strict=True):
        part = value[begin:end]
        if not np.all(np.isnan(part)):
            kept[begin + np.nanargmin(part)] = True
            kept[begin + np.nanargmax(part)] = True
    return kept


def _is_first(group: IntArray) -> BoolArray:
    return np.concatenate(([True], group[1:] != group[:-1]))


def _is_last(group: IntArray) -> BoolArray:
    return np.concatenate((group[1:] != group[:-1], [True]))
