"""The way back for a robot that drifted to where no plan may begin while it waited."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from autonomy.planner.config import PlannerConfig
from autonomy.planner.detour import shortest_way
from autonomy.planner.leg import primitive
from autonomy.planner.leg.edge import expected_points, legs_duration_s, legs_energy, refitted
from autonomy.planner.leg.waterway import Waterway, closed_areas, depth_at, waterway_of
from autonomy.planner.outcome import least_spending, sentence, spending
from autonomy.planner.plan import Candidate, Leg, PlanResult
from autonomy.site import NorthEast, Site

_INSET_SHARE = 0.05
"""The way ends this share of the domain's width inside, so that drift does not undo it at once."""
_GOALS_MAX = 4
_GOAL_SPACING_CELLS = 12
_LEAST_LEFT = 1e-3
_SAME_PLACE_M = 0.05


@dataclass(frozen=True, slots=True)
class Approach:
    """How a robot gets to where its plan may begin."""

    start_xy: NorthEast
    """Where the robot is."""
    legs: tuple[Leg, ...] = ()
    """Swims at the surface, one after the other; none where a plan may begin at once."""
    refusal: str = ""
    """Why there is no way, one sentence; "" if there is one."""

    @property
    def end_xy(self) -> NorthEast:
        """Where the plan begins."""
        return self.legs[-1].end_ned[:2] if self.legs else self.start_xy


def swim_to(config: PlannerConfig, robot_ne_m: NorthEast, first_ne_m: NorthEast) -> Leg | None:
    """Return the swim at the surface to where a plan begins; None where the robot is there.

    No plan has it among its legs: the robot swims there by itself before it begins.

    Raises:
        ValueError: If the current is too strong to swim against.
    """
    if math.dist(robot_ne_m, first_ne_m) < _SAME_PLACE_M:
        return None
    return primitive.swim(config, (*robot_ne_m, 0.0), (*first_ne_m, 0.0))


def way_in(config: PlannerConfig, start_xy: NorthEast, site: Site | None = None) -> Approach:
    """Return the swims at the surface to the nearest place well inside of where plans may be.

    They lead around keep-outs and headlands. They keep the margin, or where the robot lies within
    it, as much of it as there is. A robot beyond the shoreline swims straight in.

    Args:
        config: Domain, keep-outs, margins and current.
        start_xy: North and east of the robot at the surface, m, in the site's frame.
        site: Shoreline and floor; None for water without end.
    """
    if not all(map(math.isfinite, start_xy)):
        return Approach(start_xy, refusal="The robot's position is unknown.")
    closed = closed_areas(config, site)
    for area in closed:
        if area.contains(*start_xy):
            return Approach(
                start_xy,
                refusal=f'The robot is inside the keep-out "{area.name}"; bring it out of there, '
                "or change the keep-out.",
            )
    waterway = waterway_of(config, site)
    if config.domain.contains(*start_xy, 0.0) and depth_at(waterway, *start_xy) > 0.0:
        return Approach(start_xy)
    goals = _goals(config, waterway, start_xy)
    if not goals:
        return Approach(
            start_xy,
            refusal="Nowhere in the domain is the water deep enough, off shore, floor and "
            "keep-outs by their margins.",
        )
    for goal in goals:
        corners = shortest_way(start_xy, goal, closed, site, config.margin_m)
        if corners is not None:
            return _swims(config, start_xy, _cut(config, waterway, start_xy, corners))
    names = ", ".join(f'"{area.name}"' for area in closed)
    return Approach(
        start_xy,
        refusal="The robot cannot swim into the domain without crossing "
        + (f"a keep-out ({names}) or the shore." if names else "the shore."),
    )


def approach_energy(config: PlannerConfig, legs: Sequence[Leg]) -> float:
    """Return the energy units of the way back, none without one."""
    return legs_energy(config, legs)


def after_approach(config: PlannerConfig, legs: Sequence[Leg]) -> PlannerConfig:
    """Return the settings with what the way back leaves of the budget of time.

    Swims along the surface end with no surfacing, so they send nothing by satellite.
    """
    if not config.time_budget_s:
        return config
    left_s = config.time_budget_s - legs_duration_s(config, legs)
    return config.model_copy(update={"time_budget_s": max(left_s, _LEAST_LEFT)})


def shortfall(config: PlannerConfig, legs: Sequence[Leg], budget: float) -> str:
    """Return which budget does not last for the way back and one dive, "" if each does.

    It names the budget as it was asked for, which the search does not know: that has the rest.

    Args:
        config: Settings of the search, as they were asked for.
        legs: The way back; none where a plan may begin at once.
        budget: Energy units of the round, the way included.
    """
    if not legs:
        return ""
    way, least = spending(config, legs), least_spending(config)
    swim = "the swim back into the domain takes"
    if budget < way.energy + least.energy:
        return (
            f"a budget of {budget:.3g} energy units is too little: {swim} {way.energy:.3g}, and "
            f"the cheapest way from one surfacing to another {least.energy:.3g}"
        )
    if 0.0 < config.time_budget_s < way.duration_s + least.duration_s:
        return (
            f"a time budget of {config.time_budget_s:.3g} s is too little: {swim} "
            f"{way.duration_s:.3g} s, and the fastest way from one surfacing to another "
            f"{least.duration_s:.3g} s"
        )
    return ""


