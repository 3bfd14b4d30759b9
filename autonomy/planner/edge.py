"""Trajectories between two surfacings: the readable form of PlanEdges (thesis 5.4.2)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig
from autonomy.estimation.position import surface_covariance
from autonomy.planner import primitive
from autonomy.planner.config import PlannerConfig, PrimitiveConfig
from autonomy.planner.plan import Leg, PositionNed, PrimitiveKind

POINT_TIME, POINT_NORTH, POINT_EAST, POINT_DOWN, POINT_STD = range(5)
"""Columns of planned points."""
SHAPE_KIND, SHAPE_BEARING, SHAPE_DEPTH, SHAPE_FIRST, SHAPE_SECOND, SHAPE_SIDE = range(6)
SHAPE_COLUMNS = 6
"""Numbers of each primitive in a shape."""
_KINDS = (PrimitiveKind.GLIDE, PrimitiveKind.SPIRAL, PrimitiveKind.DIVE, PrimitiveKind.SWIM)
SAME_PLACE_M = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A trajectory from one surfacing to the next."""

    legs: tuple[Leg, ...]
    points: FloatArray
    """Planned samples, shape ``(m, 5)``: time since the start, north, east, down, position std."""
    energy: float
    """Energy units of the legs and of the surfacings before its dives."""


def random_shape(config: PlannerConfig, rng: np.random.Generator) -> FloatArray:
    """Draw what an edge's primitives are made from, wherever it begins and ends.

    Returns:
        First a number for how many primitives; then for each of ``primitives_max`` its kind, its
        bearing off the goal's (standard normal), and four for depth, size and side. All others
        are uniform in 0..1. Shape ``(1 + SHAPE_COLUMNS * primitives_max,)``.
    """
    count = config.primitives.primitives_max
    shape = rng.random(1 + SHAPE_COLUMNS * count)
    shape[1 + SHAPE_BEARING :: SHAPE_COLUMNS] = rng.standard_normal(count)
    return shape


def propose_edge(
    config: PlannerConfig,
    start_xy: tuple[float, float],
    goal_xy: tuple[float, float],
    budget: float,
    shape: FloatArray,
) -> Edge | None:
    """Build the trajectory of a shape between two points of the surface.

    Each primitive that would leave the domain is left out, and the goal reached by one or two
    closing primitives.

    Returns:
        The trajectory, or None if it breaks the budget or the limit on the position's uncertainty,
        or does not reach the goal.
    """
    legs = _shaped_legs(config, start_xy, goal_xy, shape)
    closing = _closing_legs(config, legs[-1].end_ned if legs else (*start_xy, 0.0), goal_xy)
    if closing is None:
        return None
    legs += closing
    energy = legs_energy(config, legs)
    if not legs or energy > budget:
        return None
    points = planned_points(config, tuple(legs))
    if points[:, POINT_STD].max() > config.max_uncertainty_m:
        return None
    return Edge(tuple(legs), points, energy)


def surfacings(legs: Sequence[Leg]) -> int:
    """Return how often the robot prepares a dive at the surface: before each leg that begins there.

    A swim along the surface is a dive in this sense too: the robot comes to rest before it.
    """
    return sum(leg.start_ned[2] <= 0.0 for leg in legs)


def legs_energy(config: PlannerConfig, legs: Sequence[Leg]) -> float:
    """Return the energy units of legs and of the surfacings before their dives."""
    return sum(leg.energy for leg in legs) + surfacings(legs) * config.surfacing_energy


def legs_duration_s(config: PlannerConfig, legs: Sequence[Leg]) -> float:
    """Return how long legs take together with the surfacings before their dives, s."""
    at_surface_s = surfacings(legs) * config.mission.turn_time_s
    return sum(leg.duration_s for leg in legs) + at_surface_s


def planned_points(config: PlannerConfig, legs: tuple[Leg, ...]) -> FloatArray:
    """Return the points of an edge, one each ``point_interval_s`` after its start, and its end.

    Returns:
        Shape ``(m, 5)``: time, north, east, down, position std; the first is one interval after
        the start, the last is the end, where the robot surfaces.
    """
    ends = np.cumsum([leg.duration_s for leg in legs])
    interval = config.primitives.point_interval_s
    count = max(math.ceil(ends[-1] / interval - 1e-9), 1)
    times = np.minimum(np.arange(1, count + 1) * interval, ends[-1])  # (m,)
    points = np.empty((count, 5))
    points[:, POINT_TIME] = times
    for row, time in zip(points, times, strict=True):
        i = min(int(np.searchsorted(ends, time)), len(legs) - 1)
        left = (ends[i] - time) / legs[i].duration_s
        row[POINT_NORTH:POINT_STD] = primitive.position_at(legs[i], 1.0 - left)
    points[:, POINT_STD] = position_std(
        config.position_filter, times, points[:, POINT_DOWN], interval
    )
    return points


