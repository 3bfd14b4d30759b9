"""Phases of a glider's flight, as OG1.0 numbers them, from its mode or from its depth alone.

Source: OG1.0, table of phases: 0 unknown, 1 ascent, 2 descent, 3 surfacing, 5 inflection,
6 propelled. The manual's text has 1 and 2 the other way round; its vocabulary and the converters
of the field have them as here.
"""

from typing import Final

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.quality.flag import FlagArray

UNKNOWN, ASCENT, DESCENT, SURFACING, INFLECTION, PROPELLED = 0, 1, 2, 3, 5, 6
MEANINGS: Final = "unknown ascent descent surfacing inflection propelled"
VALUES: Final = (UNKNOWN, ASCENT, DESCENT, SURFACING, INFLECTION, PROPELLED)
MODE_AGE_MAX_S: Final = 60.0
"""A mode that was told longer ago says nothing of a moment."""
NO_MODE: Final = -1
_MODE_SPEED_M_S, _DEPTH_SPEED_M_S = 0.005, 0.02
_MODE_SURFACE_M, _DEPTH_SURFACE_M = 0.5, 1.0
_SMOOTHED = 5


def vertical_speed(depth_m: FloatArray, times_s: FloatArray) -> FloatArray:
    """Return the speed downwards, m/s, of a depth smoothed over five values.

    Args:
        depth_m: Shape ``(n,)``; NaN where nobody told, where the speed is NaN too.
        times_s: Strictly ascending, shape ``(n,)``.
    """
    found = np.full(depth_m.size, np.nan)
    rows = np.flatnonzero(np.isfinite(depth_m))
    if rows.size < 2:
        return found
    window = min(_SMOOTHED, rows.size)
    sums = np.convolve(depth_m[rows], np.ones(window), mode="same")
    counts = np.convolve(np.ones(rows.size), np.ones(window), mode="same")
    found[rows] = np.gradient(sums / counts, times_s[rows])
    return found


def phase_by_mode(
    mode: IntArray,
    depth_m: FloatArray,
    times_s: FloatArray,
    *,
    diving: tuple[int, ...],
    surfaced: tuple[int, ...],
    propelled: tuple[int, ...],
    aborting: int,
) -> FlagArray:
    """Return the phase of each row by what the robot said that it does.

    Args:
        mode: Of the robot, ``NO_MODE`` where it did not tell, shape ``(n,)``.
        depth_m: Shape ``(n,)``.
        times_s: Strictly ascending, shape ``(n,)``.
        diving: Modes in which it glides, up or down.
        surfaced: Modes in which it is at the surface.
        propelled: Modes in which it swims.
        aborting: Mode in which it comes up.
    """
    rows = np.arange(mode.size)
    told = np.maximum.accumulate(np.where(mode == NO_MODE, -1, rows))
    is_known = (told >= 0) & (times_s - times_s[np.maximum(told, 0)] <= MODE_AGE_MAX_S)
    now = np.where(is_known, mode[np.maximum(told, 0)], NO_MODE)
    speed = vertical_speed(depth_m, times_s)
    is_under = depth_m > _MODE_SURFACE_M
    phase = np.full(mode.size, UNKNOWN, dtype=np.int8)
    glides = np.isin(now, diving)
    phase[glides] = _by_speed(speed, _MODE_SPEED_M_S)[glides]
    phase[np.isin(now, surfaced)] = SURFACING
    swims = np.isin(now, propelled)
    phase[swims] = np.where(is_under, PROPELLED, SURFACING)[swims]
    aborts = now == aborting
    phase[aborts] = np.where(is_under, ASCENT, SURFACING)[aborts]
    return phase


def phase_by_depth(depth_m: FloatArray, times_s: FloatArray) -> FlagArray:
    """Return the phase of each row of a recording that has no mode, from its depth alone."""
    phase = _by_speed(vertical_speed(depth_m, times_s), _DEPTH_SPEED_M_S)
    phase[depth_m < _DEPTH_SURFACE_M] = SURFACING
    phase[~np.isfinite(depth_m)] = UNKNOWN
    return phase


def profiles(phase: FlagArray) -> tuple[IntArray, FlagArray]:
    """Return the number of the profile of each row, from 1, and its direction.

    A profile is a run of ascent or of descent; a turn or the surface ends it. Rows of no profile
    have number 0 and direction 0; a descent has 1, an ascent -1.
    """
    direction = np.zeros(phase.size, dtype=np.int8)
    direction[phase == DESCENT], direction[phase == ASCENT] = 1, -1
    begins = (direction != 0) & (np.diff(direction, prepend=np.int8(0)) != 0)
    number = np.where(direction != 0, np.cumsum(begins), 0)
    return number.astype(np.int64), direction


def segments(has_fix: FlagArray | np.ndarray) -> IntArray:
    """Return the number of the stretch between fixes of each row, from 1.

    Fixes in a row belong to the stretch that they begin.
    """
    begins = has_fix & ~np.concatenate([[False], has_fix[:-1]])
    return (np.cumsum(begins) + (0 if begins.size and begins[0] else 1)).astype(np.int64)


def _by_speed(speed_m_s: FloatArray, least_m_s: float) -> FlagArray:
    phase = np.full(speed_m_s.size, INFLECTION, dtype=np.int8)
    phase[speed_m_s > least_m_s], phase[speed_m_s < -least_m_s] = DESCENT, ASCENT
    phase[~np.isfinite(speed_m_s)] = UNKNOWN
    return phase
