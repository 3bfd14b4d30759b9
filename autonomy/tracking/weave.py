"""How a robot swims after a target of whose place it is not sure: to and fro across its course.

On a straight course every turned image of the target's motion gives the same ranges; each turn
tells some of them apart. A fast target leaves no time for circles: the robot swings as far off its
course as it can and still keep up.
"""

import math

from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.filter.joint import Belief

UNSURE, SURE = 0.3, 0.15
"""Standard deviation of the place, against the newest range, from which on the robot weaves, and
below which it goes straight again."""
CHASED, CAUGHT = 0.4, 0.2
"""The same of the probability that the target is faster than the robot may be: most targets that
seem so are misplaced."""
LEAST_RAD, MOST_RAD = 0.4, 1.5
"""Least and most swing off the course."""
LEGS = 3.0
"""A leg takes so many times as long as the turn that leads from one to the other."""


class Weave:
    """Swings to and fro while it is wanted.

    Args:
        config: Limits of the robot, and the noise of its ranges.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._motion = config.motion
        self._range_std_m = math.sqrt(config.ranging.variance_m2)
        self._since_s: float | None = None

    def turn_rate(
        self, now_s: float, belief: Belief, own_ne_m: tuple[float, float], heading_rad: float
    ) -> float | None:
        """Return the turn rate for now, rad/s, or None where the robot need not weave.

        Args:
            now_s: Time since the beginning.
            belief: Of the target.
            own_ne_m: Where the robot is.
            heading_rad: Whither it swims.
        """
        north = belief.place_ne_m[0] - own_ne_m[0]
        east = belief.place_ne_m[1] - own_ne_m[1]
        doubt = belief.worst_std_m / max(belief.range_m, math.hypot(north, east), self._range_std_m)
        if doubt > UNSURE or belief.faster_than_cap > CHASED:
            self._since_s = now_s if self._since_s is None else self._since_s
        elif doubt < SURE and belief.faster_than_cap < CAUGHT:
            self._since_s = None
        if self._since_s is None:
            return None
        most = self._motion.turn_rate_max_rad_s
        share = min(belief.speed_m_s / self._motion.speed_max_m_s, 1.0)
        swing = min(max(math.acos(share), LEAST_RAD), MOST_RAD)
        if belief.faster_than_cap > CHASED:
            swing = MOST_RAD
        legs = (now_s - self._since_s) / (LEGS * 2.0 * swing / most)
        side = 1.0 if int(legs) % 2 == 0 else -1.0
        off = math.remainder(math.atan2(east, north) + side * swing - heading_rad, math.tau)
        return min(max(2.0 * most * off, -most), most)
