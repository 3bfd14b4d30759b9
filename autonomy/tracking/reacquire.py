"""How a robot swims that has lost its target: in circles, one to each side in turn.

On a straight course a range does not tell the two sides apart, and a target that moves could
imitate any turn to one side only. Along a full circle the range to a target that stays swings once
by the circle's diameter, and where it does so gives the bearing.
"""

import math

from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.control.control_kernel import SPEED_TIME_S

CIRCLE_NOISES = 1.5
"""Radius of the circle, in standard deviations of one range."""
RANGES_A_TURN = 8.0
"""At least so many ranges are asked for along one circle."""
TURN_SHARE = 0.8
"""Share of the most turn rate that is used."""
SPEED_SHARE = 0.5
"""Share of the speed cap that the robot strives for."""


class SearchCircle:
    """The re-acquire manoeuvre, from its beginning on.

    Args:
        config: Limits of the robot, and the noise and period of its ranges.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._side = 1.0
        self._turned_rad = 0.0

    def command(self, speed_m_s: float, dt_s: float) -> tuple[float, float]:
        """Return turn rate (rad/s) and acceleration (m/s2) for the next ``dt_s``."""
        motion, ranging = self._config.motion, self._config.ranging
        radius = CIRCLE_NOISES * math.sqrt(ranging.variance_m2)
        rate = max(abs(speed_m_s), motion.speed_min_m_s) / radius
        rate = min(rate, 2.0 * math.pi / (RANGES_A_TURN * ranging.period_s))
        rate = min(rate, TURN_SHARE * motion.turn_rate_max_rad_s)
        self._turned_rad += rate * dt_s
        if self._turned_rad >= 2.0 * math.pi:
            self._turned_rad = 0.0
            self._side = -self._side
        wanted = (SPEED_SHARE * motion.speed_max_m_s - speed_m_s) / SPEED_TIME_S
        acceleration = min(max(wanted, motion.acceleration_min_m_s2), motion.acceleration_max_m_s2)
        return self._side * rate, acceleration
