"""Waters with shores, keep-outs and currents that the planner's tests share."""

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.planner.config import PlannedCurrentConfig, PlannerConfig
from autonomy.planner.leg import drift
from autonomy.planner.leg.edge import random_shape
from autonomy.planner.leg.waterway import usable_depth_m
from autonomy.planner.plan import Leg
from autonomy.site import TANK, Area, Bathymetry, Box, Site
from tests.autonomy.planner_problem import THESIS_TANK

POOL = Site(
    **TANK.model_dump(exclude={"kind", "shoreline", "bathymetry"}),
    kind="lake",
    shoreline=Area(
        name="Pool",
        corners_m=((-0.2, -0.1), (1.2, 0.1), (2.6, -0.1), (2.7, 1.2), (1.4, 1.5), (0.1, 1.3)),
    ),
    bathymetry=Bathymetry(
        north_m=(0.0, 0.9, 1.7, 2.75),
        east_m=(0.0, 0.33, 1.0, 1.37),
        depth_m=(
            (0.2, 0.4, 0.5, 0.2),
            (0.5, 0.8, 0.9, 0.5),
            (0.4, 0.5, 0.45, 0.6),
            (0.3, 0.6, 0.7, 0.3),
        ),
    ),
)
"""A pool in the thesis's tank: outline, a ridge, and shallow sides."""
BUOY = Area(name="Buoy", corners_m=((1.3, 0.55), (1.55, 0.5), (1.6, 0.8), (1.35, 0.75)))
NET = Area(name="Net", corners_m=((0.6, 1.0), (0.9, 1.1), (0.7, 1.4)))


Point: TypeAlias = tuple[float, float]


def pool_config(north_m_s: float = 0.0, east_m_s: float = 0.0) -> PlannerConfig:
    """The thesis's planner among keep-outs, in a current."""
    return THESIS_TANK.model_copy(
        update={
            "keep_outs": (BUOY, NET),
            "margin_m": 0.05,
            "floor_margin_m": 0.04,
            "current": PlannedCurrentConfig(north_m_s=north_m_s, east_m_s=east_m_s),
        }
    )


def proposals(
    config: PlannerConfig, count: int, seed: int = 0
) -> Iterator[tuple[Point, Point, FloatArray]]:
    """Starts, goals near them, and shapes."""
    rng = np.random.default_rng(seed)
    domain: Box = config.domain
    low = np.array([domain.x_min_m, domain.y_min_m])
    high = np.array([domain.x_max_m, domain.y_max_m])
    for _ in range(count):
        start = rng.uniform(low, high)
        turn = rng.uniform(0.0, 2.0 * math.pi)
        away = config.search.step_m * rng.uniform(0.2, 1.0)
        goal = np.clip(start + away * np.array([math.cos(turn), math.sin(turn)]), low, high)
        yield _point(start), _point(goal), random_shape(config, rng)


def _point(place: FloatArray) -> Point:
    return float(place[0]), float(place[1])


def true_track(config: PlannerConfig, legs: tuple[Leg, ...], per_leg: int = 60) -> np.ndarray:
    """Where a robot really is that flies legs, shape (m, 3)."""
    return np.array(
        [
            drift.position_at(leg, course, part)
            for leg, course in zip(legs, drift.courses(config, legs), strict=True)
            for part in np.linspace(0.0, 1.0, per_leg)
        ]
    )


def leaves_water_by_m(config: PlannerConfig, site: Site | None, track: np.ndarray) -> float:
    """How far below the usable depth a track goes at worst; an infinity beyond a margin."""
    usable = usable_depth_m(config, site, track[:, 0], track[:, 1])
    return float(np.where(usable < 0.0, np.inf, track[:, 2] - usable).max())
