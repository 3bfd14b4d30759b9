"""Tests of one series of values, each O(n) or O(n log w) for windows of w values, in pure numpy.

Values that are not finite count as missing. Times are seconds, strictly ascending, and are taken as
they are: nothing is cut to whole seconds, as robots measure several times a second.
"""

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.quality.flag import FAIL, GOOD, MISSING, SUSPECT, UNKNOWN, FlagArray

_WINDOWS_AT_ONCE = 65_536
"""Windows whose extremes are held at a time: a series of any length takes the memory of these."""
Span = tuple[float | None, float | None]
"""Least and greatest value, either of which may be open."""


def gross_range(values: FloatArray, suspect: Span, fail: Span) -> FlagArray:
    """Flag values outside of what is likely, and of what can be.

    Args:
        values: Shape ``(n,)``.
        suspect: Values outside of it are suspect; its ends are good.
        fail: Values outside of it fail.

    Returns:
        Flags, shape ``(n,)``.
    """
    flags = _good(values)
    flags[_outside(values, suspect)] = SUSPECT
    flags[_outside(values, fail)] = FAIL
    flags[~np.isfinite(values)] = MISSING
    return flags


def spike(values: FloatArray, suspect: float | None, fail: float | None) -> FlagArray:
    """Flag values that differ from the mean of their two neighbours by more than a threshold.

    The first and the last value, and those beside a missing one, are not evaluated.
    """
    flags = _good(values)
    missing = ~np.isfinite(values)
    differs = np.full(values.size, np.nan)
    differs[1:-1] = np.abs(values[1:-1] - (values[:-2] + values[2:]) / 2.0)
    _flag_beyond(flags, differs, suspect, fail)
    flags[~np.isfinite(differs)] = UNKNOWN
    flags[missing] = MISSING
    return flags


def rate_of_change(
    values: FloatArray,
    times_s: FloatArray,
    suspect: float | None,
    fail: float | None = None,
    resolution: float = 0.0,
) -> FlagArray:
    """Flag values that changed faster since the one before than a rate, per second.

    The first value, and one behind a missing one, are good: nothing speaks against them. A change
    by the resolution of the values is none.
    """
    flags = _good(values)
    rate = np.zeros(values.size)
    rate[1:] = np.maximum(np.abs(np.diff(values)) - resolution, 0.0) / np.diff(times_s)
    _flag_beyond(flags, rate, suspect, fail)
    flags[~np.isfinite(values)] = MISSING
    return flags


def flat_line(
    values: FloatArray,
    times_s: FloatArray,
    suspect_s: float | None,
    fail_s: float | None,
    tolerance: float,
) -> FlagArray:
    """Flag values that have stayed within a tolerance for longer than a time.

    The window of a value holds those of the last ``suspect_s`` or ``fail_s``, itself included;
    values nearer to the beginning than that are good.
    """
    flags = _good(values)
    for window_s, flag in ((suspect_s, SUSPECT), (fail_s, FAIL)):
        if window_s is not None:
            flags[_is_flat(values, times_s, window_s, tolerance)] = flag
    flags[~np.isfinite(values)] = MISSING
    return flags


def _is_flat(
    values: FloatArray, times_s: FloatArray, window_s: float, tolerance: float
) -> BoolArray:
    found = times_s - times_s[:1] >= window_s
    for begin in range(0, values.size, _WINDOWS_AT_ONCE):
        windows = slice(begin, min(begin + _WINDOWS_AT_ONCE, values.size))
        first = np.searchsorted(times_s, times_s[windows] - window_s, side="left")
        part = values[first[0] : windows.stop]
        least, greatest = _window_extremes(part, first - first[0])
        found[windows] &= greatest - least < tolerance
    return found


def _window_extremes(values: FloatArray, first: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the least and the greatest of the window that ends at each of the last values.

    Windows are covered by two of length ``2**k``; extremes of these are doubled level by level, so
    that only one level is held at a time.

    Args:
        values: Shape ``(n,)``.
        first: Where each window begins, ascending, shape ``(m,)``; the last one ends with
            ``values``, the one before a value earlier, and so on.
    """
    low = np.where(np.isfinite(values), values, np.inf)
    high = np.where(np.isfinite(values), values, -np.inf)
    least, greatest = np.empty(first.size), np.empty(first.size)
    last = np.arange(values.size - first.size, values.size)
    # level k holds the windows of 2**k to 2**(k + 1) - 1 values
    level_of = np.frexp((last - first + 1).astype(np.float64))[1] - 1
    order = np.argsort(level_of, kind="stable")
    bounds = np.searchsorted(level_of[order], np.arange(level_of.max(initial=0) + 2))
    for level in range(bounds.size - 1):
        mine = order[bounds[level] : bounds[level + 1]]
        head, tail = first[mine], last[mine] - (1 << level) + 1
        least[mine] = np.minimum(low[head], low[tail])
        greatest[mine] = np.maximum(high[head], high[tail])
        step = 1 << level
        if step >= low.size:
            break
        low = np.minimum(low[:-step], low[step:])
        high = np.maximum(high[:-step], high[step:])
    return least, greatest


def speed(
    position: FloatArray,
    times_s: FloatArray,
    has_fix: BoolArray,
    suspect: float | None,
    fail: float | None,
    resolution_m: float = 0.0,
) -> FlagArray:
    """Flag positions to which something moved faster than it can, in metres a second.

    A jump at a fix is the dead reckoning's fault: the reckoned side of it is suspect, the fix and
    what follows it are not.

    Args:
        position: Places in metres, shape ``(n, d)``.
        times_s: Shape ``(n,)``.
        has_fix: Where the place is a fix, shape ``(n,)``.
        suspect: Speed beyond which a place is suspect.
        fail: Speed beyond which it fails.
        resolution_m: Places that differ by no more are the same.
    """
    flags = np.full(len(position), GOOD, dtype=np.int8)
    rate = np.zeros(len(position))
    moved_m = np.linalg.norm(np.diff(position, axis=0), axis=1)
    rate[1:] = np.maximum(moved_m - resolution_m, 0.0) / np.diff(times_s)
    _flag_beyond(flags, rate, suspect, fail)
    jumps = np.flatnonzero((flags != GOOD) & has_fix)
    flags[jumps] = GOOD
    before = jumps[jumps > 0] - 1
    before = before[~has_fix[before] & (flags[before] == GOOD)]
    flags[before] = SUSPECT
    flags[~np.isfinite(position).all(axis=1)] = MISSING
    return flags


def _good(values: FloatArray) -> FlagArray:
    return np.full(values.size, GOOD, dtype=np.int8)


def _outside(values: FloatArray, span: Span) -> BoolArray:
    low, high = span
    found = np.zeros(values.size, dtype=np.bool_)
    if low is not None:
        found |= values < low
    if high is not None:
        found |= values > high
    return found


def _flag_beyond(
    flags: FlagArray, amount: FloatArray, suspect: float | None, fail: float | None
) -> None:
    if suspect is not None:
        flags[amount > suspect] = SUSPECT
    if fail is not None:
        flags[amount > fail] = FAIL
