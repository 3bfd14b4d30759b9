"""What the water has against a leg: walls, floor, shoreline, keep-outs, and the survey's domain."""

from collections.abc import Iterator
from operator import itemgetter

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.outline import Outline
from autonomy.planner.check.clearance import clearances_m, floor_contacts
from autonomy.planner.check.true_ways import TrueWays
from autonomy.planner.check.violation import Violation, leg_title
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import drift, primitive
from autonomy.planner.leg.edge import is_swim
from autonomy.planner.leg.waterway import bounds_of, closed_areas
from autonomy.planner.plan import Leg
from autonomy.site import Box, Site

_DOMAIN_MARGIN_M = 0.005
_Finding = tuple[int, str]
"""Number of a leg, and what is wrong with it."""


def out_of_bounds(legs: tuple[Leg, ...], config: PlannerConfig, site: Site) -> Iterator[Violation]:
    """List where the robot would leave the water, the survey's domain, or their margins.

    The first swims may come from outside the domain, or from within a margin, into it.

    Args:
        legs: The plan, with finite numbers only.
        config: Domain, keep-outs, margins and current.
        site: The water with its floor and shoreline.
    """
    ways = TrueWays.along(legs, drift.courses(config, legs))
    comes_in = np.arange(len(legs)) < _arrival(legs, config)
    found = [
        *_outside(legs, ways, config.domain, site, comes_in),
        *_too_near(ways, config, site, comes_in),
        *_aground(ways, config, site, comes_in),
    ]
    for number, text in sorted(found, key=itemgetter(0)):
        yield Violation(f"legs.{number}.end_ned", f"{leg_title(number, legs[number])} {text}.")


def _arrival(legs: tuple[Leg, ...], config: PlannerConfig) -> int:
    """Return how many swims along the surface bring the robot into the domain, 0 if none."""
    for number, leg in enumerate(legs):
        if not is_swim(leg):
            return 0
        inside = config.area is None or bool(config.area.contains(*leg.end_ned[:2]))
        if inside and config.domain.contains(*leg.end_ned):
            return number + 1
    return 0


def _outside(
    legs: tuple[Leg, ...], ways: TrueWays, domain: Box, site: Site, comes_in: BoolArray
) -> Iterator[_Finding]:
    """Check legs against walls, floor and domain; what leaves the water is not listed twice."""
    low, high = ways.least(ways.corners), -ways.least(-ways.corners)
    believed = np.array([primitive.bounds(leg) for leg in legs])  # (n, 2, 3)
    water_m, domain_m = _past_m(low, high, site.water), _past_m(low, high, domain)
    belief_m = _past_m(believed[:, 0], believed[:, 1], site.water)
    for number in _broken(np.concatenate([water_m, domain_m, belief_m], axis=1).max(axis=1)):
        texts = _beyond(water_m[number], site.water, site.kind)
        if not texts and not comes_in[number]:
            texts = _beyond(domain_m[number], domain, "survey domain")
        if not texts:
            believes = _beyond(belief_m[number], site.water, site.kind)
            texts = [f"{text}, in the robot's belief" for text in believes]
        for text in texts:
            yield number, f"goes {text}"


def _too_near(
    ways: TrueWays, config: PlannerConfig, site: Site, comes_in: BoolArray
) -> Iterator[_Finding]:
    """Check legs against keep-outs and shoreline, with their margin."""
    for area in closed_areas(config, site):
        name = f'the keep-out "{area.name}"'
        yield from _too_near_one(area.outline, name, 1.0, ways, config.margin_m, comes_in)
    for name, outline in bounds_of(config, site):
        yield from _too_near_one(outline, name, -1.0, ways, config.margin_m, comes_in)


