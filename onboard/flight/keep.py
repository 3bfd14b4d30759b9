"""Keeps a place at the surface: floats, and swims back when it has drifted too far."""

import math

from autonomy.planner.plan import Leg
from onboard.flight.hardware import SetPoints
from onboard.flight.maneuver import Flight, Swim, bearing, distance
from onboard.flight.navigation import Estimate
from robot_link.messages import RobotMode

INNER_SHARE = 0.25
"""Part of the radius to which it comes back."""


class Keep:
    """Stays within a radius of a place until a time is over.

    Args:
        flight: The robot.
        leg: Place, radius and duration; a radius that the robot cannot tell it has reached is
            widened to where a swim has arrived.
        passed_s: Time of the stay that is over already, if it was interrupted.
    """

    def __init__(self, flight: Flight, leg: Leg, passed_s: float = 0.0) -> None:
        self._flight = flight
        self._place = leg.end_ned[:2]
        self._radius_m = max(leg.radius_m, flight.profile.arrival_m)
        self._duration_s = leg.duration_s
        self._return: Swim | None = None
        self._coasted_s = math.inf
        self.passed_s = passed_s
        """Time of the stay that is over."""

    @property
    def mode(self) -> RobotMode:
        """Swimming on the way back, else lying at the surface."""
        return RobotMode.SURFACED if self._return is None else RobotMode.SWIMMING

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Stay on."""
        self.passed_s += dt_s
        self._coasted_s += dt_s
        if self._return is not None and self._comes_back(estimate):
            self._return, self._coasted_s = None, 0.0
        elif self._return is None and self._is_away(estimate):
            self._return = Swim(self._flight, self._place, estimate)
        if self._return is None:
            return self._flight.pilot.rest()
        return self._return.step(estimate, dt_s)

    def _is_away(self, estimate: Estimate) -> bool:
        """Tell whether the robot has drifted too far, and coasts no more."""
        is_coasting = self._coasted_s < self._flight.profile.coast_s
        return not is_coasting and distance(estimate, self._place) > self._radius_m

    def _comes_back(self, estimate: Estimate) -> bool:
        """Tell whether the robot is back, or will be when what it has of speed is used up."""
        away_m = distance(estimate, self._place)
        to_place = bearing(estimate, self._place)
        north, east, _ = estimate.velocity_ned
        closing_m_s = north * math.cos(to_place) + east * math.sin(to_place)
        return away_m - self._flight.profile.coast_s * closing_m_s < INNER_SHARE * self._radius_m

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the time is over."""
        return self.passed_s >= self._duration_s

    def share(self, estimate: Estimate) -> float:
        """Return the part of the time that is over."""
        return self.passed_s / self._duration_s
