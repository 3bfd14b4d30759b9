"""What the robot has spent of its energy budget, in the plan's own units."""

import math

from autonomy.planner.config import EnergyConfig
from autonomy.planner.plan import Leg


class EnergyAccount:
    """Counts energy units as the planner does (thesis section 5.5.2).

    Each leg's price falls due evenly as the leg is flown, and time costs whatever it is spent on.
    So a mission flown as planned costs what was planned, and delays cost their time. Turning and
    floating at the surface before a dive costs its time, which a plan counts in advance.

    Args:
        config: Prices.
    """

    def __init__(self, config: EnergyConfig) -> None:
        self._config = config
        self._settled = 0.0
        self._leg_work = 0.0
        self._leg_share = 0.0

    @property
    def used(self) -> float:
        """Energy units spent since the mission began."""
        return self._settled + self._leg_work * self._leg_share

    def begin_leg(self, leg: Leg) -> None:
        """Start to charge a leg, after ending the one before."""
        self.end_leg()
        self._leg_work = max(0.0, leg.energy - self._config.time_factor * leg.duration_s)

    def fly_leg(self, share: float) -> None:
        """Note that this part (0..1) of the leg is flown; it never shrinks."""
        self._leg_share = max(self._leg_share, min(share, 1.0))

    def end_leg(self) -> None:
        """Settle the part of the leg that was flown."""
        self._settled = self.used
        self._leg_work = self._leg_share = 0.0

    def beat_tail(self, amplitude_rad: float, frequency_hz: float, dt_s: float) -> None:
        """Charge ``dt_s`` seconds of a beating tail that no leg pays for, over whole beats."""
        rate = amplitude_rad * frequency_hz
        self._settled += self._config.swim_factor * 2.0 * math.pi**2 * rate * rate * dt_s

    def pass_time(self, dt_s: float) -> None:
        """Charge ``dt_s`` seconds of the electronics."""
        self._settled += self._config.time_factor * dt_s
