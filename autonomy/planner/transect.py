"""Transects: lines of like dives that show a search how far its budget reaches.

In water much wider than a dive, a search that grows from random surfacings spends its time near
the start. A line that keeps its course is no masterpiece, but it crosses the water, and refining
bends it to where samples tell most.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.edge import (
    SHAPE_BEARING,
    SHAPE_COLUMNS,
    SHAPE_DEPTH,
    SHAPE_FIRST,
    SHAPE_KIND,
    Edge,
    propose_edge,
)
from autonomy.planner.leg.edge_kernel import propose
from autonomy.planner.leg.leg_kernel import LEG_COLUMNS
from autonomy.planner.leg.waterway import Waterway
from autonomy.planner.limits import Limits, legs_max, limits_of
from autonomy.planner.outcome import spending
from autonomy.planner.plan import PrimitiveKind

_DEPTHS = (1.0, 0.8, 0.6, 0.4, 0.2)
"""Parts of the domain's depth that a dive may reach; the deepest that the floor allows is taken."""
_TURNS = tuple(math.radians(turn) for turn in (0, 30, -30, 60, -60, 90, -90, 120, -120, 150, -150))
"""Changes of course, tried in this order where the water ends."""
_GLIDE = 0.125
_MIDDLE = 0.5


def transects(
    config: PlannerConfig,
    start_xy: tuple[float, float],
    budget: float,
    waterway: Waterway,
    edges_max: int,
) -> list[list[Edge]]:
    """Lay a line of dives in each of ``search.transects`` directions, evenly spread.

    Each dive glides down and up at the middle of the angles that can be flown, as deep as the
    water allows, and each line goes on until a budget is spent. It turns aside where the water
    ends.

    Args:
        config: Limits and budgets.
        start_xy: North and east of the robot at the surface, m.
        budget: Energy units of this round.
        waterway: Raster of the water.
        edges_max: Most dives of a line.

    Returns:
        The dives of each line, of which at least one can be flown.
    """
    count = config.search.transects
    if not count:
        return []
    limits = limits_of(config, budget)
    lines = [
        _line(config, limits, start_xy, budget, waterway, 2.0 * math.pi * number / count, edges_max)
        for number in range(count)
    ]
    return [line for line in lines if line]


def _line(
    config: PlannerConfig,
    limits: Limits,
    start_xy: tuple[float, float],
    budget: float,
    waterway: Waterway,
    heading_rad: float,
    edges_max: int,
) -> list[Edge]:
    line: list[Edge] = []
    here, spent = start_xy, spending(config, ())
    while len(line) < edges_max:
        left, begin_s = budget - spent.energy, spent.duration_s
        found = _next_dive(config, limits, here, left, waterway, heading_rad, begin_s)
        if found is None:
            break
        edge, heading_rad = found
        spent += spending(config, edge.legs)
        if spent.greatest_share(config, budget) > 1.0:
            break
        line.append(edge)
        here = (float(edge.points[-1, 1]), float(edge.points[-1, 2]))
    return line


def _next_dive(
    config: PlannerConfig,
    limits: Limits,
    here_xy: tuple[float, float],
    budget: float,
    waterway: Waterway,
    heading_rad: float,
    begin_s: float,
) -> tuple[Edge, float] | None:
    """Return the deepest dive with the least change of course, and its heading."""
    motion = config.primitives
    legs = np.empty((legs_max(config), LEG_COLUMNS))
    slope = math.tan(_MIDDLE * (motion.glide_angle_min_rad + motion.glide_angle_max_rad))
    for turn in _TURNS:
        heading = heading_rad + turn
        for part in _DEPTHS:
            depth = part * config.domain.depth_max_m
            length = 2.0 * depth / slope
            if depth < motion.depth_change_min_m or length > config.search.step_m:
                continue
            goal_xy = (
                here_xy[0] + length * math.cos(heading),
                here_xy[1] + length * math.sin(heading),
            )
            if not config.domain.contains(*goal_xy, 0.0):
                continue
            shape = _shape(config, part)
            if not propose(limits, waterway, here_xy, goal_xy, shape, legs, begin_s):
                continue
            edge = propose_edge(config, here_xy, goal_xy, budget, shape, waterway, begin_s)
            if edge is not None and all(leg.kind is PrimitiveKind.GLIDE for leg in edge.legs):
                return edge, heading
    return None


def _shape(config: PlannerConfig, depth_part: float) -> FloatArray:
    """Return the shape (``edge.random_shape``) of one glide towards the goal."""
    count = config.primitives.primitives_max
    shape = np.full(1 + SHAPE_COLUMNS * count, _MIDDLE)
    shape[0] = _MIDDLE / count
    shape[1 + SHAPE_BEARING :: SHAPE_COLUMNS] = 0.0
    shape[1 + SHAPE_KIND] = _GLIDE
    shape[1 + SHAPE_DEPTH] = depth_part
    shape[1 + SHAPE_FIRST] = _MIDDLE
    return shape