def _too_near_one(
    area: Outline, name: str, side: float, ways: TrueWays, margin_m: float, comes_in: BoolArray
) -> Iterator[_Finding]:
    """Tell which ways break the margin to an area, and how.

    Args:
        area: The area.
        name: What to call it.
        side: 1 if the robot must stay outside of it, -1 if inside.
        ways: The ways.
        margin_m: Least distance from its outline.
        comes_in: Whether a way leads back into the water that may be used: then it may begin
            within the margin, or on the wrong side of a shoreline; shape ``(n,)``.
    """
    within_m = margin_m + 1.0
    distances_m = side * area.distance_m(ways.corners[:, 0], ways.corners[:, 1], within_m)
    first_m, least_m = distances_m[ways.first], ways.least(distances_m)
    margins_m = np.where(comes_in, np.minimum(first_m, margin_m), margin_m)
    begins, ends, first = ways.pieces()
    clearances = np.minimum.reduceat(clearances_m(area, begins, ends, within_m), first)
    enters = (clearances <= 0.0) | (least_m <= -_DOMAIN_MARGIN_M)
    may_begin_there = comes_in & (first_m <= 0.0) & (side < 0.0)
    is_near = enters | (clearances < margins_m - _DOMAIN_MARGIN_M)
    for number in np.flatnonzero(is_near & ~may_begin_there).tolist():
        if enters[number]:
            yield number, f"enters {name}" if side > 0.0 else f"goes beyond {name}"
        else:
            near_m, limit_m = clearances[number], margins_m[number]
            yield number, f"comes within {near_m:.2f} m of {name}; the margin is {limit_m:g} m"


def _aground(
    ways: TrueWays, config: PlannerConfig, site: Site, comes_in: BoolArray
) -> Iterator[_Finding]:
    """Check legs against the floor, with its margin."""
    deepest_m = -ways.least(-ways.corners[:, 2])
    is_below_all = deepest_m > site.water.depth_max_m + _DOMAIN_MARGIN_M
    for number, contact in enumerate(floor_contacts(site, ways)):
        is_free = contact.clearance_m >= config.floor_margin_m - _DOMAIN_MARGIN_M
        if is_free or comes_in[number] or is_below_all[number]:
            continue
        place = f"{contact.north_m:.4g} m north, {contact.east_m:.4g} m east"
        if contact.floor_m <= 0.0:
            yield number, f"is on land at {place}"
        elif contact.clearance_m < 0.0:
            yield (
                number,
                f"goes {-contact.clearance_m:.2f} m under the floor, "
                f"which is {contact.floor_m:.3g} m deep at {place}",
            )
        else:
            yield (
                number,
                f"comes within {contact.clearance_m:.2f} m of the floor, {contact.floor_m:.3g} m "
                f"deep at {place}; the margin is {config.floor_margin_m:g} m",
            )


def _past_m(low: FloatArray, high: FloatArray, box: Box) -> FloatArray:
    """Return by how much bounds, ``(n, 3)``, leave the sides of a box, ``(n, 6)``."""
    sides = (
        box.x_min_m - low[:, 0],
        high[:, 0] - box.x_max_m,
        box.y_min_m - low[:, 1],
        high[:, 1] - box.y_max_m,
        high[:, 2] - box.depth_max_m,
        -low[:, 2],
    )
    return np.stack(sides, axis=1)


def _broken(past_m: FloatArray) -> list[int]:
    return np.flatnonzero(past_m > _DOMAIN_MARGIN_M).tolist()


def _beyond(past_m: FloatArray, box: Box, name: str) -> list[str]:
    """Say by how much a leg leaves a box, and through which sides, in the order of ``_past_m``."""
    sides = (
        f"south edge of the {name}, x {box.x_min_m:g} m",
        f"north edge of the {name}, x {box.x_max_m:g} m",
        f"west edge of the {name}, y {box.y_min_m:g} m",
        f"east edge of the {name}, y {box.y_max_m:g} m",
        f"{name} floor {box.depth_max_m:g} m",
        "surface",
    )
    return [f"{past_m[side]:.2f} m beyond the {sides[side]}" for side in _broken(past_m)]