def position_std(
    config: EstimatorConfig, times_s: FloatArray, depths_m: FloatArray, interval_s: float
) -> FloatArray:
    """Return the position's standard deviation at points that follow a stay at the surface.

    Args:
        config: Noise that the robot's position filter assumes.
        times_s: Time of each point since the start, ascending, shape ``(m,)``.
        depths_m: Depth of each, shape ``(m,)``.
        interval_s: Time between fixes before the start.

    Returns:
        Standard deviation along the worst horizontal direction, shape ``(m,)``, m.
    """
    axis = surface_covariance(config, interval_s)
    std = np.empty(len(times_s))
    before = 0.0
    for i, (time, depth) in enumerate(zip(times_s, depths_m, strict=True)):
        axis = axis.step(config, time - before, has_fix=depth <= config.surface_depth_m)
        std[i] = math.sqrt(axis.position)
        before = time
    return std


def _shaped_legs(
    config: PlannerConfig,
    start_xy: tuple[float, float],
    goal_xy: tuple[float, float],
    shape: FloatArray,
) -> list[Leg]:
    """Chain the primitives of a shape towards the goal."""
    legs: list[Leg] = []
    here: PositionNed = (*start_xy, 0.0)
    goal: PositionNed = (*goal_xy, 0.0)
    rows = shape[1:].reshape(-1, SHAPE_COLUMNS)
    for row in rows[: 1 + int(shape[0] * len(rows))]:
        kind = _KINDS[int(row[SHAPE_KIND] * len(_KINDS))]
        heading = primitive.bearing(here, goal)
        heading += config.primitives.bearing_noise_rad * row[SHAPE_BEARING]
        leg = (
            _shaped_swim(config, here, heading, row)
            if kind is PrimitiveKind.SWIM
            else _shaped_descent(config, kind, here, heading, row)
        )
        if leg is not None and primitive.is_inside(leg, config.domain):
            legs.append(leg)
            here = leg.end_ned
    return legs


def _shaped_swim(
    config: PlannerConfig, here: PositionNed, heading: float, row: FloatArray
) -> Leg | None:
    limits = config.primitives
    if here[2] > 0.0 and not limits.swims_under_water:
        return None
    length = _between(limits.swim_length_min_m, limits.swim_length_max_m, row[SHAPE_FIRST])
    return primitive.swim(config, here, _ahead(here, heading, length, here[2]))


def _shaped_descent(
    config: PlannerConfig, kind: PrimitiveKind, here: PositionNed, heading: float, row: FloatArray
) -> Leg | None:
    """Make a glide, spiral or dive, up or down."""
    limits = config.primitives
    depth = float(row[SHAPE_DEPTH]) * config.domain.depth_max_m
    if depth < limits.depth_change_min_m:
        depth = 0.0
    change = abs(depth - here[2])
    if change < limits.depth_change_min_m:
        return None
    if kind is PrimitiveKind.DIVE:
        return primitive.dive(config, here, depth)
    if kind is PrimitiveKind.GLIDE:
        angle = _between(limits.glide_angle_min_rad, limits.glide_angle_max_rad, row[SHAPE_FIRST])
        return primitive.glide(config, here, _ahead(here, heading, change / math.tan(angle), depth))
    radius = _between(limits.spiral_radius_min_m, limits.spiral_radius_max_m, row[SHAPE_FIRST])
    rise = _between(limits.spiral_rise_min_m_rad, limits.spiral_rise_max_m_rad, row[SHAPE_SECOND])
    turn = math.copysign(change / rise, row[SHAPE_SIDE] - 0.5)
    return primitive.spiral(config, here, heading, radius, turn, depth)


def _closing_legs(
    config: PlannerConfig, here: PositionNed, goal_xy: tuple[float, float]
) -> list[Leg] | None:
    """Return what brings the robot up and to the goal, or None where nothing does.

    An ascending glide if its angle can be flown, else a dive up and a swim along the surface.
    """
    limits: PrimitiveConfig = config.primitives
    goal: PositionNed = (*goal_xy, 0.0)
    distance = math.hypot(goal[0] - here[0], goal[1] - here[1])
    legs: list[Leg] = []
    if here[2] > 0.0:
        angle = math.atan2(here[2], distance)
        if limits.glide_angle_min_rad <= angle <= limits.glide_angle_max_rad:
            return [primitive.glide(config, here, goal)]
        legs.append(primitive.dive(config, here, 0.0))
        here = legs[-1].end_ned
    if distance < SAME_PLACE_M:
        return legs
    if not limits.swim_length_min_m <= distance <= limits.swim_length_max_m:
        return None
    return [*legs, primitive.swim(config, here, goal)]


def _ahead(here: PositionNed, heading: float, length: float, depth: float) -> PositionNed:
    return (here[0] + length * math.cos(heading), here[1] + length * math.sin(heading), depth)


def _between(low: float, high: float, part: float) -> float:
    return low + (high - low) * float(part)
