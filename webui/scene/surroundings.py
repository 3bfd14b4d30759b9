"""What stands still: water surface, walls or shore, floor, and the box that is explored."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import ned_to_enu
from autonomy.site import Box, Site
from webui.scene.colour import DOMAIN, EDGE, FLOOR, WATER, Colour
from webui.scene.stage import Stage

_BOX_EDGES = np.array(
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]]
)


def draw_surroundings(stage: Stage, site: Site) -> None:
    """Draw a site's fixed parts once."""
    water = _corners(site.water)
    if site.bathymetry is None:
        stage.rectangle("floor", water[4:], FLOOR, 1.0)
    stage.rectangle("surface", water[:4], WATER, 0.12)
    if site.kind == "tank":
        for wall in range(4):
            ring = [wall, (wall + 1) % 4, 4 + (wall + 1) % 4, 4 + wall]
            stage.rectangle(f"wall{wall}", water[ring], WATER, 0.06)
    _edges(stage, "water_edges", site.water, EDGE, 1.5)
    if site.domain != site.water:
        _edges(stage, "domain", site.domain, DOMAIN, 1.0)
    _ruler(stage, site)


def _corners(box: Box) -> FloatArray:
    """Return the four surface corners, then the four floor corners, in ENU metres."""
    ring = (
        (box.x_min_m, box.y_min_m),
        (box.x_max_m, box.y_min_m),
        (box.x_max_m, box.y_max_m),
        (box.x_min_m, box.y_max_m),
    )
    return ned_to_enu(np.array([(*xy, z) for z in (0.0, box.depth_max_m) for xy in ring]))


def _edges(stage: Stage, name: str, box: Box, colour: Colour, width_px: float) -> None:
    stage.lines(name, _corners(box)[_BOX_EDGES], colour, width_px)


def _ruler(stage: Stage, site: Site) -> None:
    """Name north, the width and the depth where they can be read."""
    water = site.water
    middle_y = (water.y_min_m + water.y_max_m) / 2
    for name, position_ned, text in (
        ("north", (water.x_max_m, middle_y, 0.0), "N"),
        ("width", (water.x_min_m, middle_y, 0.0), f"{water.y_max_m - water.y_min_m:g} m"),
    ):
        stage.label(f"ruler_{name}", text, ned_to_enu(np.array(position_ned)))
    write_depth(stage, site)


def write_depth(stage: Stage, site: Site) -> None:
    """Name the depth at the floor, and say how many times as deep as it is it is drawn."""
    water = site.water
    text = f"{water.depth_max_m:g} m deep"
    if stage.exaggeration != 1.0:
        text += f", drawn {stage.exaggeration:g} times as deep"
    corner_ned = np.array((water.x_min_m, water.y_max_m, water.depth_max_m))
    stage.label("ruler_depth", text, ned_to_enu(corner_ned))
