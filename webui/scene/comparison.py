"""A what-if run: its reference and every controller's track, dashed because none is flown."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import ned_to_enu
from webui.scene.colour import REFERENCE, RUNS, Colour
from webui.scene.projection import VIEW_WIDTH
from webui.scene.source import ComparisonView, SceneSource
from webui.scene.stage import Stage

_DASHES = 60
"""Dashes of the longest line; the others take dashes of the same length."""
_WIDTH_PX = 2.0
_REFERENCE_PX = 3.0
_IN_SIGHT = 0.6
"""Share of the view's width, from its middle, in which labels stand."""


class Comparison:
    """Redraws only when the source hands out another comparison."""

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._stage = stage
        self._source = source
        self._shown: ComparisonView | None = None
        self._lines: list[str] = []
        self._labels: list[str] = []
        self.visible = True

    def update(self) -> None:
        """Fetch the comparison and draw it if it changed."""
        view = self._source.comparison()
        if view is self._shown:
            return
        self._clear()
        self._shown = view
        if view is not None:
            self._draw(view)

    def show(self, visible: bool) -> None:
        """Show or hide all of it."""
        self.visible = visible
        for name in self._lines:
            self._stage.show(name, visible)
        for name in self._labels:
            self._stage.show_label(name, visible)

    def _draw(self, view: ComparisonView) -> None:
        tracks = [("reference", view.reference_ned, REFERENCE, _REFERENCE_PX, 1.0)]
        for place, run in enumerate(view.runs):
            # Tracks end close together; labels along them stay apart.
            share = (place + 1) / (len(view.runs) + 1)
            colour = RUNS[place % len(RUNS)]
            tracks.append((run.title, run.position_ned, colour, _WIDTH_PX, share))
        longest = max(_length(positions) for _, positions, _, _, _ in tracks)
        for place, (title, positions, colour, width_px, share) in enumerate(tracks):
            known = positions[np.isfinite(positions).all(axis=1)]
            if _length(known) <= 0.0:
                continue
            self._line(f"whatif/{place}", known, colour, longest / _DASHES, width_px)
            seen = self._in_sight(known)
            self._label(f"whatif/label{place}", title, seen[round(share * (len(seen) - 1))])
        self.show(self.visible)

    def _in_sight(self, positions: FloatArray) -> FloatArray:
        """Return the beginning of a line that leaves the view, so that its label can be read."""
        offsets = positions[:, :2] - np.array(self._stage.projection.centre_ned[:2])
        reach_m = _IN_SIGHT * VIEW_WIDTH / self._stage.projection.view_per_m
        is_outside = np.abs(offsets).max(axis=1) > reach_m
        first = int(np.argmax(is_outside)) if is_outside.any() else len(positions)
        return positions[: max(first, 2)]

    def _line(
        self, name: str, positions: FloatArray, colour: Colour, dash_m: float, width_px: float
    ) -> None:
        segments = ned_to_enu(dashes(positions, dash_m))
        # Of one colour for all, viser makes a darker line than of the same colour at every end.
        shades = np.broadcast_to(np.array(colour, dtype=np.uint8), segments.shape)
        self._stage.lines(name, segments, shades, width_px)
        self._lines.append(name)

    def _label(self, name: str, title: str, position: FloatArray) -> None:
        self._stage.label(name, f"what-if: {title}", ned_to_enu(position))
        self._labels.append(name)

    def _clear(self) -> None:
        for name in self._lines:
            self._stage.remove(name)
        for name in self._labels:
            self._stage.remove_label(name)
        self._lines = []
        self._labels = []


def dashes(positions: FloatArray, dash_m: float) -> FloatArray:
    """Cut a line into dashes of one length with gaps half as long; a dash follows every bend.

    Args:
        positions: Points in the order they are passed, shape ``(n, 3)``, m.
        dash_m: Length of a dash, m.

    Returns:
        Ends of the pieces that are drawn, shape ``(k, 2, 3)``; none for a line without length.
    """
    along = np.concatenate([[0.0], np.cumsum(_steps(positions))])
    period_m = 1.5 * dash_m
    starts = np.arange(0.0, along[-1], period_m)
    knots = np.unique(np.concatenate([along, starts, np.minimum(starts + dash_m, along[-1])]))
    is_drawn = (knots[:-1] + knots[1:]) / 2 % period_m < dash_m
    points = np.stack([np.interp(knots, along, positions[:, c]) for c in range(3)], axis=-1)
    return np.stack([points[:-1], points[1:]], axis=1)[is_drawn]


def _length(positions: FloatArray) -> float:
    return float(np.nansum(_steps(positions)))


def _steps(positions: FloatArray) -> FloatArray:
    return np.linalg.norm(np.diff(positions, axis=0), axis=1)
