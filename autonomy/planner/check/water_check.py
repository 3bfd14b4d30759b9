"""What the water has against a leg: walls, floor, shoreline, keep-outs, and the survey's domain."""

from collections.abc import Iterator, Sequence

from autonomy.arrays import FloatArray
from autonomy.outline import Outline
from autonomy.planner.check.clearance import clearance_m, floor_contact, true_way
from autonomy.planner.check.violation import Violation, leg_title
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import drift, primitive
from autonomy.planner.leg.waterway import bounds_of, closed_areas
from autonomy.planner.plan import Leg
from autonomy.site import Box, Site

_DOMAIN_MARGIN_M = 0.005


def out_of_bounds(legs: tuple[Leg, ...], config: PlannerConfig, site: Site) -> Iterator[Violation]:
    """List where the robot would leave the water, the survey's domain, or their margins.

    The first swims may come from outside the domain, or from within a margin, into it.

    Args:
        legs: The plan, with finite numbers only.
        config: Domain, keep-outs, margins and current.
        site: The water with its floor and shoreline.
    """
    arrival = _arrival(legs, config)
    for number, (leg, course) in enumerate(zip(legs, drift.courses(config, legs), strict=True)):
        way = true_way(leg, course)
        comes_in = number < arrival
        yield from _outside(number, leg, way, config.domain, site, comes_in=comes_in)
        yield from _aground(number, leg, way, config, site, comes_in=comes_in)


def _arrival(legs: tuple[Leg, ...], config: PlannerConfig) -> int:
    """Return how many swims along the surface bring the robot into the domain, 0 if none."""
    for number, leg in enumerate(legs):
        if not drift.knows_place(leg):
            return 0
        inside = config.area is None or bool(config.area.contains(*leg.end_ned[:2]))
        if inside and config.domain.contains(*leg.end_ned):
            return number + 1
    return 0


def _outside(
    number: int, leg: Leg, way: FloatArray, domain: Box, site: Site, *, comes_in: bool
) -> Iterator[Violation]:
    """Check a leg against walls, floor and domain; what leaves the water is not listed twice."""
    low, high = way.min(axis=0).tolist(), way.max(axis=0).tolist()
    beyond = _beyond(low, high, site.water, site.kind)
    if not beyond and not comes_in:
        beyond = _beyond(low, high, domain, "survey domain")
    if not beyond:
        believed = _beyond(*primitive.bounds(leg), site.water, site.kind)
        beyond = [f"{text}, in the robot's belief" for text in believed]
    for text in beyond:
        yield Violation(f"legs.{number}.end_ned", f"{leg_title(number, leg)} goes {text}.")


def _aground(
    number: int, leg: Leg, way: FloatArray, config: PlannerConfig, site: Site, *, comes_in: bool
) -> Iterator[Violation]:
    """Check a leg against keep-outs, shoreline and floor, with their margins."""
    borders = [
        (area.outline, f'the keep-out "{area.name}"', 1.0) for area in closed_areas(config, site)
    ]
    borders += [(outline, name, -1.0) for name, outline in bounds_of(config, site)]
    for area, name, side in borders:
        text = _too_near(area, name, side, way, config.margin_m, comes_in=comes_in)
        if text:
            yield Violation(f"legs.{number}.end_ned", f"{leg_title(number, leg)} {text}.")
    contact = floor_contact(site, way)
    is_below_all = way[:, 2].max() > site.water.depth_max_m + _DOMAIN_MARGIN_M
    if comes_in or is_below_all or contact.clearance_m >= config.floor_margin_m - _DOMAIN_MARGIN_M:
        return
    place = f"{contact.north_m:.4g} m north, {contact.east_m:.4g} m east"
    if contact.floor_m <= 0.0:
        text = f"is on land at {place}"
    elif contact.clearance_m < 0.0:
        text = (
            f"goes {-contact.clearance_m:.2f} m under the floor, "
            f"which is {contact.floor_m:.3g} m deep at {place}"
        )
    else:
        text = (
            f"comes within {contact.clearance_m:.2f} m of the floor, {contact.floor_m:.3g} m deep "
            f"at {place}; the margin is {config.floor_margin_m:g} m"
        )
    yield Violation(f"legs.{number}.end_ned", f"{leg_title(number, leg)} {text}.")


def _too_near(
    area: Outline, name: str, side: float, way: FloatArray, margin_m: float, *, comes_in: bool
) -> str:
    """Return how a way breaks the margin to an area, "" if it does not.

    Args:
        area: The area.
        name: What to call it.
        side: 1 if the robot must stay outside of it, -1 if inside.
        way: Corners of the way, shape ``(m, 3)``.
        margin_m: Least distance from its outline.
        comes_in: Whether the way leads back into the water that may be used: then it may begin
            within the margin, or on the wrong side of a shoreline.
    """
    within_m = margin_m + 1.0
    distances = side * area.distance_m(way[:, 0], way[:, 1], within_m)
    if comes_in:
        if side < 0.0 and distances[0] <= 0.0:
            return ""
        margin_m = min(margin_m, float(distances[0]))
    clearance = clearance_m(area, way, within_m)
    if clearance <= 0.0 or distances.min() <= -_DOMAIN_MARGIN_M:
        return f"enters {name}" if side > 0.0 else f"goes beyond {name}"
    if clearance < margin_m - _DOMAIN_MARGIN_M:
        return f"comes within {clearance:.2f} m of {name}; the margin is {margin_m:g} m"
    return ""


def _beyond(low: Sequence[float], high: Sequence[float], box: Box, name: str) -> list[str]:
    """Say by how much a leg's bounds leave a box, and through which side."""
    sides = (
        (box.x_min_m - low[0], f"south edge of the {name}, x {box.x_min_m:g} m"),
        (high[0] - box.x_max_m, f"north edge of the {name}, x {box.x_max_m:g} m"),
        (box.y_min_m - low[1], f"west edge of the {name}, y {box.y_min_m:g} m"),
        (high[1] - box.y_max_m, f"east edge of the {name}, y {box.y_max_m:g} m"),
        (high[2] - box.depth_max_m, f"{name} floor {box.depth_max_m:g} m"),
        (-low[2], "surface"),
    )
    return [f"{past:.2f} m beyond the {side}" for past, side in sides if past > _DOMAIN_MARGIN_M]
