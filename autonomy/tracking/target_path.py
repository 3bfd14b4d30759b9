"""Where a target is that moves along a known path: virtual targets, simulated tags, scenarios."""

import math
from typing import Final, NamedTuple

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.tracking.config import TargetConfig

STATIC, LINE, SINE, CIRCLE = range(4)
"""Number of each path in a packed one."""

_NUMBERS: Final = {"static": STATIC, "line": LINE, "sine": SINE, "circle": CIRCLE}
PATH_SIZE = 7
"""Length of a packed path: number, north, east, speed, heading, width, period."""


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


def pack_path(config: TargetConfig) -> FloatArray:
    """Return a target's path as ``place_kernel`` takes it, shape ``(PATH_SIZE,)``."""
    kind = "static" if config.kind == "beacon" else config.path
    numbers = (
        float(_NUMBERS[kind]),
        config.north_m,
        config.east_m,
        config.speed_m_s,
        config.heading_rad,
        config.width_m,
        config.period_s,
    )
    return np.array(numbers)


@kernel
def place_kernel(path: FloatArray, t_s: float) -> tuple[float, float, float, float]:
    """Do the work of ``place`` on a packed path: north, east (m) and their rates (m/s)."""
    number, speed, width = path[0], path[3], path[5]
    along, across, fast, sideways = 0.0, 0.0, 0.0, 0.0
    if number == LINE:
        along, fast = speed * t_s, speed
    elif number == SINE:
        rate = 2.0 * math.pi / path[6]
        along, fast = speed * t_s, speed
        across, sideways = width * math.sin(rate * t_s), width * rate * math.cos(rate * t_s)
    elif number == CIRCLE:
        turned = speed * t_s / width
        along, across = width * math.sin(turned), width * (1.0 - math.cos(turned))
        fast, sideways = speed * math.cos(turned), speed * math.sin(turned)
    c, s = math.cos(path[4]), math.sin(path[4])
    north = path[1] + along * c - across * s
    east = path[2] + along * s + across * c
    return north, east, fast * c - sideways * s, fast * s + sideways * c


def warm_up() -> None:
    """Compile the kernel."""
    place_kernel(np.ones(PATH_SIZE), 0.0)
