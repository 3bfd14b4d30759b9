"""Trajectories between two surfacings: the readable form of PlanEdges (thesis 5.4.2)."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.position import expected_position_std
from autonomy.planner.config import PlannerConfig, PrimitiveConfig
from autonomy.planner.leg import drift, primitive
from autonomy.planner.leg.waterway import Waterway, chords, holds_line, waterway_of
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
    waterway: Waterway | None = None,
) -> Edge | None:
    """Build the trajectory of a shape between two points of the surface.

    Each primitive that would leave the domain or the water is left out, and the goal reached by
    one or two closing primitives. In a current the legs aim off, so that the robot really gets
    there; every limit is judged on where it really is.

    Args:
        config: What edges are made from.
        start_xy: North and east of the surfacing that the edge leaves.
        goal_xy: North and east of the surfacing that it must reach.
        budget: Most energy units.
        shape: What the primitives are made from (``random_shape``).
        waterway: Shore, floor and keep-outs; None for the settings' keep-outs alone.

    Returns:
        The trajectory, or None if it breaks the budget or the limit on the position's uncertainty,
        or does not reach the goal.
    """
    water = waterway_of(config, None) if waterway is None else waterway
    legs, here, under_s = _shaped_legs(config, water, start_xy, goal_xy, shape)
    closing = _closing_legs(config, water, here, under_s, goal_xy)
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
    """Return how often the robot comes up: dives that end at the surface.

    At each it says by satellite what it has to say; a swim along the surface ends with none.
    """
    return sum(leg.end_ned[2] <= 0.0 < leg.start_ned[2] for leg in legs)


def departures(legs: Sequence[Leg]) -> int:
    """Return how often the robot prepares to leave at the surface: before each leg from there.

    That takes its time and energy before a swim too: the robot comes to rest first.
    """
    return sum(leg.start_ned[2] <= 0.0 for leg in legs)


def legs_energy(config: PlannerConfig, legs: Sequence[Leg]) -> float:
    """Return the energy units of legs and of what prepares them at the surface."""
    return sum(leg.energy for leg in legs) + departures(legs) * config.surfacing_energy


def legs_duration_s(config: PlannerConfig, legs: Sequence[Leg]) -> float:
    """Return how long legs take together with what prepares them at the surface, s."""
    at_surface_s = departures(legs) * config.mission.turn_time_s
    return sum(leg.duration_s for leg in legs) + at_surface_s


def planned_points(config: PlannerConfig, legs: tuple[Leg, ...]) -> FloatArray:
    """Return the points of legs, one each ``point_interval_s`` after a surfacing, and its end.

    They are where the robot really is, which in a current is not where it believes to be. Each
    dive, which ends with the next surfacing, counts its intervals anew and begins with a position
    that is as certain as it becomes at the surface.

    Returns:
        Shape ``(m, 5)``: time, north, east, down, position std; the first is one interval after
        the start, the last is the end. Times leave out the surfacings between dives.
    """
    points: list[FloatArray] = []
    begin, begin_s = 0, 0.0
    for number, leg in enumerate(legs):
        if leg.end_ned[2] <= 0.0 or number == len(legs) - 1:
            dive = _dive_points(config, legs[begin : number + 1])
            begin, end_s = number + 1, begin_s + dive[-1, POINT_TIME]
            dive[:, POINT_TIME] += begin_s
            begin_s = end_s
            points.append(dive)
    return np.concatenate(points)


def _dive_points(config: PlannerConfig, legs: tuple[Leg, ...]) -> FloatArray:
    """Return the points of the legs from one surfacing to the next, shape ``(m, 5)``."""
    ends = np.cumsum([leg.duration_s for leg in legs])
    interval = config.primitives.point_interval_s
    count = max(math.ceil(ends[-1] / interval - 1e-9), 1)
    times = np.minimum(np.arange(1, count + 1) * interval, ends[-1])  # (m,)
    points = np.empty((count, 5))
    points[:, POINT_TIME] = times
    under_s = drift.blind_s(legs)
    for row, time in zip(points, times, strict=True):
        i = min(int(np.searchsorted(ends, time)), len(legs) - 1)
        left = (ends[i] - time) / legs[i].duration_s
        row[POINT_NORTH:POINT_STD] = drift.position_at(config, legs[i], under_s[i], 1.0 - left)
    points[:, POINT_STD] = expected_position_std(
        config.position_filter, times, points[:, POINT_DOWN], interval
    )
    return points


def _shaped_legs(
    config: PlannerConfig,
    water: Waterway,
    start_xy: tuple[float, float],
    goal_xy: tuple[float, float],
    shape: FloatArray,
) -> tuple[list[Leg], PositionNed, float]:
    """Chain the primitives of a shape towards the goal.

    Returns:
        Them, where the robot believes to be then, and for how long it has not seen its position.
    """
    legs: list[Leg] = []
    here: PositionNed = (*start_xy, 0.0)
    under_s = 0.0
    rows = shape[1:].reshape(-1, SHAPE_COLUMNS)
    for row in rows[: 1 + int(shape[0] * len(rows))]:
        kind = _KINDS[int(row[SHAPE_KIND] * len(_KINDS))]
        heading = _heading_to(config, drift.carried(config, here, under_s), goal_xy)
        heading += config.primitives.bearing_noise_rad * row[SHAPE_BEARING]
        leg = (
            _shaped_swim(config, here, heading, row)
            if kind is PrimitiveKind.SWIM
            else _shaped_descent(config, kind, here, heading, row)
        )
        if leg is not None and _stays(config, water, leg, under_s):
            legs.append(leg)
            here, under_s = _after(config, leg, under_s)
    return legs, here, under_s


def _heading_to(config: PlannerConfig, there: PositionNed, goal_xy: tuple[float, float]) -> float:
    """Return the heading of a glide that leads from a place to the goal, over ground."""
    motion, current = config.primitives, config.current
    middle = 0.5 * (motion.glide_angle_min_rad + motion.glide_angle_max_rad)
    way_s = math.dist(there[:2], goal_xy) * math.tan(middle) / motion.glide_speed_m_s
    aim = (goal_xy[0] - current.north_m_s * way_s, goal_xy[1] - current.east_m_s * way_s, 0.0)
    return primitive.bearing(there, aim)


def _after(config: PlannerConfig, leg: Leg, under_s: float) -> tuple[PositionNed, float]:
    """Return where the robot believes to be after a leg, and for how long it has not seen."""
    under_s_then = drift.later(leg, under_s)
    if leg.end_ned[2] <= 0.0:
        return drift.position_at(config, leg, under_s, 1.0), under_s_then
    return leg.end_ned, under_s_then


def _stays(config: PlannerConfig, water: Waterway, leg: Leg, under_s: float) -> bool:
    """Tell whether a leg really stays in the domain and the water, and in belief near them."""
    knows = drift.knows_place(leg)
    if not knows and drift.has_current(config):
        # a spiral's course begins where it does, so its beginning must be known on board
        begins_bent = leg.kind is PrimitiveKind.SPIRAL and leg.start_ned[2] <= 0.0
        if begins_bent or not _is_near(water, leg):
            return False
    return _is_really_inside(config, leg, under_s) and _is_in_water(config, water, leg, under_s)


def _is_near(water: Waterway, leg: Leg) -> bool:
    """Tell whether a robot would believe to be near the domain all along a leg."""
    low, high = primitive.bounds(leg)
    return (
        water.x_room[0] <= low[0] <= high[0] <= water.x_room[1]
        and water.y_room[0] <= low[1] <= high[1] <= water.y_room[1]
    )


def _is_really_inside(config: PlannerConfig, leg: Leg, under_s: float) -> bool:
    """Tell whether no point of the true way leaves the domain; of a spiral, of what holds it."""
    if drift.knows_place(leg):
        return primitive.is_inside(leg, config.domain)
    low, high = primitive.bounds(leg)
    ways = [drift.carried(config, (0.0, 0.0, 0.0), under_s + t) for t in (0.0, leg.duration_s)]
    if leg.kind is not PrimitiveKind.SPIRAL:
        ends = (drift.position_at(config, leg, under_s, part) for part in (0.0, 1.0))
        return all(config.domain.contains(*end, margin_m=1e-9) for end in ends)
    return all(
        config.domain.contains(bound[0] + way[0], bound[1] + way[1], bound[2], margin_m=1e-9)
        for bound in (low, high)
        for way in ways
    )


def _is_in_water(config: PlannerConfig, water: Waterway, leg: Leg, under_s: float) -> bool:
    """Tell whether the true way is above the floor and off shores and keep-outs."""
    if water.is_everywhere:
        return True
    count = 1
    if leg.kind is PrimitiveKind.SPIRAL:
        count = chords(water, leg.radius_m, leg.turn_rad)
    ends = [drift.position_at(config, leg, under_s, i / count) for i in range(count + 1)]
    return all(holds_line(water, a, b) for a, b in itertools.pairwise(ends))


def _shaped_swim(
    config: PlannerConfig, here: PositionNed, heading: float, row: FloatArray
) -> Leg | None:
    limits = config.primitives
    if here[2] > 0.0 and not limits.swims_under_water:
        return None
    length = _between(limits.swim_length_min_m, limits.swim_length_max_m, row[SHAPE_FIRST])
    end = _ahead(here, heading, length, here[2])
    if primitive.headway_m_s(config, here, end) == 0.0:
        return None
    return primitive.swim(config, here, end)


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
    config: PlannerConfig,
    water: Waterway,
    here: PositionNed,
    under_s: float,
    goal_xy: tuple[float, float],
) -> list[Leg] | None:
    """Return what brings the robot up and to the goal, or None where nothing does.

    An ascending glide if its angle can be flown, else a dive up and a swim along the surface. The
    duration of a glide is that of its change of depth, so how far it must aim off is known.
    """
    limits: PrimitiveConfig = config.primitives
    legs: list[Leg] = []
    if here[2] > 0.0:
        drifted_s = under_s + here[2] / limits.glide_speed_m_s
        aim = (
            goal_xy[0] - config.current.north_m_s * drifted_s,
            goal_xy[1] - config.current.east_m_s * drifted_s,
            0.0,
        )
        angle = math.atan2(here[2], math.dist(here[:2], aim[:2]))
        if limits.glide_angle_min_rad <= angle <= limits.glide_angle_max_rad:
            glide = primitive.glide(config, here, aim)
            return [glide] if _stays(config, water, glide, under_s) else None
        legs.append(primitive.dive(config, here, 0.0))
        if not _stays(config, water, legs[0], under_s):
            return None
        here, _ = _after(config, legs[0], under_s)
    goal: PositionNed = (*goal_xy, 0.0)
    distance = math.dist(here, goal)
    if distance < SAME_PLACE_M:
        return legs
    if not limits.swim_length_min_m <= distance <= limits.swim_length_max_m:
        return None
    if primitive.headway_m_s(config, here, goal) == 0.0:
        return None
    legs.append(primitive.swim(config, here, goal))
    return legs if _stays(config, water, legs[-1], 0.0) else None


def _ahead(here: PositionNed, heading: float, length: float, depth: float) -> PositionNed:
    return (here[0] + length * math.cos(heading), here[1] + length * math.sin(heading), depth)


def _between(low: float, high: float, part: float) -> float:
    return low + (high - low) * float(part)
