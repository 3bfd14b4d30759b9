"""Trajectories to begin a search with: what of earlier plans can still be flown from the start.

Edges that were flown already are left out, the rest is joined to where the robot is now, and what
exceeds a budget is cut off at the end. What cannot be flown any more is dropped.
"""

import math
from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.planner.check.check import violations
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.edge import (
    SAME_PLACE_M,
    SEARCHED_KINDS,
    SHAPE_BEARING,
    SHAPE_COLUMNS,
    SHAPE_DEPTH,
    SHAPE_FIRST,
    SHAPE_KIND,
    SHAPE_SECOND,
    SHAPE_SIDE,
    Edge,
    legs_duration_s,
    legs_energy,
    planned_points,
    propose_edge,
    random_shape,
    refitted,
)
from autonomy.planner.leg.primitive import bearing
from autonomy.planner.leg.waterway import Waterway
from autonomy.planner.outcome import spending
from autonomy.planner.plan import Leg, PrimitiveKind
from autonomy.site import Site

_JOINTS_MAX = 3
"""Surfacings of an earlier plan to which the robot is tried to be joined."""
_ATTEMPTS = 40
"""Random edges tried for one joint."""
_TINY = 1e-12


def rebased(
    config: PlannerConfig,
    start_xy: tuple[float, float],
    budget: float,
    legs: Sequence[Leg],
    *,
    rng: np.random.Generator,
    waterway: Waterway,
    site: Site | None,
) -> list[Edge]:
    """Return what can be flown of an earlier plan, from where the robot is now.

    Args:
        config: Limits and budgets.
        start_xy: North and east of the robot at the surface, m.
        budget: Energy units of this round.
        legs: The earlier plan.
        rng: Chooses the edge that joins the robot to a plan that begins elsewhere.
        waterway: Raster of the water.
        site: The water; None for water without end.

    Returns:
        Edges that begin at the start and keep every limit, none if nothing is left.
    """
    edges = _edges_of(config, legs)
    joined = _joined(config, start_xy, budget, edges, rng, waterway)
    while joined and not _can_be_flown(config, budget, joined, site):
        joined.pop()
    return joined


def shape_of(config: PlannerConfig, edge: Edge) -> FloatArray:
    """Return a shape (``edge.random_shape``) that gives an edge much like this one.

    The last leg is what closes the edge, so it is left out where there is another.
    """
    motion = config.primitives
    count = motion.primitives_max
    drawn = edge.legs[: max(len(edge.legs) - 1, 1)][:count]
    goal = (float(edge.points[-1, 1]), float(edge.points[-1, 2]), 0.0)
    shape = np.full(1 + SHAPE_COLUMNS * count, 0.5)
    shape[1 + SHAPE_BEARING :: SHAPE_COLUMNS] = 0.0
    shape[0] = (len(drawn) - 0.5) / count
    for row, leg in zip(shape[1:].reshape(-1, SHAPE_COLUMNS), drawn, strict=False):
        change = abs(leg.end_ned[2] - leg.start_ned[2])
        way = math.dist(leg.end_ned[:2], leg.start_ned[:2])
        row[SHAPE_KIND] = (SEARCHED_KINDS.index(leg.kind) + 0.5) / len(SEARCHED_KINDS)
        off = leg.heading_rad - bearing(leg.start_ned, goal)
        off = math.remainder(off, 2.0 * math.pi)
        if leg.kind is not PrimitiveKind.DIVE and motion.bearing_noise_rad > 0.0:
            row[SHAPE_BEARING] = off / motion.bearing_noise_rad
        row[SHAPE_DEPTH] = leg.end_ned[2] / config.domain.depth_max_m
        if leg.kind is PrimitiveKind.SWIM:
            row[SHAPE_FIRST] = _part(way, motion.swim_length_min_m, motion.swim_length_max_m)
        elif leg.kind is PrimitiveKind.GLIDE:
            low, high = motion.glide_angle_min_rad, motion.glide_angle_max_rad
            row[SHAPE_FIRST] = _part(math.atan2(change, way), low, high)
        elif leg.kind is PrimitiveKind.SPIRAL:
            low, high = motion.spiral_radius_min_m, motion.spiral_radius_max_m
            row[SHAPE_FIRST] = _part(leg.radius_m, low, high)
            rise = change / max(abs(leg.turn_rad), _TINY)
            low, high = motion.spiral_rise_min_m_rad, motion.spiral_rise_max_m_rad
            row[SHAPE_SECOND] = _part(rise, low, high)
            row[SHAPE_SIDE] = 0.75 if leg.turn_rad > 0.0 else 0.25
    return shape


