"""Areas that no plan may enter, as translucent walls from the surface to the floor."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import ned_to_enu
from autonomy.site import Area
from webui.scene.colour import KEEP_OUT
from webui.scene.source import SceneSource
from webui.scene.stage import Stage

_OPACITY = 0.2
_EDGE_PX = 1.6


class KeepOuts:
    """Redraws only when an area changed."""

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._stage = stage
        self._source = source
        self._shown: tuple[Area, ...] = ()
        self.visible = True

    @property
    def has_content(self) -> bool:
        """Whether there is anything to show."""
        return bool(self._shown)

    def update(self) -> None:
        """Fetch the areas and draw them if they changed."""
        areas = self._source.keep_outs()
        if areas == self._shown:
            return
        self._clear()
        self._shown = areas
        for number, area in enumerate(areas):
            self._draw(number, area)
        self.show(self.visible)

    def show(self, visible: bool) -> None:
        """Show or hide all of them."""
        self.visible = visible
        for number in range(len(self._shown)):
            self._stage.show(f"keep_out/{number}", visible)
            self._stage.show(f"keep_out/edge{number}", visible)
            self._stage.show_label(f"keep_out/name{number}", visible)

    def _draw(self, number: int, area: Area) -> None:
        bottom_m = self._source.site.water.depth_max_m
        corners, faces = walls(np.array(area.corners_m), bottom_m)
        self._stage.mesh(f"keep_out/{number}", ned_to_enu(corners), faces, KEEP_OUT, _OPACITY)
        top = ned_to_enu(corners[: len(area.corners_m)])
        ring = np.stack([top, np.roll(top, -1, axis=0)], axis=1)
        self._stage.lines(f"keep_out/edge{number}", ring, KEEP_OUT, _EDGE_PX)
        self._stage.label(f"keep_out/name{number}", f"keep out: {area.name}", top.mean(axis=0))

    def _clear(self) -> None:
        for number in range(len(self._shown)):
            self._stage.remove(f"keep_out/{number}")
            self._stage.remove(f"keep_out/edge{number}")
            self._stage.remove_label(f"keep_out/name{number}")


def walls(corners_m: FloatArray, bottom_m: float) -> tuple[FloatArray, np.ndarray]:
    """Raise walls between the surface and a depth along a closed outline.

    Args:
        corners_m: North and east of each corner, shape ``(n, 2)``, m.
        bottom_m: Where the walls end, m.

    Returns:
        Vertices in NED, shape ``(2 n, 3)``, m, those at the surface first, and triangles between
        them, shape ``(2 n, 3)``.
    """
    count = len(corners_m)
    top = np.column_stack([corners_m, np.zeros(count)])
    here = np.arange(count)
    beside = np.roll(here, -1)
    upper = np.column_stack([here, beside, here + count])
    lower = np.column_stack([beside, beside + count, here + count])
    return np.concatenate([top, top + np.array([0.0, 0.0, bottom_m])]), np.concatenate(
        [upper, lower]
    )
