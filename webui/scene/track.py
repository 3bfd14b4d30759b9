"""The track flown, coloured by fidelity: fixed chunks and a short live tail.

Resending a growing line costs megabytes a second at 10^5 points, so only the tail is ever redrawn.
"""

import numpy as np
import viser

from autonomy.arrays import FloatArray
from autonomy.frames import ned_to_enu
from webui.scene.colour import ColourArray, fidelity_colours
from webui.scene.source import SceneSource
from webui.scene.stage import Stage

CHUNK_POINTS = 1500
_WIDTH_PX = 2.5


class Track:
    """Draws what the source adds, piece by piece, below ``/world/track``."""

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._stage = stage
        self._source = source
        self._cursor = 0
        self._chunks: list[viser.LineSegmentsHandle] = []
        self._points: FloatArray = np.empty((0, 3))
        self._colours: ColourArray = np.empty((0, 3), np.uint8)
        self.visible = True

    def update(self) -> None:
        """Fetch and draw what is new since the last call."""
        piece = self._source.track_since(self._cursor)
        self._cursor = piece.cursor
        if piece.restarted:
            self._forget()
        if len(piece.position_ned) == 0:
            return
        colours = fidelity_colours(piece.fidelity, self._source.fidelity_levels)
        self._points = np.concatenate([self._points, ned_to_enu(piece.position_ned)])
        self._colours = np.concatenate([self._colours, colours])
        while len(self._points) > CHUNK_POINTS:
            self._draw(len(self._chunks), self._points[:CHUNK_POINTS], self._colours[:CHUNK_POINTS])
            self._points = self._points[CHUNK_POINTS - 1 :]
            self._colours = self._colours[CHUNK_POINTS - 1 :]
        self._draw(None, self._points, self._colours)

    def show(self, visible: bool) -> None:
        """Show or hide all of it."""
        self.visible = visible
        for chunk in self._chunks:
            chunk.visible = visible
        self._draw(None, self._points, self._colours)

    def _draw(self, chunk: int | None, points: FloatArray, colours: ColourArray) -> None:
        if len(points) < 2:
            return
        handle = self._stage.lines(
            "track/tail" if chunk is None else f"track/{chunk}",
            np.stack([points[:-1], points[1:]], axis=1),
            np.stack([colours[:-1], colours[1:]], axis=1),
            _WIDTH_PX,
        )
        handle.visible = self.visible
        if chunk is not None:
            self._chunks.append(handle)

    def _forget(self) -> None:
        for chunk in range(len(self._chunks)):
            self._stage.remove(f"track/{chunk}")
        self._chunks.clear()
        self._points = np.empty((0, 3))
        self._colours = np.empty((0, 3), np.uint8)
        self._stage.remove("track/tail")
