"""Trajectories between two surfacings: the readable form of PlanEdges (thesis 5.4.2)."""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.current.table import flow_at, is_uniform
from autonomy.estimation.known_current import SETTLING_S, KnownCurrent
from autonomy.estimation.position import ExpectedPosition, position_std
from autonomy.outline import Indices
from autonomy.planner.config import PlannerConfig, PrimitiveConfig
from autonomy.planner.leg import drift, primitive
from autonomy.planner.leg.waterway import Waterway, chords, holds_line, waterway_of
from autonomy.planner.plan import Leg, PositionNed, PrimitiveKind

POINT_TIME, POINT_NORTH, POINT_EAST, POINT_DOWN, POINT_STD = range(5)
"""Columns of planned points."""
SHAPE_KIND, SHAPE_BEARING, SHAPE_DEPTH, SHAPE_FIRST, SHAPE_SECOND, SHAPE_SIDE = range(6)
SHAPE_COLUMNS = 6
"""Numbers of each primitive in a shape."""
SEARCHED_KINDS = (
    PrimitiveKind.GLIDE,
    PrimitiveKind.SPIRAL,
    PrimitiveKind.DIVE,
    PrimitiveKind.SWIM,
)
"""What searches chain, by the number in a shape."""
SAME_PLACE_M = 1e-6
_KEEP_POINTS_MAX = 500
_KNOWN_DIVES_MAX, _KNOWN_POINTS_MAX = 4096, 256
AIMS = 3
"""How often a glide is aimed anew where the current is not the same everywhere."""


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
    begin_s: float = 0.0,
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
        begin_s: When it begins, s since its plan.

    Returns:
        The trajectory, or None if it breaks the budget or the limit on the position's uncertainty,
        or does not reach the goal.
    """
    water = waterway_of(config, None) if waterway is None else waterway
    begin = drift.fresh(config, begin_s)
    legs, here, begin = _shaped_legs(config, water, start_xy, goal_xy, shape, begin)
    closing = _closing_legs(config, water, here, begin, goal_xy)
    if closing is None:
        return None
    legs += closing
    energy = legs_energy(config, legs)
    if not legs or energy > budget:
        return None
    points = planned_points(config, tuple(legs), begin_s)
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


def planned_points(
    config: PlannerConfig, legs: tuple[Leg, ...], begin_s: float = 0.0
) -> FloatArray:
    """Return the points of legs, one each ``point_interval_s`` after a surfacing, and its end.

    They are where the robot really is, which in a current is not where it believes to be, and as
    uncertain as on the plan's first dive: a search does not know what came before. Of a stay at the
    surface, on which nothing changes, there are at most 500. Each dive, which ends with the next
    surfacing, counts its intervals anew and begins with a position that is as certain as it becomes
    at the surface. The first surfacing begins ``begin_s`` after the plan, by which the current is
    looked up.

    Returns:
        Shape ``(m, 5)``: time, north, east, down, position std; the first is one interval after
        the start, the last is the end. Times leave out the surfacings between dives.
    """
    points: list[FloatArray] = []
    courses = drift.courses(config, legs, begin_s)
    certain = ExpectedPosition(config.position_filter, config.primitives.point_interval_s)
    begin, passed_s = 0, 0.0
    for number, leg in enumerate(legs):
        if leg.end_ned[2] <= 0.0 or number == len(legs) - 1:
            mine = slice(begin, number + 1)
            dive = _dive_points(config, legs[mine], courses[mine], certain)
            begin, end_s = number + 1, passed_s + dive[-1, POINT_TIME]
            dive[:, POINT_TIME] += passed_s
            passed_s = end_s
            points.append(dive)
    return np.concatenate(points)


def expected_points(
    config: PlannerConfig, legs: tuple[Leg, ...], begin_s: float = 0.0
) -> FloatArray:
    """Return the points of a whole plan, with what its robot will say of its position there.

    They are those of ``planned_points``, which take every dive for the first: what the dives and
    stays before tell of the current makes later ones more certain (``doubts``).
    """
    points = planned_points(config, legs, begin_s)
    points[:, POINT_STD] = np.concatenate([std_m for _, std_m in doubts(config, dives_of(legs))])
    return points


def dives_of(legs: Sequence[Leg]) -> Iterator[Sequence[Leg]]:
    """Return the legs of each dive, from one surfacing to the next."""
    begin = 0
    for number, leg in enumerate(legs, start=1):
        if leg.end_ned[2] <= 0.0 or number == len(legs):
            yield legs[begin:number]
            begin = number


def doubts(
    config: PlannerConfig, dives: Iterable[Sequence[Leg]]
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Return time since its begin, s, and position std, m, at each point of each dive of a plan.

    Before the first dive the current is known as ``config.position_filter`` says; each dive and
    each stay at the surface tells of it (``KnownCurrent``). Only whether the plan counts on a
    current matters of that.

    Args:
        config: What the plan is made with.
        dives: The legs of each dive, from the plan's first on.
    """
    position, current = config.position_filter, KnownCurrent(config.position_filter)
    current.stay(SETTLING_S)
    if drift.has_current(config):
        current.hear_plan()
    for dive, (times_s, walked, blind_s) in _walks(config, dives):
        if dive[0].start_ned[2] <= 0.0:
            current.stay(config.mission.turn_time_s)
        yield times_s, position_std(position, current.std_m_s, walked, blind_s)
        last = int(blind_s.argmax())
        if blind_s[last] == 0.0:
            current.stay(float(times_s[-1]))
        else:
            up_s = times_s[min(last + 1, len(times_s) - 1)]
            current.dive(float(blind_s[last] + up_s - times_s[last]))


