r"""Tracks of finished dives, smoothed backwards from the fix that ended them.

Under water nothing observes the horizontal position: its error is a random walk whose variance
the robot's filter states. A fix tells where the walk had gone in the end, and so, in proportion,
where it was before. This is the Rauch-Tung-Striebel smoother of a random walk. Its gains
:math:`G_k = P_k / P_{k+1}` multiply to :math:`P_i / P_T` between point i and the end T of the dive,
so that

.. math::
    \hat x_i = x_i + \frac{P_i}{P_T} (\hat x_T - x_T), \qquad
    \hat P_i = P_i + \Big(\frac{P_i}{P_T}\Big)^2 (\hat P_T - P_T).

A steady current that the robot does not know is removed whole: its drift grows as P does.

Source:
    Rauch, Tung and Striebel 1965; the thesis names smoothing as future work (section 5.6).
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray

_FALL = 0.7
"""A fix makes the stated standard deviation fall below this part of what it was."""
_FEWEST_POINTS = 3
_LONGEST_GAP_S = 120.0
"""A dive whose end was not seen within this time of the fix is left as it is."""
_UNSEEN_TURN = 0.5
"""Part of the last speed by which the robot may have changed its velocity unseen."""


@dataclass(frozen=True, slots=True)
class Dive:
    """One stretch without a fix, and the fix that ended it."""

    start_s: float
    end_s: float
    """Times of its first and last known point, s."""
    fix_time_s: float
    fix_ne_m: tuple[float, float]
    """Where the robot was by the fix, north and east."""
    fix_std_m: float
    reckoned_ne_m: tuple[float, float]
    """Where the robot believed to be at the time of the fix, before it."""
    reckoned_std_m: float
    """What its filter had said of that."""

    @property
    def drift_ne_m(self) -> tuple[float, float]:
        """How far the robot had been carried from where it believed to be, north and east."""
        (north, east), (at_north, at_east) = self.fix_ne_m, self.reckoned_ne_m
        return north - at_north, east - at_east

    @property
    def current_ne_m_s(self) -> tuple[float, float]:
        """Depth-averaged current that would explain the drift, north and east."""
        duration_s = self.fix_time_s - self.start_s
        north, east = self.drift_ne_m
        return north / duration_s, east / duration_s

    @property
    def surprise(self) -> float:
        """Squared drift over its expected variance; about 1 where the filter is honest."""
        north, east = self.drift_ne_m
        return 0.5 * (north**2 + east**2) / (self.reckoned_std_m**2 + self.fix_std_m**2)


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """Points of a dive, moved to where they most probably were."""

    position_ned: FloatArray
    """Shape ``(n, 3)``, m; the depth is measured and stays."""
    position_std_m: FloatArray
    """Standard deviation of each horizontal position, shape ``(n,)``, m; never greater than
    before."""


def finished_dives(
    time_s: FloatArray, position_ned: FloatArray, position_std_m: FloatArray
) -> tuple[Dive, ...]:
    """Find the dives of a track that a fix has ended.

    Args:
        time_s: Ascending times of the track's points, shape ``(n,)``, s.
        position_ned: Where the robot believed to be, shape ``(n, 3)``, m.
        position_std_m: What it said of that, shape ``(n,)``, m. A fix is seen by its fall.

    Returns:
        Dives in order of time; those too short or with an unseen end are left out.
    """
    falls = np.flatnonzero(position_std_m[1:] < _FALL * position_std_m[:-1]) + 1
    found: list[Dive] = []
    for fix in falls.tolist():
        first = _start_of(position_std_m, fix - 1)
        gap_s = float(time_s[fix] - time_s[fix - 1])
        if fix - first < _FEWEST_POINTS or gap_s > _LONGEST_GAP_S:
            continue
        found.append(_dive(time_s, position_ned, position_std_m, first, fix))
    return tuple(found)


def smooth_dive(dive: Dive, position_ned: FloatArray, position_std_m: FloatArray) -> Smoothed:
    """Move points of a dive by what its fix tells of them.

    Args:
        dive: The dive that they belong to.
        position_ned: Where the robot believed to be, shape ``(n, 3)``, m; the points of the track
            or any other moments of the dive, such as those of its samples.
        position_std_m: What its filter said of that then, shape ``(n,)``, m.
    """
    walked = dive.reckoned_std_m**2
    fixed = dive.fix_std_m**2
    end_variance = walked * fixed / (walked + fixed)
    share = np.minimum(position_std_m**2 / walked, 1.0)  # (n,)
    update = walked / (walked + fixed) * np.array(dive.drift_ne_m)
    moved = position_ned.copy()
    moved[:, :2] += share[:, None] * update
    variance = position_std_m**2 + share**2 * (end_variance - walked)
    return Smoothed(moved, np.sqrt(np.maximum(variance, 0.0)))


def _start_of(position_std_m: FloatArray, last: int) -> int:
    """Return the point at which the dive that ends at ``last`` left its last fix.

    Before it the standard deviation rests, after it grows; a coarse wire repeats values.
    """
    first = last
    while first > 0 and position_std_m[first - 1] <= position_std_m[first]:
        first -= 1
    while first < last and position_std_m[first + 1] == position_std_m[first]:
        first += 1
    return first


def _dive(
    time_s: FloatArray,
    position_ned: FloatArray,
    position_std_m: FloatArray,
    first: int,
    fix: int,
) -> Dive:
    """Carry the last points on to the moment of the fix, and tell how unsure that is."""
    last = fix - 1
    gap_s = float(time_s[fix] - time_s[last])
    velocity = (position_ned[last, :2] - position_ned[last - 1, :2]) / (
        time_s[last] - time_s[last - 1]
    )
    reckoned = position_ned[last, :2] + gap_s * velocity
    unseen_m = _UNSEEN_TURN * gap_s * float(np.linalg.norm(velocity))
    fix_std_m = math.hypot(float(position_std_m[fix]), unseen_m)
    return Dive(
        start_s=float(time_s[first]),
        end_s=float(time_s[last]),
        fix_time_s=float(time_s[fix]),
        fix_ne_m=(float(position_ned[fix, 0]), float(position_ned[fix, 1])),
        fix_std_m=fix_std_m,
        reckoned_ne_m=(float(reckoned[0]), float(reckoned[1])),
        reckoned_std_m=float(position_std_m[last]),
    )
