"""The target that a robot follows: estimates with their ellipses, newest range, line of sight."""

import math

import numpy as np
import viser

from autonomy.arrays import FloatArray
from autonomy.estimation.position import STD_95
from autonomy.frames import ned_to_enu
from autonomy.planner.plan import PositionNed
from webui.scene.colour import TARGET, TARGET_OLD, TARGET_TRUE, Colour, linear
from webui.scene.comparison import dashes
from webui.scene.projection import VIEW_WIDTH
from webui.scene.robot import ring_enu
from webui.scene.source import SceneSource, TargetHypothesis, TargetView
from webui.scene.stage import Stage

_HYPOTHESES = 2
_MARK = 0.011 * VIEW_WIDTH
"""Radius of the mark of an estimate that is certain; one that is not is smaller."""
_THINNEST = 0.004 * VIEW_WIDTH
_LONGEST = 2.0 * VIEW_WIDTH
"""An ellipse is drawn no larger: one that diverged fills the view all the same."""
_PATH = "target/path"
_DASHES = 90
TEACHING = "teaching: barrier off"
"""Label of a target that the robot does nothing to keep observable."""
_LINE_PX = 1.4
_CROSS = np.array([[[-1, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]], [[0, 0, -1], [0, 0, 1]]])
"""Mark of a true place: another shape than that of an estimate."""


class Target:
    """Nodes are made once and moved; a source that is polled at 10 Hz costs no new geometry."""

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._stage = stage
        self._source = source
        self._estimates = [_Estimate(stage, number) for number in range(_HYPOTHESES)]
        self._true = _line(stage.scene, "/target/true", _CROSS, TARGET_TRUE)
        self._ring = _line(stage.scene, "/target/range", ring_enu(np.zeros(3), 1.0))
        self._sight = _line(stage.scene, "/target/sight", np.zeros((1, 2, 3)))
        self._teaching = stage.scene.add_label(
            "/target/teaching", TEACHING, visible=False, font_screen_scale=0.8,
            anchor="bottom-center",
        )  # fmt: skip
        self._shown: tuple[TargetView | None, float] | None = None
        self._path: FloatArray | None = None
        self._is_old = False
        self.visible = True

    @property
    def has_content(self) -> bool:
        """Whether there is anything to show."""
        return self._path is not None or (self._shown is not None and self._shown[0] is not None)

    @property
    def legend(self) -> str:
        """Say what the marks that are drawn mean; "" where none is."""
        view = None if self._shown is None or not self.visible else self._shown[0]
        marks = [] if view is None else _marks(view)
        if self._path is not None and self.visible:
            marks.append("dashed line: where the virtual target goes")
        if not marks:
            return ""
        text = "; ".join(marks)
        taught = "" if view is None or view.is_barrier_on else " Teaching: the barrier is off."
        return f"Target. {text[0].upper()}{text[1:]}.{taught}"

    def update(self) -> None:
        """Fetch the target and move what changed."""
        path = self._source.target_path()
        if path is not self._path:
            self._draw_path(path)
        view, exaggeration = self._source.target(), self._stage.exaggeration
        if self._shown is None or self._shown[0] is not view or self._shown[1] != exaggeration:
            self._shown = (view, exaggeration)
            self._place()

    def show(self, visible: bool) -> None:
        """Show or hide all of it."""
        self.visible = visible
        self._stage.show(_PATH, visible)
        self._place()

    def _place(self) -> None:
        view = None if self._shown is None or not self.visible else self._shown[0]
        hypotheses = () if view is None else view.hypotheses
        for number, estimate in enumerate(self._estimates):
            estimate.place(hypotheses[number] if number < len(hypotheses) else None)
        self._true.visible = view is not None and view.true_ned is not None
        self._sight.visible = bool(hypotheses)
        self._ring.visible = view is not None and view.range_m is not None
        self._teaching.visible = view is not None and not view.is_barrier_on
        if view is None:
            return
        self._colour(is_old=view.is_old)
        if view.true_ned is not None:
            self._true.position = self._point(view.true_ned)
            self._true.scale = 1.3 * _MARK
        believed_ned = hypotheses[0].position_ned if hypotheses else view.robot_ned
        east, north, up = self._point(believed_ned)
        self._teaching.position = (east, north, up + 2.0 * _MARK)
        if hypotheses:
            ends = [self._point(end) for end in (view.robot_ned, hypotheses[0].position_ned)]
            self._sight.points = np.array([ends], dtype=np.float32)
        if view.range_m is not None:
            radius = min(view.range_m * self._stage.projection.view_per_m, _LONGEST)
            self._ring.position = self._point(view.robot_ned)
            self._ring.scale = (radius, radius, 1.0)

    def _colour(self, *, is_old: bool) -> None:
        if is_old == self._is_old:
            return
        self._is_old = is_old
        colour = TARGET_OLD if is_old else TARGET
        for estimate in self._estimates:
            estimate.colour(colour)
        for line in (self._ring, self._sight):
            _recolour(line, colour)

    def _draw_path(self, path_ned: FloatArray | None) -> None:
        self._path = path_ned
        self._stage.remove(_PATH)
        if path_ned is None:
            return
        length = float(np.linalg.norm(np.diff(path_ned, axis=0), axis=1).sum())
        if length > 0.0:
            segments = ned_to_enu(dashes(path_ned, length / _DASHES))
            self._stage.lines(_PATH, segments, TARGET_TRUE, 1.0)
            self._stage.show(_PATH, self.visible)

    def _point(self, position_ned: PositionNed) -> tuple[float, float, float]:
        return _view_point(self._stage, position_ned)