def first_doubt_m(config: PlannerConfig, dive: Sequence[Leg]) -> float:
    """Return the greatest position std of a dive if it is a plan's first, m."""
    position = config.position_filter
    ((_, (_, walked, blind_s)),) = _walks(config, [dive])
    return float(position_std(position, position.steady_current_m_s, walked, blind_s).max())


def _walks(
    config: PlannerConfig, dives: Iterable[Sequence[Leg]]
) -> Iterator[tuple[Sequence[Leg], tuple[FloatArray, FloatArray, FloatArray]]]:
    """Return each dive with the times of its points and ``ExpectedPosition.walk`` there."""
    interval_s = config.primitives.point_interval_s
    known = _known_walks(config.position_filter.model_dump_json(), interval_s)
    certain: ExpectedPosition | None = None
    for dive in dives:
        key = (
            dive[0].kind is PrimitiveKind.KEEP,
            *[(leg.duration_s, leg.start_ned[2], leg.end_ned[2]) for leg in dive],
        )
        found = known.get(key)
        if found is None:
            certain = certain or ExpectedPosition(config.position_filter, interval_s)
            times_s, legs, left = _point_times(config, dive)
            begins, ends = np.array([(leg.start_ned[2], leg.end_ned[2]) for leg in dive])[legs].T
            found = times_s, *certain.walk(times_s, begins + (1.0 - left) * (ends - begins))
            if len(known) >= _KNOWN_DIVES_MAX:
                known.clear()
            if len(times_s) <= _KNOWN_POINTS_MAX:
                known[key] = found
        yield dive, found


@lru_cache(maxsize=8)
def _known_walks(
    position_filter: str, interval_s: float
) -> dict[tuple[object, ...], tuple[FloatArray, FloatArray, FloatArray]]:
    """Return what was reckoned of dives before, by their durations and depths.

    A mission that somebody draws is checked with every change, which leaves most dives alike.
    """
    del position_filter, interval_s
    return {}


def _point_times(
    config: PlannerConfig, dive: Sequence[Leg]
) -> tuple[FloatArray, Indices, FloatArray]:
    """Return when each point of a dive is, on which leg, and which part of that is left then."""
    durations = np.array([leg.duration_s for leg in dive])
    ends = np.cumsum(durations)
    interval = config.primitives.point_interval_s
    if dive[0].kind is PrimitiveKind.KEEP:
        interval = max(interval, dive[0].duration_s / _KEEP_POINTS_MAX)
    count = max(math.ceil(ends[-1] / interval - 1e-9), 1)
    times = np.minimum(np.arange(1, count + 1) * interval, ends[-1])  # (m,)
    legs = np.minimum(np.searchsorted(ends, times), len(dive) - 1)
    return times, legs, (ends[legs] - times) / durations[legs]


def _dive_points(
    config: PlannerConfig,
    legs: tuple[Leg, ...],
    courses: tuple[drift.Course, ...],
    certain: ExpectedPosition,
) -> FloatArray:
    """Return the points of the legs from one surfacing to the next, shape ``(m, 5)``."""
    times, numbers, left = _point_times(config, legs)
    points = np.empty((len(times), 5))
    points[:, POINT_TIME] = times
    places = (
        drift.position_at(legs[number], courses[number], part)
        for number, part in zip(numbers.tolist(), (1.0 - left).tolist(), strict=True)
    )
    points[:, POINT_NORTH:POINT_STD] = list(places)
    points[:, POINT_STD] = certain.std(times, points[:, POINT_DOWN])
    return points


