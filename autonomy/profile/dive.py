"""Dives and their halves, down and up, found in a series of depths alone.

A recording of another maker's robot tells no dive; of a robot of our own the same function is used,
so that dives have the same numbers whoever recorded them.

1. A value that stands apart from both of its neighbours is no place: depths are replaced by the
   median of three.
2. *Scale.* A turn counts once the depth has come back by ``turn_m``: a tenth of the depth that one
   in a hundred values exceeds, but no more than ``TURN_MOST_M``, no less than ``TURN_LEAST_M`` or
   six times the noise of the depths.
3. A dive is a stretch deeper than ``turn_m`` that gets twice as deep somewhere; it begins where the
   robot began to sink, and ends where it stopped to rise. Swimming at the surface is none.
4. A silence longer than ``gap_s`` ends a dive: what the robot did meanwhile nobody knows.
5. Within a dive each turn begins a new *leg*, down or up. A dive between two surfacings may have
   several of each (a yo-yo).

Times and depths need not be regular.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from autonomy.arrays import FloatArray, IntArray

TURN_SHARE: Final = 0.1
TURN_LEAST_M: Final = 0.1
"""Of a tank, where pressure is known to centimetres."""
TURN_MOST_M: Final = 3.0
"""Of the ocean: less than any glider's yo-yo."""
_LEVEL_SHARE: Final = 0.25
"""Of a turn: so much above the shallowest depth a robot is at the surface."""
_NOISES: Final = 6.0
_GAP_LEAST_S: Final = 300.0
_GAP_STEPS: Final = 20.0
_DEEP_PERCENTILE: Final = 99.0
_STD_OF_MEDIAN: Final = 1.4826
"""Standard deviation of normal values over the median of their absolute values."""


@dataclass(frozen=True, slots=True)
class DiveScale:
    """What counts in a series of depths."""

    turn_m: float
    """How far the depth comes back at a turn; shallower than this is the surface."""
    gap_s: float
    """A longer silence ends a dive."""


@dataclass(frozen=True, slots=True)
class Dive:
    """A stretch under water; numbers are rows of the series."""

    first: int
    last: int
    deepest: int
    """The greatest depth that does not stand apart from its neighbours."""
    turns: tuple[int, ...]
    """Where legs begin and end: ``first``, the turns, ``last``."""


def dive_scale(depth_m: FloatArray, times_s: FloatArray) -> DiveScale:
    """Return what counts as a turn and as a silence in a series.

    Args:
        depth_m: Positive down, finite, shape ``(n,)``, m.
        times_s: Strictly ascending, shape ``(n,)``, s.
    """
    if depth_m.size == 0:
        return DiveScale(TURN_LEAST_M, _GAP_LEAST_S)
    deep_m = float(np.percentile(depth_m, _DEEP_PERCENTILE))
    noise_m = 0.0
    if depth_m.size > 2:
        # second differences of white noise have six times its variance; a steady glide has none
        bend = np.abs(depth_m[2:] - 2.0 * depth_m[1:-1] + depth_m[:-2])
        noise_m = _STD_OF_MEDIAN * float(np.median(bend)) / math.sqrt(6.0)
    turn_m = max(min(TURN_SHARE * deep_m, TURN_MOST_M), TURN_LEAST_M, _NOISES * noise_m)
    step_s = float(np.median(np.diff(times_s))) if times_s.size > 1 else 0.0
    return DiveScale(turn_m, max(_GAP_LEAST_S, _GAP_STEPS * step_s))


def find_dives(
    depth_m: FloatArray, times_s: FloatArray, scale: DiveScale | None = None
) -> list[Dive]:
    """Find the dives of a series of depths; see the module for what one is.

    Args:
        depth_m: Positive down, shape ``(n,)``, m; NaN where nobody told.
        times_s: Strictly ascending, shape ``(n,)``, s.
        scale: What counts; by default found from the series.

    Returns:
        Dives in order of time; no two have a leg in common.
    """
    rows = np.flatnonzero(np.isfinite(depth_m))
    told, times = depth_m[rows], times_s[rows]
    depth = _median_of_three(told)
    done = 0
    if scale is None:
        scale = dive_scale(depth, times)
    believed = np.where(np.abs(told - depth) <= scale.turn_m, told, depth)
    is_under = depth > scale.turn_m
    breaks = np.zeros(rows.size + 1, dtype=np.bool_)
    breaks[1:-1] = (is_under[1:] != is_under[:-1]) | (np.diff(times) > scale.gap_s)
    breaks[[0, -1]] = True
    bounds = np.flatnonzero(breaks)
    found: list[Dive] = []
    for number, begin in enumerate(bounds[:-1].tolist()):
        if not is_under[begin] or depth[begin : bounds[number + 1]].max() <= 2.0 * scale.turn_m:
            continue
        first, last = _widened(depth, times, bounds, number, scale)
        if found and first < done:
            first = done
        turns = first + _turns(depth[first : last + 1], scale.turn_m)
        deepest = first + int(np.argmax(believed[first : last + 1]))
        found.append(
            Dive(
                int(rows[first]),
                int(rows[last]),
                int(rows[deepest]),
                tuple(rows[turns].tolist()),
            )
        )
        done = last
    return found


