"""The expected track of a plan: what its draft promises, and what a flight is held against.

It is the mean of the flights of the plan's dry run. A plan that was not flown ahead often enough
promises its own legs. The robot gets the legs in either case.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.outline import Outline
from autonomy.planner.check.clearance import nearest_m
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.edge import POINT_DOWN, POINT_STD, POINT_TIME
from autonomy.planner.leg.waterway import closed_areas
from autonomy.planner.plan import Leg, PrimitiveKind
from autonomy.site import Site
from robot_link.messages import RobotMode
from server.plan.view import NearestView, ViolationView

OUT_OF_BOUNDS = ("domain", "keep_outs")
"""Fields of the limits that keep a robot in safe water; a plan expected beyond them is held."""
_BORDER_M = 0.005
"""So far beyond a limit is rounding."""
_SHARE = 1e-3
"""Part of a budget that is rounding."""


def expected_of(document: Mapping[str, Any]) -> FloatArray | None:
    """Return the expected track of a plan's document, ``None`` if only its legs are promised.

    Returns:
        Shape ``(n, 5)``: time of the plan s, north, east, down m, the position std m that the
        robot states; the same number of rows for each leg, in their order.
    """
    rows = (document.get("rehearsal") or {}).get("expected") or ()
    return np.array(rows, dtype=np.float64) if rows else None


def expected_ends_s(document: Mapping[str, Any]) -> tuple[float, ...]:
    """Return when each leg is expected to end, s since the start; empty where nobody knows."""
    times_s = (document.get("rehearsal") or {}).get("expected_times_s") or ()
    return tuple(end_s for _, end_s in times_s)


def is_on_leg(mode: RobotMode | None, leg: Leg) -> bool:
    """Tell whether a robot that does this flies its leg, and does not prepare it."""
    if mode is RobotMode.SWIMMING:
        return leg.kind in {PrimitiveKind.SWIM, PrimitiveKind.KEEP}
    if mode is RobotMode.SURFACED:
        return leg.kind is PrimitiveKind.KEEP
    return mode in {RobotMode.GLIDING, RobotMode.SPIRALLING, RobotMode.DIVING}


def off_track_m(
    expected: FloatArray | None, legs: Sequence[Leg], leg: int, position_ne_m: tuple[float, float]
) -> float:
    """Return how far from the track of a leg a robot is, m, horizontally.

    Args:
        expected: As ``expected_of`` returns it.
        legs: The plan's, whose straight line counts where no track is expected.
        leg: Which one the robot flies.
        position_ne_m: Where it is.
    """
    if expected is None:
        way = np.array([legs[leg].start_ned[:2], legs[leg].end_ned[:2]])
    else:
        way = expected.reshape(len(legs), -1, expected.shape[1])[leg, :, 1:3]
    along = np.diff(way, axis=0)
    offset = np.array(position_ne_m) - way[:-1]
    length2 = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip((offset * along).sum(axis=1) / length2, 0.0, 1.0)
    return float(np.hypot(*(offset - share[:, None] * along).T).min())


def judged(
    expected: FloatArray, duration_s: float, config: PlannerConfig, site: Site
) -> dict[str, Any]:
    """Return the part of a dry run's document that holds its expected track against the limits.

    Args:
        expected: The track.
        duration_s: How long it takes, surfacings included.
        config: Limits that it was planned with.
        site: The water with its shoreline and floor.
    """
    nearest = [
        _nearest(name, area, expected, margin_m=config.margin_m, side=side)
        for name, area, side in _borders(config, site)
    ]
    broken = [*_too_near(nearest), *_beyond(expected, site), *_over(expected, duration_s, config)]
    return {"nearest": [asdict(one) for one in nearest], "broken": [asdict(one) for one in broken]}


def _borders(config: PlannerConfig, site: Site) -> list[tuple[str, Outline, float]]:
    """Return what must be kept away from; 1 for what to stay out of, -1 for what to stay in."""
    borders = [(area.name, area.outline, 1.0) for area in closed_areas(config, site)]
    if site.shore is not None:
        name = "Shore" if site.shoreline is None else site.shoreline.name
        borders.append((name, site.shore, -1.0))
    return borders


def _nearest(
    name: str, area: Outline, expected: FloatArray, *, margin_m: float, side: float
) -> NearestView:
    """Return how near a track comes to the outline of an area; not above 0 if it crosses that."""
    distance = nearest_m(area, expected[:, 1:3], side)
    return NearestView(name, round(distance, 3), margin_m, is_shore=side < 0.0)


def _too_near(nearest: Sequence[NearestView]) -> list[ViolationView]:
    found: list[ViolationView] = []
    for one in nearest:
        name = f'the {"shoreline" if one.is_shore else "keep-out"} "{one.name}"'
        limit = "margin_m"
        if one.distance_m <= 0.0:
            limit = "domain" if one.is_shore else "keep_outs"
            deed = f"goes beyond {name}" if one.is_shore else f"enters {name}"
        elif one.distance_m < one.margin_m - _BORDER_M:
            deed = (
                f"comes within {one.distance_m:.2g} m of {name}; the margin is {one.margin_m:g} m"
            )
        else:
            continue
        found.append(ViolationView(limit, f"The expected track {deed}."))
    return found


def _beyond(expected: FloatArray, site: Site) -> list[ViolationView]:
    """Check a track against the walls of the water and its floor."""
    water, place = site.water, expected[:, 1:4]
    low, high = place.min(axis=0), place.max(axis=0)
    sides = (
        (water.x_min_m - low[0], "south edge"),
        (high[0] - water.x_max_m, "north edge"),
        (water.y_min_m - low[1], "west edge"),
        (high[1] - water.y_max_m, "east edge"),
    )
    found = [f"leaves the {site.kind} by its {side}" for past, side in sides if past > _BORDER_M]
    above = site.floor_m(expected[:, 1], expected[:, 2]) - expected[:, POINT_DOWN]
    if above.min() < -_BORDER_M:
        found.append("touches the floor")
    return [ViolationView("domain", f"The expected track {text}.") for text in found]


def _over(expected: FloatArray, duration_s: float, config: PlannerConfig) -> list[ViolationView]:
    """Check a track against the limits of uncertainty and time."""
    found: list[ViolationView] = []
    worst = expected[expected[:, POINT_STD].argmax()]
    interval_s = config.primitives.point_interval_s
    allowed = config.max_uncertainty_m
    limit = np.hypot(allowed, config.position_filter.drift_m_sqrt_s * np.sqrt(interval_s))
    if worst[POINT_STD] > limit:
        text = (
            f"The robot is expected to be uncertain of its position by {worst[POINT_STD]:.2g} m, "
            f"{worst[POINT_TIME]:.0f} s into the plan; the limit is {allowed:g} m."
        )
        found.append(ViolationView("max_uncertainty_m", text))
    if 0.0 < config.time_budget_s * (1.0 + _SHARE) < duration_s:
        text = (
            f"The plan is expected to take {duration_s:.0f} s; a round may take "
            f"{config.time_budget_s:.0f} s."
        )
        found.append(ViolationView("time_budget_s", text))
    return found
