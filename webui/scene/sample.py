"""Every sample behind the map, a mark of its own shape and colour for each level of fidelity."""

from typing import Literal

import numpy as np

from autonomy.frames import ned_to_enu
from webui.scene.colour import FIDELITY
from webui.scene.projection import VIEW_WIDTH
from webui.scene.source import SampleView, SceneSource
from webui.scene.stage import Stage

Shape = Literal["square", "diamond", "circle", "rounded"]
_SHAPES: tuple[Shape, ...] = ("square", "diamond", "circle")
"""Worst located, in between, best located: told apart without colour."""
_SIZE = 0.0022 * VIEW_WIDTH
"""Small enough that the map and the track can be seen between hundreds of them."""
_SMOOTHED = 1.25
"""A sample whose position was corrected is drawn this many times as large."""


class Samples:
    """Redraws only when the source hands out other samples."""

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._stage = stage
        self._source = source
        self._shown: SampleView | None = None
        self._names: list[str] = []
        self.visible = False

    @property
    def has_content(self) -> bool:
        """Whether there is anything to show."""
        return bool(self._names)

    def update(self) -> None:
        """Fetch the samples and draw them if they changed."""
        view = self._source.samples()
        if view is self._shown:
            return
        for name in self._names:
            self._stage.remove(name)
        self._names = []
        self._shown = view
        if view is not None:
            self._draw(view)

    def show(self, visible: bool) -> None:
        """Show or hide all of them."""
        self.visible = visible
        for name in self._names:
            self._stage.show(name, visible)

    def _draw(self, view: SampleView) -> None:
        positions = ned_to_enu(view.position_ned)
        last = max(self._source.fidelity_levels - 1, 1)
        place = np.rint(view.fidelity / last * (len(FIDELITY) - 1)).astype(np.int64)
        for level in range(len(FIDELITY)):
            for is_smoothed in (False, True):
                chosen = (place == level) & (view.is_smoothed == is_smoothed)
                if not chosen.any():
                    continue
                name = f"samples/{level}{'s' if is_smoothed else ''}"
                size = _SIZE * (_SMOOTHED if is_smoothed else 1.0)
                self._stage.points(
                    name, positions[chosen], FIDELITY[level], shape=_SHAPES[level], size=size
                )
                self._names.append(name)
        self.show(self.visible)
