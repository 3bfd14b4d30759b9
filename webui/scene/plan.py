"""The plan that concerns the operator: dashed, coloured by primitive, with its uncertainty."""

import numpy as np
import viser

from autonomy.arrays import FloatArray
from autonomy.frames import ned_to_enu
from webui.scene.colour import PRIMITIVE, UNCERTAINTY
from webui.scene.robot import STD_95, ring_enu
from webui.scene.source import PlanView, SceneSource
from webui.scene.stage import Stage

_DASH_S = 2
"""Every second piece between points is drawn, so that the promised looks promised."""
_RING_EVERY = 12
_PROMISES = frozenset(("draft", "sent", "on_board", "running"))
"""States in which a plan is still to be flown; one that ended promises nothing."""


class PlannedTrajectory:
    """Redraws only when the source hands out another plan."""

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._stage = stage
        self._source = source
        self._shown: PlanView | None = None
        self._nodes: list[viser.LineSegmentsHandle] = []
        self.visible = True

    def update(self) -> None:
        """Fetch the plan and draw it if it changed."""
        plan = self._source.plan()
        if plan is self._shown:
            return
        self._clear()
        self._shown = plan
        if plan is not None and len(plan.points) > 1 and plan.state in _PROMISES:
            self._draw(plan)

    def show(self, visible: bool) -> None:
        """Show or hide the plan."""
        self.visible = visible
        for node in self._nodes:
            node.visible = visible

    def _draw(self, plan: PlanView) -> None:
        points, colours = _segments(plan)
        width_px = 2.0 if plan.state == "running" else 3.0
        rings = [ring_enu(point[1:4], STD_95 * point[4]) for point in plan.points[::_RING_EVERY]]
        self._nodes = [
            self._stage.lines("plan/legs", points, colours, width_px),
            self._stage.lines("plan/uncertainty", np.concatenate(rings), UNCERTAINTY, 0.7),
        ]
        self.show(self.visible)

    def _clear(self) -> None:
        for name in ("plan/legs", "plan/uncertainty"):
            self._stage.remove(name)
        self._nodes = []


def _segments(plan: PlanView) -> tuple[FloatArray, np.ndarray]:
    """Cut the promised points into dashes and colour each by its leg's primitive.

    Returns:
        Segments in ENU metres, shape ``(n, 2, 3)``, and their colours, same shape.
    """
    ends = np.cumsum([leg.duration_s for leg in plan.legs])
    kinds = [leg.kind.value for leg in plan.legs]
    track = _refined(plan.points)
    leg_of = np.minimum(np.searchsorted(ends, track[:-1, 0], side="right"), len(kinds) - 1)
    colours = np.array([PRIMITIVE[kinds[leg]] for leg in leg_of], dtype=np.uint8)
    if plan.leg_now is not None:
        faded = leg_of < plan.leg_now
        colours[faded] = (colours[faded] * 0.45).astype(np.uint8)
    positions = ned_to_enu(track[:, 1:4])
    segments = np.stack([positions[:-1], positions[1:]], axis=1)[::_DASH_S]
    return segments, np.stack([colours, colours], axis=1)[::_DASH_S]


def _refined(points: FloatArray, parts: int = 4) -> FloatArray:
    """Interpolate between points, so that dashes are short; shape ``(m, 5)``."""
    at = np.arange(len(points))
    fine = np.linspace(0, len(points) - 1, (len(points) - 1) * parts + 1)
    return np.stack([np.interp(fine, at, points[:, c]) for c in range(points.shape[1])], axis=-1)
