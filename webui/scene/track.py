"""The track flown, coloured by fidelity, and the drift between missions, muted and apart.

Resending a growing line costs megabytes a second at 10^5 points, so it is sent in fixed chunks and
a short live tail, and only the tail is ever redrawn.
"""

import numpy as np
import viser

from autonomy.arrays import BoolArray, FloatArray
from autonomy.frames import ned_to_enu
from webui.scene.colour import DRIFT, ColourArray, fidelity_colours
from webui.scene.source import SceneSource
from webui.scene.stage import Stage

CHUNK_POINTS = 1500
_SURVEY_PX = 2.5
_DRIFT_PX = 1.0
_TAIL = "tail"


class Track:
    """Draws what the source adds, piece by piece.

    A robot that waits at the surface for an hour covers its survey with scribble, so that what it
    drifted is a layer of its own, which nobody sees who does not ask for it.
    """

    def __init__(self, stage: Stage, source: SceneSource, chunk_points: int = CHUNK_POINTS) -> None:
        self._source = source
        self._chunk_points = chunk_points
        self._cursor = 0
        self._chunks = 0
        self._points: FloatArray = np.empty((0, 3))
        self._colours: ColourArray = np.empty((0, 3), np.uint8)
        self._is_adrift: BoolArray = np.empty(0, np.bool_)
        self.survey = Strand(stage, "track", _SURVEY_PX, visible=True)
        self.drift = Strand(stage, "drift", _DRIFT_PX, visible=False)

    def update(self) -> None:
        """Fetch and draw what is new since the last call."""
        piece = self._source.track_since(self._cursor)
        self._cursor = piece.cursor
        if piece.restarted:
            self._forget()
        if len(piece.position_ned) == 0:
            return
        colours = fidelity_colours(piece.fidelity, self._source.fidelity_levels)
        colours[piece.is_adrift] = DRIFT
        self._points = np.concatenate([self._points, ned_to_enu(piece.position_ned)])
        self._colours = np.concatenate([self._colours, colours])
        self._is_adrift = np.concatenate([self._is_adrift, piece.is_adrift])
        while len(self._points) > self._chunk_points:
            self._draw(str(self._chunks), self._chunk_points)
            self._chunks += 1
            self._drop(self._chunk_points - 1)
        self._draw(_TAIL, len(self._points))

    def _draw(self, piece: str, end: int) -> None:
        points, colours = self._points[:end], self._colours[:end]
        segments = np.stack([points[:-1], points[1:]], axis=1)
        # The end of a segment says how it was travelled, so it has its colour too.
        shades = np.stack([colours[1:], colours[1:]], axis=1)
        is_adrift = self._is_adrift[1:end]
        self.survey.draw(piece, segments[~is_adrift], shades[~is_adrift])
        self.drift.draw(piece, segments[is_adrift], shades[is_adrift])

    def _forget(self) -> None:
        self.survey.clear()
        self.drift.clear()
        self._chunks = 0
        self._drop(len(self._points))

    def _drop(self, count: int) -> None:
        self._points = self._points[count:]
        self._colours = self._colours[count:]
        self._is_adrift = self._is_adrift[count:]


class Strand:
    """The pieces of a track that look alike, below ``/world/<name>``."""

    def __init__(self, stage: Stage, name: str, width_px: float, *, visible: bool) -> None:
        self._stage = stage
        self._name = name
        self._width_px = width_px
        self.pieces: dict[str, viser.LineSegmentsHandle] = {}
        self.visible = visible

    def draw(self, piece: str, segments_enu: FloatArray, colours: ColourArray) -> None:
        """Draw segments, shape ``(n, 2, 3)``, m; what the piece was before goes."""
        if len(segments_enu) == 0:
            if self.pieces.pop(piece, None) is not None:
                self._stage.remove(f"{self._name}/{piece}")
            return
        handle = self._stage.lines(f"{self._name}/{piece}", segments_enu, colours, self._width_px)
        handle.visible = self.visible
        self.pieces[piece] = handle

    @property
    def has_content(self) -> bool:
        """Whether there is anything to show."""
        return bool(self.pieces)

    def show(self, visible: bool) -> None:
        """Show or hide all of it."""
        self.visible = visible
        for handle in self.pieces.values():
            handle.visible = visible

    def clear(self) -> None:
        """Forget every piece."""
        for piece in self.pieces:
            self._stage.remove(f"{self._name}/{piece}")
        self.pieces.clear()
