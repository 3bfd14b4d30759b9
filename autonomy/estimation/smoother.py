r"""Tracks of finished dives, smoothed backwards from the fix that ended them.

Under water nothing observes the horizontal position: its error is a random walk, and the way that a
steady current has made of which the robot knew only the standard deviation b. At a time t and a
later one t' after the dive began, the errors have the covariance

.. math::
    P(t, t') = W(t) + b^2 t t', \qquad W(t) = P(t) - b^2 t^2,

where P(t) is the variance that the robot's filter states and W the walk's part of it. A fix of
variance R at the end T of the dive tells where both had gone by then, and so where they were:

.. math::
    \hat x(t) = x(t) + \frac{P(t, T)}{P(T) + R} (x_{fix} - x(T)), \qquad
    \hat P(t) = P(t) - \frac{P(t, T)^2}{P(T) + R}.

Without a current this is the Rauch-Tung-Striebel smoother of a random walk.

Source:
    Rauch, Tung and Striebel 1965; the thesis names smoothing as future work (section 5.6).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray

_FALL = 0.7
"""A fix makes the stated standard deviation fall below this part of what it was."""
_FEWEST_POINTS = 3
_LONGEST_GAP_S = 120.0
"""A dive whose end was not seen within this time of the fix is left as it is."""
_UNSEEN_TURN = 0.5
"""Part of the last speed by which the robot may have changed its velocity unseen."""
BELIEF_HOLDS_S = 3600.0
"""What a robot said of the current so long before a dive has been changed by fixes since."""
_SHORTEST_S = 1e-3
"""A dive of one moment has no time to drift in."""


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
    believed_ne_m_s: tuple[float, float] = (0.0, 0.0)
    """The current with which it reckoned."""
    believed_std_m_s: float = 0.0
    """How well it knew that, standard deviation per axis."""
    is_belief_told: bool = False
    """Whether it had said so."""

    @property
    def duration_s(self) -> float:
        """Time from its beginning to the fix."""
        return self.fix_time_s - self.start_s

    @property
    def jump_ne_m(self) -> tuple[float, float]:
        """How far from where it believed to be the robot was, north and east."""
        (north, east), (at_north, at_east) = self.fix_ne_m, self.reckoned_ne_m
        return north - at_north, east - at_east

    @property
    def drift_ne_m(self) -> tuple[float, float]:
        """How far the water had carried the robot, the current that it allowed for counted."""
        (north, east), (by_north, by_east) = self.jump_ne_m, self.believed_ne_m_s
        return north + by_north * self.duration_s, east + by_east * self.duration_s

    @property
    def carried_std_m(self) -> float:
        """Part of the stated standard deviation that not knowing the current made."""
        under_s = self.end_s - self.start_s  # what the filter said is of its last known point
        return min(self.believed_std_m_s * under_s, 0.999 * self.reckoned_std_m)

    @property
    def walk_std_m(self) -> float:
        """The rest of it: what no current explains."""
        return math.sqrt(self.reckoned_std_m**2 - self.carried_std_m**2)

    @property
    def current_ne_m_s(self) -> tuple[float, float]:
        """Depth-averaged current that would explain the drift, north and east."""
        north, east = self.drift_ne_m
        return north / self.duration_s, east / self.duration_s

    @property
    def surprise(self) -> float:
        """Squared jump over its expected variance; about 1 where the filter is honest."""
        north, east = self.jump_ne_m
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
    time_s: FloatArray,
    position_ned: FloatArray,
    position_std_m: FloatArray,
    beliefs: FloatArray | None = None,
) -> tuple[Dive, ...]:
    """Find the dives of a track that a fix has ended.

    Args:
        time_s: Ascending times of the track's points, shape ``(n,)``, s.
        position_ned: Where the robot believed to be, shape ``(n, 3)``, m.
        position_std_m: What it said of that, shape ``(n,)``, m. A fix is seen by its fall.
        beliefs: What it said of the current: time s, north, east and standard deviation m/s, in
            order of time, shape ``(m, 4)``; None of a robot that reckons with none. What it said
            longer than ``BELIEF_HOLDS_S`` before a dive is not what it reckoned that with.

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
        dive = _dive(time_s, position_ned, position_std_m, first, fix)
        found.append(dive if beliefs is None else _believing(dive, beliefs))
    return tuple(found)


def smooth_dive(
    dive: Dive, time_s: FloatArray, position_ned: FloatArray, position_std_m: FloatArray
) -> Smoothed:
    """Move points of a dive by what its fix tells of them.

    Args:
        dive: The dive that they belong to.
        time_s: When that was, shape ``(n,)``, s.
        position_ned: Where the robot believed to be, shape ``(n, 3)``, m; the points of the track
            or any other moments of the dive, such as those of its samples.
        position_std_m: What its filter said of that then, shape ``(n,)``, m.
    """
    at_end = dive.reckoned_std_m**2 + dive.fix_std_m**2
    lasted_s = max(dive.end_s - dive.start_s, _SHORTEST_S)
    elapsed = np.clip((time_s - dive.start_s) / lasted_s, 0.0, 1.0)  # (n,)
    carried = dive.carried_std_m**2
    walked = np.clip(position_std_m**2 - carried * elapsed**2, 0.0, dive.walk_std_m**2)
    shared = walked + carried * elapsed  # (n,) covariance with the error at the end
    moved = position_ned.copy()
    moved[:, :2] += (shared / at_end)[:, None] * np.array(dive.jump_ne_m)
    variance = walked + carried * elapsed**2 - shared**2 / at_end
    return Smoothed(moved, np.minimum(np.sqrt(np.maximum(variance, 0.0)), position_std_m))


def _believing(dive: Dive, beliefs: FloatArray) -> Dive:
    """Return a dive with what the robot had said last of the current when it ended."""
    known = int(np.searchsorted(beliefs[:, 0], dive.end_s, side="right"))
    if known == 0 or beliefs[known - 1, 0] < dive.start_s - BELIEF_HOLDS_S:
        return dive
    _, north, east, std = beliefs[known - 1].tolist()
    return replace(dive, believed_ne_m_s=(north, east), believed_std_m_s=std, is_belief_told=True)


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