class _Estimate:
    """One hypothesis: a mark, and the 95 % ellipse around it as a flat body with its outline."""

    def __init__(self, stage: Stage, number: int) -> None:
        self._stage = stage
        self.mark = _ball(stage.scene, f"/target/estimate{number}", TARGET, None)
        self.ellipse = _ball(stage.scene, f"/target/ellipse{number}", TARGET, 0.2)
        self.outline = _line(stage.scene, f"/target/outline{number}", ring_enu(np.zeros(3), 1.0))

    def place(self, hypothesis: TargetHypothesis | None) -> None:
        """Move to a hypothesis; ``None`` hides it."""
        for node in (self.mark, self.ellipse, self.outline):
            node.visible = hypothesis is not None
        if hypothesis is None:
            return
        position = _view_point(self._stage, hypothesis.position_ned)
        major_m, minor_m, angle = semi_axes(hypothesis.covariance_m2)
        view_per_m = self._stage.projection.view_per_m
        long, short = (
            min(max(axis_m * view_per_m, _THINNEST), _LONGEST) for axis_m in (major_m, minor_m)
        )
        for node in (self.mark, self.ellipse, self.outline):
            node.position = position
        self.mark.scale = _MARK * (0.5 + 0.5 * hypothesis.weight)
        for node in (self.ellipse, self.outline):
            node.scale = (long, short, _THINNEST)
            node.wxyz = (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))

    def colour(self, colour: Colour) -> None:
        """Take another colour."""
        self.mark.color = self.ellipse.color = _lit(colour)
        _recolour(self.outline, colour)


def _marks(view: TargetView) -> list[str]:
    """Return what each kind of mark that is drawn of a target means."""
    colour = "grey" if view.is_old else "orange"
    marks: list[str] = []
    if view.hypotheses:
        marks.append(f"{colour} dot in its ellipse: where the robot believes it, with 95 %")
    if len(view.hypotheses) > 1:
        marks.append("smaller dot: second hypothesis, often the mirror image")
    if view.range_m is not None:
        marks.append("ring around the robot: newest range")
    if view.true_ned is not None:
        marks.append("white cross: true place of the virtual target")
    return marks


def semi_axes(covariance_m2: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the 95 % ellipse of a horizontal covariance (north-north, north-east, east-east).

    Returns:
        Longer and shorter semi-axis, m, and the angle of the longer one from east towards north,
        rad.
    """
    nn, ne, ee = covariance_m2
    middle, spread = 0.5 * (nn + ee), math.hypot(0.5 * (nn - ee), ne)
    angle = 0.5 * math.atan2(2.0 * ne, ee - nn)
    major_m, minor_m = (
        STD_95 * math.sqrt(max(variance, 0.0)) for variance in (middle + spread, middle - spread)
    )
    return major_m, minor_m, angle


def _view_point(stage: Stage, position_ned: PositionNed) -> tuple[float, float, float]:
    east, north, up = stage.projection.point(np.array(position_ned), stage.exaggeration).tolist()
    return east, north, up


def _ball(
    scene: viser.SceneApi, name: str, colour: Colour, opacity: float | None
) -> viser.IcosphereHandle:
    return scene.add_icosphere(
        name, radius=1.0, color=_lit(colour), opacity=opacity, visible=False, cast_shadow=False,
        receive_shadow=False,
    )  # fmt: skip


def _line(
    scene: viser.SceneApi, name: str, segments: np.ndarray, colour: Colour = TARGET
) -> viser.LineSegmentsHandle:
    return scene.add_line_segments(
        name, segments.astype(np.float32), colors=linear(colour), thickness=_LINE_PX,
        thickness_units="screen", visible=False,
    )  # fmt: skip


def _recolour(line: viser.LineSegmentsHandle, colour: Colour) -> None:
    line.colors = linear(np.broadcast_to(colour, line.points.shape))


def _lit(colour: Colour) -> Colour:
    """Return the colour of a body that the scene's lights bring up to ``colour``."""
    red, green, blue = linear(colour).tolist()
    return red, green, blue