def preceded(
    result: PlanResult, legs: tuple[Leg, ...], config: PlannerConfig, budget: float
) -> PlanResult:
    """Return the result with the way back flown before every trajectory of it.

    Args:
        result: Of a search that begins where the way ends.
        legs: The way there.
        config: Settings of the search.
        budget: Energy units of the round, the way included.
    """
    if result.best is None or not legs:
        return result
    best = _preceded(result.best, legs, config)
    distance_m = sum(math.dist(leg.start_ned, leg.end_ned) for leg in legs)
    return replace(
        result,
        message=f"It begins with a swim of {distance_m:.2g} m back into the domain. "
        + sentence(config, budget, result, best),
        best=best,
        runners_up=tuple(_preceded(other, legs, config) for other in result.runners_up),
    )


def _preceded(candidate: Candidate, first: tuple[Leg, ...], config: PlannerConfig) -> Candidate:
    legs = refitted(config, (*first, *candidate.legs))
    points = expected_points(config, legs)
    return replace(
        candidate,
        legs=legs,
        points=points,
        energy=candidate.energy + approach_energy(config, first),
        duration_s=legs_duration_s(config, legs),
        worst_std_m=float(points[:, 4].max()),
    )


def _cut(
    config: PlannerConfig,
    waterway: Waterway,
    start_xy: NorthEast,
    corners: tuple[NorthEast, ...],
) -> tuple[NorthEast, ...]:
    """Return a way with a bend only as far as the first place where a dive may begin."""
    least = config.primitives.depth_change_min_m
    for number, (begin, end) in enumerate(itertools.pairwise((start_xy, *corners))):
        steps = math.ceil(math.dist(begin, end) / waterway.cell) if len(corners) > 1 else 0
        for part in np.linspace(0.0, 1.0, steps + 1)[1:].tolist():
            x = begin[0] + part * (end[0] - begin[0])
            y = begin[1] + part * (end[1] - begin[1])
            if config.domain.contains(x, y, 0.0) and depth_at(waterway, x, y) >= least:
                return (*corners[:number], (x, y))
    return corners


def _swims(config: PlannerConfig, start_xy: NorthEast, corners: Sequence[NorthEast]) -> Approach:
    legs: list[Leg] = []
    here = (*start_xy, 0.0)
    for corner in corners:
        there = (*corner, 0.0)
        if primitive.headway_m_s(config, here, there) == 0.0:
            return Approach(
                start_xy,
                refusal="The current is too strong to swim into the domain: "
                f"it leaves too little of {config.primitives.swim_speed_m_s:g} m/s.",
            )
        legs.append(primitive.swim(config, here, there))
        here = there
    return Approach(start_xy, tuple(legs))


def _goals(config: PlannerConfig, waterway: Waterway, start_xy: NorthEast) -> list[NorthEast]:
    """Return places well inside the domain where a dive may begin, the nearest first."""
    domain = config.domain
    inset = (
        _INSET_SHARE * (domain.x_max_m - domain.x_min_m),
        _INSET_SHARE * (domain.y_max_m - domain.y_min_m),
    )
    nearest = (
        min(max(start_xy[0], domain.x_min_m + inset[0]), domain.x_max_m - inset[0]),
        min(max(start_xy[1], domain.y_min_m + inset[1]), domain.y_max_m - inset[1]),
    )
    least = config.primitives.depth_change_min_m
    if depth_at(waterway, *nearest) >= least:
        return [nearest]
    i, j = np.nonzero(waterway.depth >= min(least, waterway.depth.max()))
    kept = waterway.depth[i, j] > 0.0
    places = np.stack(
        [waterway.x_min + (i + 0.5) * waterway.cell, waterway.y_min + (j + 0.5) * waterway.cell],
        axis=1,
    )[kept]
    inside = (
        (places[:, 0] >= domain.x_min_m + inset[0])
        & (places[:, 0] <= domain.x_max_m - inset[0])
        & (places[:, 1] >= domain.y_min_m + inset[1])
        & (places[:, 1] <= domain.y_max_m - inset[1])
    )
    places = places[inside] if inside.any() else places
    goals: list[NorthEast] = []
    for place in places[np.argsort(np.hypot(*(places - start_xy).T), kind="stable")].tolist():
        apart = _GOAL_SPACING_CELLS * waterway.cell
        if all(math.dist(place, goal) > apart for goal in goals):
            goals.append((place[0], place[1]))
        if len(goals) == _GOALS_MAX:
            break
    return goals
