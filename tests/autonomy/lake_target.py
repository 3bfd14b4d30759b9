"""A target that stays in the lake, and ways past it."""

import math

import numpy as np

from autonomy.tracking.config import TRACKING_PRESETS
from reproduction.tracking import unicycle

LAKE = TRACKING_PRESETS["grace3"]
TARGET = (LAKE.target.north_m + 6.0, LAKE.target.east_m - 4.0)
START = (LAKE.target.north_m, LAKE.target.east_m - 24.0)
STD_M = math.sqrt(LAKE.ranging.variance_m2)
SPEED_M_S = 0.12


def mirrored(place):
    """Return the place across the eastward course from ``START``."""
    return (2.0 * START[0] - place[0], place[1])


def courses(*legs):
    """Return a pose each second along legs of a heading and a time, and whither each leads."""
    pose, way = (*START, 0.0, SPEED_M_S), []
    for heading, seconds in legs:
        pose = (pose[0], pose[1], heading, SPEED_M_S)
        for _ in range(seconds):
            way.append(pose)
            pose = unicycle.advance(pose, 0.0, 0.0, 1.0)
    return way


EAST = (0.5 * math.pi, 60)
NORTH = (0.0, 90)


def heard_along(way, seed=1):
    noise = np.random.default_rng(seed)
    return [abs(math.dist(pose[:2], TARGET) + STD_M * noise.standard_normal()) for pose in way]
