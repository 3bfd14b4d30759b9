"""Shoreline and floor of a water body whose depths are known."""

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.frames import ned_to_enu
from autonomy.site import Site
from webui.scene.colour import LAKE_BED, SHORE
from webui.scene.stage import Stage

_CELLS = 56
"""Cells of the drawn floor along each axis."""
_OPACITY = 0.75
_SHORE_PX = 2.0
_BED, _OUTLINE = "floor/bed", "floor/shore"


class LakeBed:
    """Drawn once; the site does not change while a scene stands."""

    def __init__(self, stage: Stage, site: Site) -> None:
        self._stage = stage
        self.visible = True
        self.has_content = site.bathymetry is not None or site.shoreline is not None
        if site.bathymetry is not None:
            vertices, faces = bed(site)
            # From outside one looks through the near shore onto the floor, not against the shore.
            stage.mesh(_BED, ned_to_enu(vertices), faces, LAKE_BED, _OPACITY, side="front")
        if site.shoreline is not None:
            corners = np.array(site.shoreline.corners_m)
            ring = ned_to_enu(np.column_stack([corners, np.zeros(len(corners))]))
            stage.lines(
                _OUTLINE, np.stack([ring, np.roll(ring, -1, axis=0)], axis=1), SHORE, _SHORE_PX
            )

    def show(self, visible: bool) -> None:
        """Show or hide shoreline and floor."""
        self.visible = visible
        self._stage.show(_BED, visible)
        self._stage.show(_OUTLINE, visible)


def bed(site: Site) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return the floor under water: vertices in NED, shape ``(n, 3)``, m, and triangles."""
    water = site.water
    north, east = np.meshgrid(
        np.linspace(water.x_min_m, water.x_max_m, _CELLS + 1),
        np.linspace(water.y_min_m, water.y_max_m, _CELLS + 1),
        indexing="ij",
    )
    depth = np.asarray(site.floor_m(north, east))
    is_water = depth > 0.0
    if site.shoreline is not None:
        is_water &= site.shoreline.contains(north, east)
    vertices = np.stack([north, east, np.maximum(depth, 0.0)], axis=-1).reshape(-1, 3)
    row = _CELLS + 1
    here = (np.arange(_CELLS)[:, None] * row + np.arange(_CELLS)).ravel()
    corners = np.column_stack([here, here + 1, here + row + 1, here + row])
    corners = corners[is_water.ravel()[corners].all(axis=1)]
    return vertices, np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