def _shaped_legs(
    config: PlannerConfig,
    water: Waterway,
    start_xy: tuple[float, float],
    goal_xy: tuple[float, float],
    shape: FloatArray,
    begin: drift.Carried,
) -> tuple[list[Leg], PositionNed, drift.Carried]:
    """Chain the primitives of a shape towards the goal.

    Returns:
        Them, where the robot believes to be then, and how far it was carried from there.
    """
    legs: list[Leg] = []
    here: PositionNed = (*start_xy, 0.0)
    rows = shape[1:].reshape(-1, SHAPE_COLUMNS)
    for row in rows[: 1 + int(shape[0] * len(rows))]:
        kind = SEARCHED_KINDS[int(row[SHAPE_KIND] * len(SEARCHED_KINDS))]
        heading = _heading_to(config, here, begin, goal_xy)
        heading += config.primitives.bearing_noise_rad * row[SHAPE_BEARING]
        leg = (
            _shaped_swim(config, here, heading, row, begin.time_s)
            if kind is PrimitiveKind.SWIM
            else _shaped_descent(config, kind, here, heading, row)
        )
        if leg is None:
            continue
        course = drift.course_of(config, leg, begin)
        if _stays(config, water, leg, course):
            legs.append(leg)
            here, begin = drift.after(config, leg, course)
    return legs, here, begin


def _heading_to(
    config: PlannerConfig, here: PositionNed, begin: drift.Carried, goal_xy: tuple[float, float]
) -> float:
    """Return the heading of a glide that leads to the goal, over ground."""
    motion = config.primitives
    there = (here[0] + begin.north_m, here[1] + begin.east_m, here[2])
    north, east = flow_at(config.current.table, *there, begin.time_s)
    middle = 0.5 * (motion.glide_angle_min_rad + motion.glide_angle_max_rad)
    way_s = math.dist(there[:2], goal_xy) * math.tan(middle) / motion.glide_speed_m_s
    return primitive.bearing(there, (goal_xy[0] - north * way_s, goal_xy[1] - east * way_s, 0.0))


def _stays(config: PlannerConfig, water: Waterway, leg: Leg, course: drift.Course) -> bool:
    """Tell whether a leg really stays in the domain and the water, and in belief near them."""
    knows = drift.knows_place(leg)
    if not knows and drift.has_current(config):
        # a spiral's course begins where it does, so its beginning must be known on board
        begins_bent = leg.kind is PrimitiveKind.SPIRAL and leg.start_ned[2] <= 0.0
        if begins_bent or not _is_near(water, leg):
            return False
    return _is_really_inside(config, leg, course) and _is_in_water(water, leg, course)


def _is_near(water: Waterway, leg: Leg) -> bool:
    """Tell whether a robot would believe to be near the domain all along a leg."""
    low, high = primitive.bounds(leg)
    return (
        water.x_room[0] <= low[0] <= high[0] <= water.x_room[1]
        and water.y_room[0] <= low[1] <= high[1] <= water.y_room[1]
    )


def _is_really_inside(config: PlannerConfig, leg: Leg, course: drift.Course) -> bool:
    """Tell whether no point of the true way leaves the domain; of a spiral, of what holds it."""
    if drift.knows_place(leg):
        return primitive.is_inside(leg, config.domain)
    if leg.kind is not PrimitiveKind.SPIRAL:
        ends = (drift.position_at(leg, course, part) for part in (0.0, 1.0))
        return all(config.domain.contains(*end, margin_m=1e-9) for end in ends)
    begin, (north, east) = course.begin, course.current_ne_m_s
    ways = [(begin.north_m + north * t, begin.east_m + east * t) for t in (0.0, leg.duration_s)]
    return all(
        config.domain.contains(bound[0] + way[0], bound[1] + way[1], bound[2], margin_m=1e-9)
        for bound in primitive.bounds(leg)
        for way in ways
    )


def _is_in_water(water: Waterway, leg: Leg, course: drift.Course) -> bool:
    """Tell whether the true way is above the floor and off shores and keep-outs."""
    if water.is_everywhere:
        return True
    count = 1
    if leg.kind is PrimitiveKind.SPIRAL:
        count = chords(water, leg.radius_m, leg.turn_rad)
    ends = [drift.position_at(leg, course, i / count) for i in range(count + 1)]
    return all(holds_line(water, a, b) for a, b in itertools.pairwise(ends))


