"""The part of a water that a robot takes with it: its survey's domain, coarse enough to fit.

Runs in a worker process.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from autonomy.chart import DepthGrid
from autonomy.site import Area, Bathymetry, Box, Site
from server.water.simple_shore import simpler_floor, simpler_shore

TASK = f"{__name__}:run"
_AROUND_SHARE = 0.1
"""So much of its size is taken around a domain: a robot drifts."""


def run(
    site: Site, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> dict[str, Any]:
    """Return the document of ``on_board``."""
    del report, is_cancelled
    return on_board(site).model_dump(mode="json")


def on_board(site: Site) -> Site:
    """Return a site about the domain of one that needs no chart, and leaves its water nowhere.

    Args:
        site: A water; without a chart it is returned as it is.

    Raises:
        ReadingError: If its shore is too winding for a simple one to be found in it.
    """
    if site.chart is None:
        return site
    box = _around(site)
    changes: dict[str, Any] = {"chart": None, "water": box}
    if site.shore is not None:
        rings = _cut(site, box)
        shore, *islands = [tuple((north, east) for north, east in ring.tolist()) for ring in rings]
        changes["shoreline"] = Area(name="Shore", corners_m=shore)
        changes["islands"] = tuple(
            Area(name=f"Island {number}", corners_m=ring) for number, ring in enumerate(islands, 1)
        )
    if site.depth_lines is not None:
        changes["bathymetry"] = _floor(site, box)
    return Site.model_validate({**dict(site), **changes})


def _around(site: Site) -> Box:
    domain, water = site.domain, site.water
    room = _AROUND_SHARE * max(domain.x_max_m - domain.x_min_m, domain.y_max_m - domain.y_min_m)
    return Box(
        x_min_m=max(domain.x_min_m - room, water.x_min_m),
        x_max_m=min(domain.x_max_m + room, water.x_max_m),
        y_min_m=max(domain.y_min_m - room, water.y_min_m),
        y_max_m=min(domain.y_max_m + room, water.y_max_m),
        depth_max_m=water.depth_max_m,
    )


def _cut(site: Site, box: Box) -> tuple[np.ndarray, ...]:
    """Return the largest piece of the water in a box, simplified."""
    from shapely.geometry import Polygon
    from shapely.geometry import box as rectangle

    outline = site.shore
    assert outline is not None  # noqa: S101 - the caller looked
    water = Polygon(outline.rings[0], outline.rings[1:])
    found: Any = water.intersection(rectangle(box.x_min_m, box.y_min_m, box.x_max_m, box.y_max_m))
    parts = [each for each in getattr(found, "geoms", [found]) if each.geom_type == "Polygon"]
    piece = max(parts, key=lambda each: each.area)
    rings = tuple(np.array(ring.coords)[:-1] for ring in (piece.exterior, *piece.interiors))
    return simpler_shore(rings)


def _floor(site: Site, box: Box) -> Bathymetry:
    """Return the floor in a box, from every line of the chart that meets it."""
    known = site.depth_lines
    assert known is not None  # noqa: S101 - the caller looked
    sides = ((box.x_min_m, box.x_max_m), (box.y_min_m, box.y_max_m))
    north, east = (
        np.unique(np.concatenate([axis[(axis > low) & (axis < high)], [low, high]]))
        for axis, (low, high) in zip(known, sides, strict=True)
    )
    unlimited = site.model_copy(
        update={"water": site.water.model_copy(update={"depth_max_m": 1e6}), "tide_offset_m": 0.0}
    )
    depth = unlimited.floor_m(north[:, None], east[None, :]).astype(np.float32)
    grid = simpler_floor(DepthGrid(north, east, depth))
    return Bathymetry(
        north_m=tuple(grid.north_m.tolist()),
        east_m=tuple(grid.east_m.tolist()),
        depth_m=tuple(tuple(row) for row in grid.depth_m.astype(float).round(2).tolist()),
    )
