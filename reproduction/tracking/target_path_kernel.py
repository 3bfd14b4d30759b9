"""Where a target is, compiled; ``target_path.place`` is the readable twin."""

import math
from typing import Final

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.tracking.config import TargetConfig

STATIC, LINE, SINE, CIRCLE = range(4)
"""Number of each path in a packed one."""

_NUMBERS: Final = {"static": STATIC, "line": LINE, "sine": SINE, "circle": CIRCLE}
PATH_SIZE = 7
"""Length of a packed path: number, north, east, speed, heading, width, period."""


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
