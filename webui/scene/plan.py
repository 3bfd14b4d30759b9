"""The plan that concerns the operator: dashed, with its uncertainty, legs, rehearsal and band."""

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray, evenly_spread
from autonomy.estimation.position import STD_95
from autonomy.frames import ned_to_enu
from webui.scene.band import NODES, draw_band
from webui.scene.colour import PRIMITIVE, REHEARSED, UNCERTAINTY
from webui.scene.comparison import dashes
from webui.scene.robot import ring_enu
from webui.scene.source import PlanView, SceneSource
from webui.scene.stage import Stage

_DASH_SHARE = 0.012
"""Dash of the promised as a part of the water's longer side, so that it looks promised."""
_PLAN_PX = 1.5
"""Thinner than what was flown, whatever the state of the plan."""
_DASHES = 120
"""Dashes of a rehearsed track."""
_REHEARSED_PX = 1.4
_STRAIGHT_PX = 0.7
"""Legs as the robot gets them, beside the track that is expected of them."""
_LEGS, _STRAIGHT, _REHEARSAL = "plan/legs", "plan/straight", "plan/rehearsed"
_PROMISES = frozenset(("draft", "sent", "on_board", "running"))
"""States in which a plan is still to be flown; one that ended promises nothing."""


_CORNERS = 20
"""Corners of each ring of the hose."""
_RINGS_MAX = 160
_OPACITY = 0.13
_RING_EVERY = 8
_RING_PX = 0.8
HOSE, RINGS = "plan/uncertainty", "plan/rings"


def draw_uncertainty(stage: Stage, points: FloatArray) -> None:
    """Draw the horizontal 95 % circles of a promised track and the hose that they span.

    Args:
        stage: Where to.
        points: Time s, north, east, down m, position standard deviation m; shape ``(n, 5)``.
    """
    kept = points[evenly_spread(len(points), _RINGS_MAX)]
    vertices, faces = hose(kept[:, 1:4], STD_95 * kept[:, 4])
    stage.mesh(HOSE, ned_to_enu(vertices), faces, UNCERTAINTY, _OPACITY)
    rings = [ring_enu(point[1:4], STD_95 * point[4]) for point in kept[::_RING_EVERY]]
    stage.lines(RINGS, np.concatenate(rings), UNCERTAINTY, _RING_PX)


def hose(centres_ned: FloatArray, radii_m: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Span a surface over horizontal circles.

    Args:
        centres_ned: Shape ``(n, 3)``, m.
        radii_m: Shape ``(n,)``, m.

    Returns:
        Vertices, shape ``(n * corners, 3)``, m, and triangles between them, shape ``(f, 3)``.
    """
    angle = np.linspace(0.0, 2 * np.pi, _CORNERS, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    vertices = centres_ned[:, None, :] + radii_m[:, None, None] * circle
    here = np.arange((len(centres_ned) - 1) * _CORNERS).reshape(-1, _CORNERS)
    beside = np.roll(here, -1, axis=1)
    near = np.stack([here, beside, here + _CORNERS], axis=-1)
    far = np.stack([beside, beside + _CORNERS, here + _CORNERS], axis=-1)
    return vertices.reshape(-1, 3), np.concatenate([near, far], axis=1).reshape(-1, 3)


class PlannedTrajectory:
    """Redraws only when the source hands out another plan."""

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._source = source
        self._stage = stage
        self._shown: PlanView | None = None
        self.legs = Part(stage, (_LEGS, _STRAIGHT))
        self.uncertainty = Part(stage, (HOSE, RINGS))
        self.rehearsal = Part(stage, (_REHEARSAL,))
        self.band = Part(stage, NODES)

    def update(self) -> None:
        """Fetch the plan and draw it if it changed."""
        plan = self._source.plan()
        if plan is self._shown:
            return
        self._shown = plan
        for part in (self.legs, self.uncertainty, self.rehearsal, self.band):
            part.clear()
        if plan is not None and len(plan.points) > 1 and plan.state in _PROMISES:
            self._draw(plan)

    def _draw(self, plan: PlanView) -> None:
        water = self._source.site.water
        longer_m = max(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m)
        segments, colours = _segments(plan, _DASH_SHARE * longer_m)
        if len(segments) > 0:
            self._stage.lines(_LEGS, segments, colours, _PLAN_PX)
            self.legs.is_drawn()
        if plan.straight_ned is not None:
            self._draw_straight(plan.straight_ned)
        draw_uncertainty(self._stage, plan.points)
        self.uncertainty.is_drawn()
        if plan.rehearsed_ned is not None and len(plan.rehearsed_ned) > 1:
            self._draw_rehearsal(plan.rehearsed_ned)
        if plan.band is not None:
            draw_band(self._stage, plan.band)
            self.band.is_drawn()

    def _draw_straight(self, legs_ned: FloatArray) -> None:
        segments = ned_to_enu(np.stack([legs_ned[:-1], legs_ned[1:]], axis=1))
        shades = np.broadcast_to(np.array(REHEARSED, dtype=np.uint8), segments.shape)
        self._stage.lines(_STRAIGHT, segments, shades, _STRAIGHT_PX)
        self.legs.is_drawn()

    def _draw_rehearsal(self, track_ned: FloatArray) -> None:
        length = float(np.linalg.norm(np.diff(track_ned, axis=0), axis=1).sum())
        segments = ned_to_enu(dashes(track_ned, length / _DASHES))
        shades = np.broadcast_to(np.array(REHEARSED, dtype=np.uint8), segments.shape)
        self._stage.lines(_REHEARSAL, segments, shades, _REHEARSED_PX)
        self.rehearsal.is_drawn()


class Part:
    """A layer of the plan: the nodes of these names, shown or hidden together."""

    def __init__(self, stage: Stage, names: tuple[str, ...]) -> None:
        self._stage = stage
        self._names = names
        self.visible = True
        self.has_content = False
        """Whether it is drawn now."""

    def is_drawn(self) -> None:
        """Note that its nodes are there."""
        self.has_content = True
        self.show(self.visible)

    def clear(self) -> None:
        """Take its nodes away."""
        self.has_content = False
        for name in self._names:
            self._stage.remove(name)

    def show(self, visible: bool) -> None:
        """Show or hide it."""
        self.visible = visible
        for name in self._names:
            self._stage.show(name, visible)


def _segments(plan: PlanView, dash_m: float) -> tuple[FloatArray, np.ndarray]:
    """Cut the promised points into dashes and colour each by its leg's primitive.

    Args:
        plan: With at least two points.
        dash_m: Length of a dash, m.

    Returns:
        Segments in ENU metres, shape ``(n, 2, 3)``, and their colours, same shape.
    """
    ends = np.cumsum([leg.duration_s for leg in plan.legs])
    kinds = [leg.kind.value for leg in plan.legs]
    pieces: list[FloatArray] = []
    shades: list[np.ndarray] = []
    leg_of = np.searchsorted(ends, plan.points[:-1, 0], side="right")
    for leg in range(len(kinds)):
        within = np.flatnonzero(np.minimum(leg_of, len(kinds) - 1) == leg)
        if len(within) == 0:
            continue
        colour = np.array(PRIMITIVE[kinds[leg]], dtype=np.uint8)
        if plan.leg_now is not None and leg < plan.leg_now:
            colour = (colour * 0.45).astype(np.uint8)
        drawn = dashes(plan.points[within[0] : within[-1] + 2, 1:4], dash_m)
        pieces.append(ned_to_enu(drawn))
        shades.append(np.broadcast_to(colour, drawn.shape))
    return np.concatenate(pieces), np.concatenate(shades)
