"""The vertical part of a leg: how deep to be, how long it takes, when it is over."""

import math

from autonomy.planner.plan import Leg
from onboard.flight.course import is_surface
from onboard.flight.maneuver import Flight
from onboard.flight.navigation import Estimate
from onboard.flight.pilot import DepthReference

TIMEOUT_FACTOR, TIMEOUT_S = 2.5, 60.0
PUMPING_SHARE = 0.6
"""Part of the pump's way back to neutral during which the robot still moves on."""


class DepthProfile:
    """Depth that ramps to a steady rate, never far from the depth that the robot has.

    Args:
        depth_m: Depth at the beginning.
        rate_m_s: Rate of depth at the beginning, positive down.
        wanted_rate_m_s: Rate to settle at.
        acceleration_m_s2: Greatest change of the rate that the buoyancy pump can make.
        leash_m: Greatest distance between reference and robot; a robot that cannot follow does not
            build up an error that it would overshoot by.
    """

    def __init__(
        self,
        depth_m: float,
        rate_m_s: float,
        wanted_rate_m_s: float,
        acceleration_m_s2: float,
        leash_m: float,
    ) -> None:
        self._depth_m = depth_m
        self._rate_m_s = rate_m_s
        self._wanted_rate_m_s = wanted_rate_m_s
        self._acceleration_m_s2 = acceleration_m_s2
        self._leash_m = leash_m

    def step(self, depth_m: float, dt_s: float) -> DepthReference:
        """Return the reference ``dt_s`` later, given where the robot is."""
        limit = self._acceleration_m_s2
        acceleration = min(max((self._wanted_rate_m_s - self._rate_m_s) / dt_s, -limit), limit)
        self._rate_m_s += acceleration * dt_s
        ahead = self._depth_m + self._rate_m_s * dt_s - depth_m
        self._depth_m = depth_m + math.copysign(min(abs(ahead), self._leash_m), ahead)
        return DepthReference(self._depth_m, self._rate_m_s, acceleration)


class DepthChange:
    """Takes the robot to a depth at a rate, and knows when it has to turn round.

    Args:
        flight: The robot.
        legs: The leg, and those after it until the next surfacing.
        rate_m_s: Rate of depth, positive down, not 0.
        estimate: Where it begins.
    """

    def __init__(
        self, flight: Flight, legs: tuple[Leg, ...], rate_m_s: float, estimate: Estimate
    ) -> None:
        self.rate_m_s = rate_m_s
        """Rate of depth to hold, positive down."""
        self._flight = flight
        self._start_m = estimate.depth_m
        self._end_m = legs[0].end_ned[2]
        self._goes_on = len(legs) > 1 and (legs[1].end_ned[2] - self._end_m) * rate_m_s > 0.0
        self._reference = DepthProfile(
            self._start_m,
            estimate.velocity_ned[2],
            rate_m_s,
            flight.profile.reversal_m_s2,
            flight.profile.depth_leash_m,
        )
        self._patience_s = TIMEOUT_FACTOR * self.time_left_s(estimate) + TIMEOUT_S

    def step(self, estimate: Estimate, dt_s: float) -> DepthReference:
        """Return the depth to be at."""
        self._patience_s -= dt_s
        return self._reference.step(estimate.depth_m, dt_s)

    def time_left_s(self, estimate: Estimate) -> float:
        """Return how long the rest takes at the leg's rate."""
        return abs((self._end_m - estimate.depth_m) / self.rate_m_s)

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the depth is reached, or will be while the robot turns round."""
        if self._patience_s < 0.0:
            return True
        if is_surface(self._end_m):
            return self._flight.is_surfaced(estimate)
        down = math.copysign(1.0, self.rate_m_s)
        coasting_m = 0.0 if self._goes_on else self._coasting_m(estimate, down)
        return down * (self._end_m - estimate.depth_m) <= coasting_m

    def share(self, estimate: Estimate) -> float:
        """Return the part (0..1) of the depth change that is done."""
        whole = self._end_m - self._start_m
        done = estimate.depth_m - self._start_m
        return 1.0 if whole == 0.0 else min(max(done / whole, 0.0), 1.0)

    def _coasting_m(self, estimate: Estimate, down: float) -> float:
        """Return how far the robot moves on until pump and mass have turned it round."""
        rate = max(down * estimate.velocity_ned[2], 0.0)
        net_buoyancy = max(down * estimate.readings.net_buoyancy_kg, 0.0)
        pumping_s = net_buoyancy / self._flight.vehicle.limits.m0_rate_kg_s
        reversing_s = rate / self._flight.profile.reversal_m_s2
        return rate * (0.5 * reversing_s + PUMPING_SHARE * pumping_s)