def _median_of_three(values: FloatArray) -> FloatArray:
    if values.size < 3:
        return values
    found = values.copy()
    found[1:-1] = np.median(np.stack((values[:-2], values[1:-1], values[2:])), axis=0)
    # an end has one neighbour only, and takes no part where it stands apart from both next to it
    found[0], found[-1] = np.median(values[:3]), np.median(values[-3:])
    return found


def _widened(
    depth_m: FloatArray, times_s: FloatArray, bounds: IntArray, number: int, scale: DiveScale
) -> tuple[int, int]:
    """Return where the robot began to sink before a stretch, and where it stopped to rise after.

    That is where it was last, or again, nearly as shallow as ever in the stretch at the surface
    beside, and from there as far as the depth goes on.

    Args:
        depth_m: Shape ``(n,)``.
        times_s: Shape ``(n,)``.
        bounds: Where stretches begin, and the end of the last.
        number: Of the stretch, which is under water.
        scale: What counts.
    """
    first, last = int(bounds[number]), int(bounds[number + 1]) - 1
    level_m = _LEVEL_SHARE * scale.turn_m
    if number > 0 and times_s[first] - times_s[first - 1] <= scale.gap_s:
        before = depth_m[bounds[number - 1] : first]
        if before[-1] <= scale.turn_m:
            back = int(np.argmax(before[::-1] <= before.min() + level_m))
            first -= back + 1
            while first > bounds[number - 1] and depth_m[first - 1] < depth_m[first]:
                first -= 1
    if last + 1 < depth_m.size and times_s[last + 1] - times_s[last] <= scale.gap_s:
        after = depth_m[last + 1 : bounds[number + 2]]
        if after[0] <= scale.turn_m:
            last += 1 + int(np.argmax(after <= after.min() + level_m))
            while last + 1 < bounds[number + 2] and depth_m[last + 1] < depth_m[last]:
                last += 1
    return first, last


def _turns(depth_m: FloatArray, turn_m: float) -> IntArray:
    """Return the ends of the legs of one dive, its first and last row among them.

    A turn is the extreme of a stretch after which the depth came back by ``turn_m``.
    """
    last = depth_m.size - 1
    rising = np.sign(np.diff(depth_m))
    # rows between which the depth goes one way cannot be turns
    extremes = np.flatnonzero(rising[1:] != rising[:-1]) + 1
    turns = [0]
    low = high = 0
    direction = 0
    for row in (*extremes.tolist(), last):
        value = depth_m[row]
        if value > depth_m[high]:
            high = row
        if value < depth_m[low]:
            low = row
        if direction >= 0 and depth_m[high] - value >= turn_m and high < row:
            if high > turns[-1]:
                turns.append(high)
            direction, low = -1, row
            high = row
        elif direction <= 0 and value - depth_m[low] >= turn_m and low < row:
            if low > turns[-1]:
                turns.append(low)
            direction, high = 1, row
            low = row
        elif direction == 1:
            low = row
        elif direction == -1:
            high = row
    if last > turns[-1]:
        turns.append(last)
    return np.array(turns, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Legs:
    """Halves of all dives in order of time, shape ``(m,)`` each."""

    begin_s: FloatArray
    end_s: FloatArray
    dive: IntArray
    """Number of the dive, from 1."""
    direction: IntArray
    """1 down, -1 up."""


def legs_of(dives: list[Dive], depth_m: FloatArray, times_s: FloatArray) -> Legs:
    """Return the legs of dives that were found in a series."""
    begin = [row for one in dives for row in one.turns[:-1]]
    end = [row for one in dives for row in one.turns[1:]]
    number = [count for count, one in enumerate(dives, 1) for _ in one.turns[1:]]
    direction = np.where(depth_m[end] >= depth_m[begin], 1, -1) if begin else np.empty(0)
    return Legs(
        times_s[begin] if begin else np.empty(0),
        times_s[end] if end else np.empty(0),
        np.array(number, dtype=np.int64),
        direction.astype(np.int64),
    )


def leg_at(legs: Legs, times_s: FloatArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return dive, leg (both from 1) and direction at moments; 0 each where there is none.

    Args:
        legs: Of all dives.
        times_s: Of the same clock, any order, shape ``(n,)``.

    Returns:
        Three arrays of shape ``(n,)``.
    """
    none = np.zeros(times_s.size, dtype=np.int64)
    if legs.dive.size == 0:
        return none, none.copy(), none.copy()
    # a turn belongs to the leg that it begins
    leg = np.searchsorted(legs.begin_s, times_s, side="right") - 1
    inside = (leg >= 0) & (times_s <= legs.end_s[np.maximum(leg, 0)])
    number = np.where(inside, leg + 1, 0)
    return (
        np.where(inside, legs.dive[np.maximum(leg, 0)], 0),
        number,
        np.where(inside, legs.direction[np.maximum(leg, 0)], 0),
    )
