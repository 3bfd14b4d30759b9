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
_NEAR = 0.6
"""What stays within this share of the view's width from its middle is seen with the water."""
_FARTHEST = 1.5
"""Tracks are framed as far from the reference's middle as this many of its lengths, or of the
distance at which they begin."""


class Comparison:
    """Redraws only when the source hands out another comparison."""

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._stage = stage
        self._source = source
        self._shown: ComparisonView | None = None
        self._lines: list[str] = []
        self._labels: list[str] = []
        self.visible = True

    def update(self) -> bool:
        """Fetch the comparison, draw it if it changed, and tell whether it did."""
        view = self._source.comparison()
        if view is self._shown:
            return False
        self._clear()
        self._shown = view
        if view is not None:
            self._draw(view)
        return True

    def extent(self) -> FloatArray | None:
        """Return the reference and what of the tracks is near it, view units; None if nothing is.

        A controller that loses its way must not make the reference a dot.
        """
        view = self._shown
        if view is None:
            return None
        reference = _known(view.reference_ned)
        points = [reference, *(_near(_known(run.position_ned), reference) for run in view.runs)]
        placed = self._stage.projection.point(np.concatenate(points), self._stage.exaggeration)
        return placed if len(placed) > 0 else None

    @property
    def leaves_water(self) -> bool:
        """Whether a camera that sees the water misses part of it."""
        points = self.extent()
        return points is not None and bool(np.abs(points).max() > _NEAR * VIEW_WIDTH)

    @property
    def has_content(self) -> bool:
        """Whether there is anything to show."""
        return bool(self._lines)

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
            known = _known(positions)
            if _length(known) <= 0.0:
                continue
            self._line(f"whatif/{place}", known, colour, longest / _DASHES, width_px)
            seen = _near(known, _known(view.reference_ned))
            self._label(f"whatif/label{place}", title, seen[round(share * (len(seen) - 1))])
        self.show(self.visible)

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


def _known(positions: FloatArray) -> FloatArray:
    return positions[np.isfinite(positions).all(axis=1)]


def _near(track: FloatArray, reference: FloatArray) -> FloatArray:
    """Return the beginning of a track, up to where it leaves the reference's surroundings."""
    if len(reference) == 0 or len(track) == 0:
        return track
    low, high = reference.min(axis=0), reference.max(axis=0)
    away_m = np.linalg.norm(track - (low + high) / 2, axis=1)
    is_far = away_m > _FARTHEST * max(float(np.linalg.norm(high - low)), float(away_m[0]), 1e-9)
    first = int(np.argmax(is_far)) if is_far.any() else len(track)
    return track[: max(first, 1)]


def _length(positions: FloatArray) -> float:
    return float(np.nansum(_steps(positions)))


def _steps(positions: FloatArray) -> FloatArray:
    return np.linalg.norm(np.diff(positions, axis=0), axis=1)