def _part(value: float, low: float, high: float) -> float:
    """Return where a value lies between two others, 0..1."""
    return min(max((value - low) / max(high - low, _TINY), 0.0), 1.0)


def _edges_of(config: PlannerConfig, legs: Sequence[Leg]) -> list[Edge]:
    """Cut legs at every surfacing, as far as a search can make such and they are whole numbers."""
    edges: list[Edge] = []
    begin, begin_s = 0, 0.0
    for number, leg in enumerate(legs):
        if not _is_sound(leg):
            break
        if leg.end_ned[2] <= 0.0:
            edges.append(_edge(config, tuple(legs[begin : number + 1]), begin_s))
            begin_s += legs_duration_s(config, edges[-1].legs)
            begin = number + 1
    return edges


def _is_sound(leg: Leg) -> bool:
    numbers = (*leg.start_ned, *leg.end_ned, leg.heading_rad, leg.radius_m, leg.turn_rad)
    is_searched = leg.kind in SEARCHED_KINDS and all(math.isfinite(number) for number in numbers)
    return is_searched and 0.0 < leg.duration_s < math.inf


def _edge(config: PlannerConfig, legs: tuple[Leg, ...], begin_s: float) -> Edge:
    return Edge(legs, planned_points(config, legs, begin_s), legs_energy(config, legs))


def _joined(
    config: PlannerConfig,
    start_xy: tuple[float, float],
    budget: float,
    edges: list[Edge],
    rng: np.random.Generator,
    waterway: Waterway,
) -> list[Edge]:
    """Return the edges from the start on, with one that leads there if they begin elsewhere."""
    places = [edge.legs[0].start_ned[:2] for edge in edges]
    order = sorted(range(len(edges)), key=lambda i: (math.dist(places[i], start_xy), i))
    if order and math.dist(places[order[0]], start_xy) < SAME_PLACE_M:
        return edges[order[0] :]
    for number in order[:_JOINTS_MAX]:
        edge = edges[number]
        end = (float(edge.points[-1, 1]), float(edge.points[-1, 2]))
        if math.dist(start_xy, end) > config.search.step_m:
            continue
        for attempt in range(1 + _ATTEMPTS):
            shape = random_shape(config, rng) if attempt else shape_of(config, edge)
            first = propose_edge(config, start_xy, end, budget, shape, waterway)
            if first is not None:
                return [first, *edges[number + 1 :]]
    return []


def _can_be_flown(
    config: PlannerConfig, budget: float, edges: list[Edge], site: Site | None
) -> bool:
    legs = refitted(config, [leg for edge in edges for leg in edge.legs])
    if spending(config, legs).greatest_share(config, budget) > 1.0:
        return False
    allowed = config.model_copy(update={"round_budget": budget})
    return not violations(legs, allowed, _open_water(config) if site is None else site)


def _open_water(config: PlannerConfig) -> Site:
    """Return a site that limits a plan to its domain alone."""
    return Site(
        name="open water",
        kind="sea",
        water=config.domain,
        domain=config.domain,
        origin_latitude_deg=0.0,
        origin_longitude_deg=0.0,
        radio_under_water=False,
        variable="",
    )
