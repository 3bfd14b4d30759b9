"""The depth that a leg should have at each moment, as gently as the pump can follow."""

import math

from simulator.onboard.pilot import DepthReference


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
