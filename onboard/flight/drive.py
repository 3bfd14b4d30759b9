"""Driven by hand: from the pilot's stick to set points, and what the robot does without one."""

import math

from autonomy.tracking.control.inner_loop import TailBeat
from onboard.flight.hardware import SetPoints
from onboard.flight.level import LevelKeeper
from onboard.flight.maneuver import Flight
from onboard.flight.navigation import Estimate
from onboard.flight.pilot import forward_speed
from onboard.flight.safety import kept_from_walls_m
from robot_link.drive import CENTRE, RELEASE_S, SILENCE_S, Stick
from robot_link.messages import RobotMode

_BIAS_MAX_RAD = 1.35
"""Tail bias of a full turn; a flapping robot turns at a rate nearly proportional to the bias."""
_LOOK_AHEAD_S = 8.0
"""The way of so long at its speed is looked at for walls: it goes on long after its tail stopped,
and turns slowly at first."""
_LOOK_ASIDE_RAD = math.radians(60.0)
_SINKING_SHARE = 0.5
"""Speed of the wanted depth at full stick, as a share of the swimming speed."""
_ROUNDING_S = 1e-6


class Driven:
    """Acts on the newest stick, for as long as one keeps coming.

    Driven are speed ahead (amplitude of the tail's beat), turn (its bias; the tail beats for a turn
    on the spot too) and, where radio passes under water, depth. A robot of this kind cannot swim
    backwards: a stick that is pulled back is one in the middle. Where a wall or the shore is ahead
    of a robot that shall swim on, it turns away from it instead, since it has no brake. Without a
    stick for ``SILENCE_S`` the tail stops and the robot comes up; after ``RELEASE_S`` nobody drives
    it any more.

    Args:
        flight: The robot.
        estimate: Where it begins.
        period_s: Time between two steps.
    """

    mode = RobotMode.DRIVEN

    def __init__(self, flight: Flight, estimate: Estimate, period_s: float) -> None:
        self._flight = flight
        self._estimate = estimate
        self._period_s = period_s
        self._stick = CENTRE
        self._silent_s = 0.0
        self._wanted_m = 0.0
        self._away = 0.0
        self._level: LevelKeeper | None = None
        self.acts_on = CENTRE
        """The stick, but for what is held back."""
        self.is_kept_off = False
        """Whether it does not swim on because a wall or the shore is ahead."""

    @property
    def is_silent(self) -> bool:
        """Whether it hears no stick."""
        return self._silent_s >= SILENCE_S - _ROUNDING_S

    def hear(self, stick: Stick) -> None:
        """Take where the stick is now."""
        self._stick = stick
        self._silent_s = 0.0
        self._decide()

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Return the set points of the stick."""
        self._estimate = estimate
        self._silent_s += dt_s
        self._decide()
        level = self._at_depth(estimate, dt_s)
        return self._flight.pilot.beat(estimate, self._beat(), level)

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether nobody drives it any more."""
        del estimate
        return self._silent_s >= RELEASE_S - _ROUNDING_S

    def _decide(self) -> None:
        """Find what of the stick is acted on where the robot is."""
        stick = CENTRE if self.is_silent else self._stick
        forward = max(stick.forward, 0.0)
        self._away = self._turn_away() if forward > 0.0 else 0.0
        self.is_kept_off = self._away != 0.0
        up = stick.up if self._deepest_m() > 0.0 else 0.0
        turn, forward = (self._away, 0.0) if self.is_kept_off else (stick.turn, forward)
        self.acts_on = Stick(forward, turn, up)

    def _beat(self) -> TailBeat:
        swim, acts_on = self._flight.vehicle.swim, self.acts_on
        share = max(acts_on.forward, abs(acts_on.turn))
        if share == 0.0:
            return TailBeat(0.0, 0.0, 0.0)
        bias = -_BIAS_MAX_RAD * acts_on.turn
        return TailBeat(bias, share * swim.amplitude_rad, swim.frequency_hz)

    def _turn_away(self) -> float:
        """Return the turn (-1 or 1) away from a wall that is ahead, 0 where none is.

        No wall is ahead of a robot that is near one and heads back into the open.
        """
        estimate, flight = self._estimate, self._flight
        kept_m = kept_from_walls_m(flight, estimate)
        ahead_m = self._clearance_m(0.0)
        north, east, _ = estimate.position_ned
        if ahead_m >= kept_m or ahead_m > flight.site.clearance_m(north, east):
            return 0.0
        port, starboard = (self._clearance_m(side) for side in (-_LOOK_ASIDE_RAD, _LOOK_ASIDE_RAD))
        return self._away or (1.0 if starboard > port else -1.0)

    def _clearance_m(self, aside_rad: float) -> float:
        """Return how far from walls and shore the robot soon is, with that course."""
        estimate, flight = self._estimate, self._flight
        north, east, _ = estimate.position_ned
        speed_m_s = max(forward_speed(estimate), flight.profile.entry_speed_m_s)
        reach_m = _LOOK_AHEAD_S * speed_m_s
        course = estimate.course_heading_rad + aside_rad
        return flight.site.clearance_m(
            north + reach_m * math.cos(course), east + reach_m * math.sin(course)
        )

    def _deepest_m(self) -> float:
        """Return the greatest depth that may be wanted here; 0 where radio ends at the surface."""
        flight = self._flight
        if not flight.site.radio_under_water:
            return 0.0
        north, east, _ = self._estimate.position_ned
        floor_m = float(flight.site.floor_m(north, east))
        return max(floor_m - 2.0 * flight.profile.floor_margin_m, 0.0)

    def _at_depth(self, estimate: Estimate, dt_s: float) -> SetPoints | None:
        """Return what keeps the wanted depth, None at the surface."""
        profile = self._flight.profile
        rate_m_s = _SINKING_SHARE * profile.swimming_speed_m_s
        wanted_m = self._wanted_m - self.acts_on.up * rate_m_s * dt_s
        self._wanted_m = 0.0 if self.is_silent else min(max(wanted_m, 0.0), self._deepest_m())
        if self._wanted_m <= profile.surfaced_m:
            self._level = None
            return None
        if self._level is None:
            self._level = LevelKeeper(
                self._flight.vehicle, profile.depth_leash_m, estimate, self._period_s
            )
        return self._level.step(estimate, self._wanted_m)