def _shaped_swim(
    config: PlannerConfig, here: PositionNed, heading: float, row: FloatArray, begin_s: float
) -> Leg | None:
    limits = config.primitives
    if here[2] > 0.0 and not limits.swims_under_water:
        return None
    length = _between(limits.swim_length_min_m, limits.swim_length_max_m, row[SHAPE_FIRST])
    end = _ahead(here, heading, length, here[2])
    if primitive.headway_m_s(config, here, end, begin_s) == 0.0:
        return None
    return primitive.swim(config, here, end, begin_s)


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
    begin: drift.Carried,
    goal_xy: tuple[float, float],
) -> list[Leg] | None:
    """Return what brings the robot up and to the goal, or None where nothing does.

    An ascending glide if its angle can be flown, else a dive up and a swim along the surface. The
    duration of a glide is that of its change of depth, so how far it must aim off is known.
    """
    limits: PrimitiveConfig = config.primitives
    legs: list[Leg] = []
    if here[2] > 0.0:
        glide, course = _closing_glide(config, here, begin, goal_xy)
        angle = math.atan2(here[2], math.dist(here[:2], glide.end_ned[:2]))
        if limits.glide_angle_min_rad <= angle <= limits.glide_angle_max_rad:
            return [glide] if _stays(config, water, glide, course) else None
        legs.append(primitive.dive(config, here, 0.0))
        course = drift.course_of(config, legs[0], begin)
        if not _stays(config, water, legs[0], course):
            return None
        here, begin = drift.after(config, legs[0], course)
    goal: PositionNed = (*goal_xy, 0.0)
    distance = math.dist(here, goal)
    if distance < SAME_PLACE_M:
        return legs
    if not limits.swim_length_min_m <= distance <= limits.swim_length_max_m:
        return None
    if primitive.headway_m_s(config, here, goal, begin.time_s) == 0.0:
        return None
    legs.append(primitive.swim(config, here, goal, begin.time_s))
    return legs if _stays(config, water, legs[-1], drift.Course(begin, (0.0, 0.0))) else None


def _closing_glide(
    config: PlannerConfig, here: PositionNed, begin: drift.Carried, goal_xy: tuple[float, float]
) -> tuple[Leg, drift.Course]:
    """Return the glide that really leads up to the goal, and its course."""
    table, duration_s = config.current.table, here[2] / config.primitives.glide_speed_m_s
    there = (here[0] + begin.north_m, here[1] + begin.east_m, here[2])

    def aimed(current: tuple[float, float]) -> tuple[Leg, drift.Course]:
        aim = (
            goal_xy[0] - begin.north_m - current[0] * duration_s,
            goal_xy[1] - begin.east_m - current[1] * duration_s,
            0.0,
        )
        glide = primitive.glide(config, here, aim)
        return glide, drift.course_of(config, glide, begin)

    glide, course = aimed(flow_at(table, *there, begin.time_s))
    for _ in range(0 if is_uniform(table) else AIMS - 1):
        glide, course = aimed(course.current_ne_m_s)
    return glide, course


def refitted(config: PlannerConfig, legs: Sequence[Leg]) -> tuple[Leg, ...]:
    """Return legs that lead in their plan's own time to where each dive is to come up.

    A search makes each dive for about the time at which it will begin. Where the current changes
    with time, the last glide of a dive is aimed anew once that is known.
    """
    if is_uniform(config.current.table):
        return tuple(legs)
    found: list[Leg] = []
    begin, came_up = drift.fresh(config, 0.0), legs[0].start_ned
    for leg, following in itertools.zip_longest(legs, legs[1:]):
        flown = leg
        if leg.kind is PrimitiveKind.GLIDE and leg.end_ned[2] <= 0.0 and following is not None:
            flown, _ = _closing_glide(config, leg.start_ned, begin, following.start_ned[:2])
        elif is_swim(leg) and math.dist(came_up, leg.end_ned) > SAME_PLACE_M:
            flown = primitive.swim(config, came_up, leg.end_ned, begin.time_s)
        course = drift.course_of(config, flown, begin)
        came_up = drift.position_at(flown, course, 1.0)
        found.append(flown)
        begin = drift.later(config, flown, course)
    return tuple(found)


def is_swim(leg: Leg) -> bool:
    """Tell whether a leg swims along the surface."""
    return leg.kind is PrimitiveKind.SWIM and drift.knows_place(leg)


def _ahead(here: PositionNed, heading: float, length: float, depth: float) -> PositionNed:
    return (here[0] + length * math.cos(heading), here[1] + length * math.sin(heading), depth)


def _between(low: float, high: float, part: float) -> float:
    return low + (high - low) * float(part)
