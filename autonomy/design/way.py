"""The waypoints of a design, whatever draws them."""

import math
from collections.abc import Sequence

from autonomy.design import pattern
from autonomy.design.document import (
    WAYPOINTS_MAX,
    AlongIsobath,
    AlongLine,
    Design,
    ExpandingSquare,
    Lawnmower,
    Mooring,
    Reference,
    Section,
    SpiralOut,
    Spot,
    Star,
    StationKeep,
    Way,
    Waypoint,
)
from autonomy.design.reference import turns_of
from autonomy.site import Site

_ISOBATH_STEPS = 120
"""An isobath is followed in so many steps, or in steps of a spacing if those are shorter."""


def waypoints_of(design: Design, site: Site, spacing_m: float) -> tuple[Waypoint, ...]:
    """Lay a design's waypoints out.

    Args:
        design: What is drawn.
        site: The water that it is drawn in.
        spacing_m: Between neighbouring lines of a pattern that says none: the correlation length
            of the robot's map.

    Raises:
        ValueError: If there are more than 500, or the pattern cannot be laid out; in words.
    """
    content = design.content
    if isinstance(content, Way):
        first = content.waypoints[:1] if content.returns else ()
        return (*content.waypoints, *first)
    if isinstance(content, Mooring | StationKeep):
        return (Waypoint(north_m=content.place.north_m, east_m=content.place.east_m),)
    if isinstance(content, Reference):
        return tuple(
            Waypoint(north_m=north_m, east_m=east_m) for _, north_m, east_m, _ in turns_of(content)
        )
    places = _places(content, site, spacing_m)
    if len(places) > WAYPOINTS_MAX:
        raise ValueError(
            f"it has {len(places):,} waypoints; a design may have {WAYPOINTS_MAX}:"
            " ask for a larger spacing or a smaller area"
        )
    return tuple(Waypoint(north_m=north, east_m=east) for north, east in places)


def _places(
    content: Lawnmower | ExpandingSquare | SpiralOut | Star | AlongLine | AlongIsobath | Section,
    site: Site,
    usual_m: float,
) -> list[pattern.NorthEast]:
    match content:
        case Lawnmower():
            return _over_area(content, content.spacing_m or usual_m)
        case ExpandingSquare():
            spacing_m = content.spacing_m or usual_m
            return pattern.expanding_square(
                content.centre.ne_m, spacing_m, content.turns, content.heading_rad
            )
        case SpiralOut():
            spacing_m = content.spacing_m or usual_m
            _refuse_too_many(content.radius_m / spacing_m)
            return pattern.spiral_out(content.centre.ne_m, spacing_m, content.radius_m)
        case Star():
            return pattern.star(
                content.centre.ne_m, content.radius_m, content.lines, content.heading_rad
            )
        case AlongLine():
            return pattern.passes(
                _pairs(content.line), content.passes, content.spacing_m or usual_m
            )
        case AlongIsobath():
            return _along_isobath(content, site, usual_m)
        case Section():
            return pattern.repeated(_pairs(content.line), content.repeats)


def _over_area(content: Lawnmower, spacing_m: float) -> list[pattern.NorthEast]:
    corners = _pairs(content.area)
    norths, easts = zip(*corners, strict=True)
    _refuse_too_many((max(norths) - min(norths) + max(easts) - min(easts)) / spacing_m / 2.0)
    lines = pattern.lawnmower(corners, spacing_m, content.heading_rad)
    if content.is_crossed:
        lines += pattern.lawnmower(corners, spacing_m, content.heading_rad + math.pi / 2.0)
    return lines


def _along_isobath(content: AlongIsobath, site: Site, usual_m: float) -> list[pattern.NorthEast]:
    water = site.water
    reach_m = max(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m)
    return pattern.isobath(
        site.floor_m,
        content.depth_m,
        content.near.ne_m,
        content.length_m,
        min(max(content.length_m / _ISOBATH_STEPS, reach_m / 500.0), usual_m),
        is_reversed=content.is_reversed,
        reach_m=reach_m,
    )


def _refuse_too_many(lines: float) -> None:
    """Refuse what would lay out far too much before it is laid out.

    Raises:
        ValueError: If there would be more lines than waypoints are allowed.
    """
    if lines > WAYPOINTS_MAX:
        raise ValueError(
            f"it has about {lines:,.0f} lines; a design may have {WAYPOINTS_MAX} waypoints:"
            " ask for a larger spacing or a smaller area"
        )


def _pairs(spots: Sequence[Spot]) -> list[pattern.NorthEast]:
    return [spot.ne_m for spot in spots]
