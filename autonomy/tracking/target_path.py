"""Where a target is that moves along a known path: virtual targets, simulated tags, scenarios."""

import math
from typing import NamedTuple

from autonomy.tracking.config import TargetConfig


class TargetPlace(NamedTuple):
    """Where a target is and how it moves, horizontal NED frame of the site."""

    north_m: float
    east_m: float
    north_m_s: float
    east_m_s: float


def place(config: TargetConfig, t_s: float) -> TargetPlace:
    """Return where a target is, a time after it set out from its configured position.

    A sine swings across the course along which the target advances at its speed; a circle of
    radius ``width_m`` turns to starboard and begins in the direction of the heading.

    Args:
        config: Path of the target; a beacon stays whatever its path says.
        t_s: Time since the start, s; the path goes on backwards for negative ones.
    """
    kind = "static" if config.kind == "beacon" else config.path
    course, speed, width = config.heading_rad, config.speed_m_s, config.width_m
    along, across, fast, sideways = 0.0, 0.0, 0.0, 0.0
    if kind == "line":
        along, fast = speed * t_s, speed
    elif kind == "sine":
        rate = 2.0 * math.pi / config.period_s
        along, fast = speed * t_s, speed
        across, sideways = width * math.sin(rate * t_s), width * rate * math.cos(rate * t_s)
    elif kind == "circle":
        turned = speed * t_s / width
        along, across = width * math.sin(turned), width * (1.0 - math.cos(turned))
        fast, sideways = speed * math.cos(turned), speed * math.sin(turned)
    c, s = math.cos(course), math.sin(course)
    return TargetPlace(
        config.north_m + along * c - across * s,
        config.east_m + along * s + across * c,
        fast * c - sideways * s,
        fast * s + sideways * c,
    )
