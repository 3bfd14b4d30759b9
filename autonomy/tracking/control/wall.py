"""Keeps a robot off walls and shore: it may do what it wants while it could still turn away.

A robot that cannot stop, and turns on a circle, is safe as long as the hardest turn to one side or
the other keeps it clear of every wall. When after the next moment neither would, it turns now, and
goes on turning to that side until it is free: a robot that made up its mind anew at each moment
would swing between two turns, and swim straight ahead.
"""

import math
from dataclasses import dataclass, replace

from autonomy.site import Site
from autonomy.tracking.reading import Pair

AHEAD_S = 0.5
"""Time for which the wanted command is looked at."""
ARC_RAD = 5.0 * math.pi / 6.0
"""A turn by so much leads away from any wall."""
ARC_STEPS = 16
FREE_STEPS = 10
"""A turn ends when so many steps in a row found the robot free; one may be wrong."""
TURNED_AFTER_LAGS = 1.0
"""A turn that comes about late takes so many of its time constants longer."""
GIVEN_AWAY_M = 0.01
"""A robot nearer than the margin may come so much nearer on the turn that leads it back."""
INWARD = 0.25
"""Part of its way by which a robot nearer than the margin gets farther off."""
WANTED_SIDE = 0.25
"""Part of a turn's radius that the better side must be farther off than the wanted one."""


@dataclass(frozen=True, slots=True)
class Helm:
    """How a robot answers when it turns as hard as it can."""

    turn_rate_rad_s: float
    """Rate of the course in the end."""
    lag_s: float = 0.0
    """Time constant with which rate and speed come about; 0 for a unicycle, which has them at
    once and keeps its speed."""
    speed_m_s: float = math.inf
    """Speed in the end; a faster robot slows down to it."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Where a robot is and how it moves, seen from above."""

    own_ne_m: Pair
    course_rad: float
    speed_m_s: float
    turn_rate_rad_s: float = 0.0


class WallGuard:
    """Turns one robot away from walls in time.

    Args:
        helm: How it turns.
        margin_m: Distance from walls and shore that it keeps where it can.
    """

    def __init__(self, helm: Helm, margin_m: float) -> None:
        self._helm = helm
        self._margin_m = margin_m
        self._side = 0.0
        self._free_steps = 0

    def step(self, now: Motion, wanted: Pair, site: Site) -> Pair | None:
        """Return the command that keeps clear of the walls, or None where the wanted one may stand.

        Args:
            now: How the robot moves; the size of its speed counts.
            wanted: Turn rate rad/s and acceleration m/s2.
            site: Its water, with walls and shore.
        """
        speed = abs(now.speed_m_s)
        now = replace(now, speed_m_s=speed)
        here = site.clearance_m(*now.own_ne_m)
        is_free = self._is_far(speed, here) or self._may(now, wanted, here, site)
        self._free_steps = self._free_steps + 1 if is_free else 0
        if is_free and (self._side == 0.0 or self._free_steps >= FREE_STEPS):
            self._side = 0.0
            return None
        if self._side == 0.0:
            self._side = self._better_side(now, wanted[0], site)
        return self._side * self._helm.turn_rate_rad_s, min(wanted[1], 0.0)

    def _is_far(self, speed_m_s: float, clearance_m: float) -> bool:
        """Tell whether no turn leads to a wall: none leads farther than its diameter."""
        helm = self._helm
        radius = speed_m_s / helm.turn_rate_rad_s
        reach = speed_m_s * (AHEAD_S + 2.0 * helm.lag_s)
        return clearance_m >= self._margin_m + reach + 2.0 * radius

    def _may(self, now: Motion, wanted: Pair, here_m: float, site: Site) -> bool:
        """Tell whether the robot can still turn away after a moment of what it wants."""
        then = _moved(now, wanted[0], self._helm.lag_s)
        reach = now.speed_m_s * AHEAD_S
        if site.clearance_m(*then.own_ne_m) < min(self._margin_m, here_m + INWARD * reach):
            return False
        enough = min(self._margin_m, here_m - GIVEN_AWAY_M)
        return any(_turn_clearance(then, side, self._helm, site) >= enough for side in (1.0, -1.0))

    def _better_side(self, now: Motion, wanted_rad_s: float, site: Site) -> float:
        starboard, port = (_turn_clearance(now, side, self._helm, site) for side in (1.0, -1.0))
        bonus = WANTED_SIDE * now.speed_m_s / self._helm.turn_rate_rad_s
        return 1.0 if starboard + math.copysign(bonus, wanted_rad_s) >= port else -1.0


def _turn_clearance(now: Motion, side: float, helm: Helm, site: Site) -> float:
    """Return the least distance to a wall along the hardest turn; -1 turns to port."""
    rate, lag = side * helm.turn_rate_rad_s, helm.lag_s
    dt_s = (ARC_RAD / helm.turn_rate_rad_s + TURNED_AFTER_LAGS * lag) / ARC_STEPS
    north, east = now.own_ne_m
    least = math.inf
    for n in range(ARC_STEPS):
        middle_s = (n + 0.5) * dt_s
        late = _late_s(lag, middle_s)
        course = now.course_rad + rate * middle_s + (now.turn_rate_rad_s - rate) * late
        slower = math.exp(-middle_s / lag) if lag > 0.0 else 1.0
        end_speed = min(helm.speed_m_s, now.speed_m_s)
        way = (end_speed + (now.speed_m_s - end_speed) * slower) * dt_s
        north, east = north + way * math.cos(course), east + way * math.sin(course)
        least = min(least, site.clearance_m(north, east))
    return least


def _moved(now: Motion, wanted_rad_s: float, lag_s: float) -> Motion:
    """Return the motion ``AHEAD_S`` later, when a turn rate has been wanted since."""
    missing = now.turn_rate_rad_s - wanted_rad_s
    middle = now.course_rad + 0.5 * AHEAD_S * wanted_rad_s
    middle += missing * _late_s(lag_s, 0.5 * AHEAD_S)
    later = now.course_rad + AHEAD_S * wanted_rad_s + missing * _late_s(lag_s, AHEAD_S)
    north, east = now.own_ne_m
    way = now.speed_m_s * AHEAD_S
    there = (north + way * math.cos(middle), east + way * math.sin(middle))
    left = math.exp(-AHEAD_S / lag_s) if lag_s > 0.0 else 0.0
    return Motion(there, later, now.speed_m_s, wanted_rad_s + missing * left)


def _late_s(lag_s: float, after_s: float) -> float:
    """Return for how long, after a time, what was missing at first has acted in all."""
    return lag_s * -math.expm1(-after_s / lag_s) if lag_s > 0.0 else 0.0
