"""A target that stays in the lake, and ways past it."""

import math
from collections.abc import Sequence

import numpy as np

from autonomy.tracking.config import TRACKING_PRESETS
from reproduction.tracking import unicycle

LAKE = TRACKING_PRESETS["grace3"]
TARGET = (LAKE.target.north_m + 6.0, LAKE.target.east_m - 4.0)
START = (LAKE.target.north_m, LAKE.target.east_m - 24.0)
STD_M = math.sqrt(LAKE.ranging.variance_m2)
SPEED_M_S = 0.12
Pose = tuple[float, float, float, float]
"""North and east, m, heading, rad, and speed, m/s."""


def mirrored(place: tuple[float, float]) -> tuple[float, float]:
    """Return the place across the eastward course from ``START``."""
    return (2.0 * START[0] - place[0], place[1])


def courses(*legs: tuple[float, int]) -> list[Pose]:
    """Return a pose each second along legs of a heading and a time, and whither each leads."""
    pose: Pose = (*START, 0.0, SPEED_M_S)
    way: list[Pose] = []
    for heading, seconds in legs:
        pose = (pose[0], pose[1], heading, SPEED_M_S)
        for _ in range(seconds):
            way.append(pose)
            pose = unicycle.advance(pose, 0.0, 0.0, 1.0)
    return way


EAST = (0.5 * math.pi, 60)
NORTH = (0.0, 90)


def heard_along(way: Sequence[Pose], seed: int = 1) -> list[float]:
    """Return the range to the target heard at each pose."""
    noise = np.random.default_rng(seed)
    return [abs(math.dist(pose[:2], TARGET) + STD_M * noise.standard_normal()) for pose in way]
