"""Missions of all kinds of legs, drawn: dives of two glides, of spirals, in place, and swims.

Each dive begins where the one before came up, goes to a depth between a quarter and nine tenths of
what the domain allows, along a heading that keeps it in the domain. Of twenty dives twelve are of
two glides, four of a glide down and a spiral up, two in place; one is a swim at the surface, one a
stay there.
"""

import math

import numpy as np

from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import primitive
from autonomy.planner.plan import Leg
from autonomy.site import Box
from autonomy.vehicle.trim import TrimConfig
from robot_link.mission import Mission, MissionSettings

_KINDS = ("glides", "spiral", "place", "swim", "keep")
_SHARES = (0.6, 0.2, 0.1, 0.05, 0.05)
_STAY_S, _STAY_RADIUS_SHARE = 60.0, 0.1
_BORDER_SHARE = 0.12
"""Of the domain's sides, kept free at its border."""


def mission_of(
    generator: np.random.Generator,
    config: PlannerConfig,
    duration_s: float,
    max_uncertainty_m: float | None = None,
) -> Mission:
    """Return a mission whose legs take about a time, surfacings included."""
    here = _inside(generator, config.domain)
    start, legs, total_s = here, [], 0.0
    while total_s < duration_s:
        dive = _dive(generator, config, here)
        legs += dive
        total_s += sum(leg.duration_s for leg in dive) + config.mission.turn_time_s
        here = legs[-1].end_ned[:2]
    if max_uncertainty_m is not None:
        config = config.model_copy(update={"max_uncertainty_m": max_uncertainty_m})
    settings = MissionSettings.of(config, TrimConfig(), (*start, 0.0), total_s)
    return Mission.from_legs(settings, tuple(legs))


def _dive(
    generator: np.random.Generator, config: PlannerConfig, here: tuple[float, float]
) -> list[Leg]:
    kind = generator.choice(_KINDS, p=_SHARES)
    limits, domain = config.primitives, config.domain
    deepest = domain.depth_max_m - (0.0 if config.floor_margin_m is None else config.floor_margin_m)
    top = (*here, 0.0)
    depth = float(max(generator.uniform(0.25, 0.9) * deepest, limits.depth_change_min_m))
    if kind == "place":
        down = primitive.dive(config, top, depth)
        return [down, primitive.dive(config, down.end_ned, 0.0)]
    if kind == "keep":
        radius = _STAY_RADIUS_SHARE * (domain.x_max_m - domain.x_min_m)
        return [primitive.keep(config, top, radius, _STAY_S)]
    angle = generator.uniform(limits.glide_angle_min_rad, limits.glide_angle_max_rad)
    if kind == "swim":
        length = float(generator.uniform(limits.swim_length_min_m, limits.swim_length_max_m))
        end = _ahead(generator, domain, here, length)
        return [primitive.swim(config, top, (*end, 0.0))]
    reach = depth / math.tan(angle)
    end = _ahead(generator, domain, here, 2.0 * reach)
    middle = (0.5 * (here[0] + end[0]), 0.5 * (here[1] + end[1]), depth)
    down = primitive.glide(config, top, middle)
    if kind == "glides":
        return [down, primitive.glide(config, middle, (*end, 0.0))]
    radius = float(generator.uniform(limits.spiral_radius_min_m, limits.spiral_radius_max_m))
    rise = generator.uniform(limits.spiral_rise_min_m_rad, limits.spiral_rise_max_m_rad)
    turn = float(math.copysign(depth / rise, generator.uniform(-1.0, 1.0)))
    return [down, primitive.spiral(config, middle, down.heading_rad, radius, turn, 0.0)]


def _ahead(
    generator: np.random.Generator, domain: Box, here: tuple[float, float], length: float
) -> tuple[float, float]:
    """Return a place so far away, in a direction that stays in the domain; else its middle's."""
    for _ in range(40):
        heading = generator.uniform(-math.pi, math.pi)
        end = here[0] + length * math.cos(heading), here[1] + length * math.sin(heading)
        if _is_inside(domain, end):
            return end
    to = 0.5 * (domain.x_min_m + domain.x_max_m), 0.5 * (domain.y_min_m + domain.y_max_m)
    heading = math.atan2(to[1] - here[1], to[0] - here[0])
    return here[0] + length * math.cos(heading), here[1] + length * math.sin(heading)


def _bounds(domain: Box) -> tuple[tuple[float, float], tuple[float, float]]:
    slack = tuple(
        _BORDER_SHARE * side
        for side in (domain.x_max_m - domain.x_min_m, domain.y_max_m - domain.y_min_m)
    )
    low = domain.x_min_m + slack[0], domain.y_min_m + slack[1]
    return low, (domain.x_max_m - slack[0], domain.y_max_m - slack[1])


def _is_inside(domain: Box, place: tuple[float, float]) -> bool:
    low, high = _bounds(domain)
    return all(a <= x <= b for a, x, b in zip(low, place, high, strict=True))


def _inside(generator: np.random.Generator, domain: Box) -> tuple[float, float]:
    low, high = _bounds(domain)
    return float(generator.uniform(low[0], high[0])), float(generator.uniform(low[1], high[1]))
