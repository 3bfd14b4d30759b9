"""Where a robot that is not heard should be: dashed, with its 90 % ellipse, and with a label."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import ned_to_enu
from autonomy.planner.plan import PositionNed
from webui.scene.colour import PREDICTED
from webui.scene.comparison import dashes
from webui.scene.source import PredictedView, SceneSource
from webui.scene.stage import Stage

_WAY, _ELLIPSE, _DROP, _LABEL = (f"predicted/{part}" for part in ("way", "ellipse", "drop", "name"))
_LINE_PX = 1.8
_DASHES = 60
_ELLIPSE_DASHES = 40
_POINTS = 73


class Predicted:
    """Redraws when the source says another place."""

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._stage = stage
        self._source = source
        self._shown: PredictedView | None = None
        self.visible = True

    @property
    def has_content(self) -> bool:
        """Whether there is anything to show."""
        return self._shown is not None

    def update(self) -> None:
        """Fetch where the robot should be, and draw it if that changed."""
        view = self._source.predicted()
        if view is self._shown:
            return
        self._clear()
        self._shown = view
        if view is not None:
            self._draw(view)
        self.show(self.visible)

    def show(self, visible: bool) -> None:
        """Show or hide all of it."""
        self.visible = visible
        for name in (_WAY, _ELLIPSE, _DROP):
            self._stage.show(name, visible)
        self._stage.show_label(_LABEL, visible)

    def _draw(self, view: PredictedView) -> None:
        place = np.array(view.position_ned)
        ring = ellipse_ned(view.position_ned, view.ellipse_m, view.ellipse_rad)
        self._dashed(_WAY, view.way_ned, _DASHES)
        self._dashed(_ELLIPSE, ring, _ELLIPSE_DASHES)
        top = np.array([place[0], place[1], 0.0])
        self._dashed(_DROP, np.stack([top, place]), 6)
        self._stage.label(_LABEL, view.label, ned_to_enu(place))

    def _dashed(self, name: str, line_ned: FloatArray, count: int) -> None:
        length_m = float(np.linalg.norm(np.diff(line_ned, axis=0), axis=1).sum())
        if length_m > 0.0:
            segments = ned_to_enu(dashes(line_ned, length_m / count))
            self._stage.lines(name, segments, PREDICTED, _LINE_PX)

    def _clear(self) -> None:
        for name in (_WAY, _ELLIPSE, _DROP):
            self._stage.remove(name)
        self._stage.remove_label(_LABEL)


def ellipse_ned(place_ned: PositionNed, axes_m: tuple[float, float], turn_rad: float) -> FloatArray:
    """Return the outline of a level ellipse about a place, shape ``(n, 3)``, m.

    Args:
        place_ned: Its middle.
        axes_m: Half axes, the longer first.
        turn_rad: Direction of the longer one, from north towards east.
    """
    (long_m, short_m), turn = axes_m, turn_rad
    angle = np.linspace(0.0, 2.0 * np.pi, _POINTS)
    along, across = long_m * np.cos(angle), short_m * np.sin(angle)
    north = along * np.cos(turn) - across * np.sin(turn)
    east = along * np.sin(turn) + across * np.cos(turn)
    return np.array(place_ned) + np.stack([north, east, np.zeros(_POINTS)], axis=-1)
