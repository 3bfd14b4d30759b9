"""The robot itself: hull, wings and tail at its newest pose, and how well that pose is known."""

import numpy as np
import viser

from autonomy.estimation.position import STD_95
from autonomy.frames import ned_to_enu, quaternion_enu_from_body
from autonomy.vehicle.hull import Hull
from webui.scene.colour import ROBOT, ROBOT_OLD, UNCERTAINTY, Colour
from webui.scene.projection import VIEW_WIDTH, Projection
from webui.scene.source import Pose

_SHORTEST = 0.055 * VIEW_WIDTH
"""A robot is never drawn shorter than this, whatever its size in the water."""
_THINNEST = 0.006 * VIEW_WIDTH


class RobotModel:
    """A small glider of plain shapes; positions are set, nothing is rebuilt."""

    def __init__(self, scene: viser.SceneApi, projection: Projection, hull: Hull) -> None:
        self._projection = projection
        drawn = max(hull.tail_to_nose_m * projection.view_per_m, _SHORTEST)
        scale = drawn / hull.tail_to_nose_m
        self._body = scene.add_frame("/robot", show_axes=False, visible=False)
        self._parts = _parts(scene, hull, scale)
        self._tail = scene.add_frame(
            "/robot/tail", show_axes=False, position=(_stern(hull) * scale, 0.0, 0.0)
        )
        self._parts.append(_plate(scene, "/robot/tail/fin", _tail_fin(hull, scale), ROBOT))
        self._ellipsoid = scene.add_icosphere(
            "/uncertainty", radius=1.0, color=UNCERTAINTY, opacity=0.22, visible=False,
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        self._drop = scene.add_line_segments(
            "/drop", np.zeros((1, 2, 3), np.float32), colors=UNCERTAINTY, thickness=1.0,
            thickness_units="screen", visible=False,
        )  # fmt: skip
        self._scene = scene
        self._shown: tuple[Pose, float] | None = None
        self._is_old = False

    def show(self, pose: Pose | None, exaggeration: float) -> None:
        """Move to a pose, or show nothing; does nothing when it is the one already shown."""
        if pose is None:
            self._hide()
            return
        if self._shown == (pose, exaggeration):
            return
        self._shown = (pose, exaggeration)
        position_ned = np.array(pose.position_ned)
        position = self._projection.point(position_ned, exaggeration)
        self._body.position = tuple(position)
        self._body.wxyz = quaternion_enu_from_body(pose.roll_rad, pose.pitch_rad, pose.heading_rad)
        self._tail.wxyz = (np.cos(pose.tail_rad / 2), 0.0, 0.0, np.sin(pose.tail_rad / 2))
        self._body.visible = True
        self._show_uncertainty(pose, position)
        self._show_drop(position_ned, exaggeration)
        if pose.is_old != self._is_old:
            self._is_old = pose.is_old
            for part in self._parts:
                part.color = ROBOT_OLD if pose.is_old else ROBOT

    def _hide(self) -> None:
        if self._shown is not None:
            self._shown = None
            for part in (self._body, self._ellipsoid, self._drop):
                part.visible = False

    def _show_uncertainty(self, pose: Pose, position: np.ndarray) -> None:
        """Draw the 95 % circle as a flat body; its height means nothing, depth is measured."""
        semi_axis = STD_95 * pose.position_std_m * self._projection.view_per_m
        self._ellipsoid.position = tuple(position)
        self._ellipsoid.scale = (semi_axis, semi_axis, max(0.25 * semi_axis, _THINNEST))
        self._ellipsoid.visible = semi_axis > 0.0

    def _show_drop(self, position_ned: np.ndarray, exaggeration: float) -> None:
        """Draw the line from the robot up to the surface, which makes depth readable."""
        above = np.array([position_ned[0], position_ned[1], 0.0])
        ends = [self._projection.point(end, exaggeration) for end in (position_ned, above)]
        self._drop.points = np.array([ends], dtype=np.float32)
        self._drop.visible = position_ned[2] * self._projection.view_per_m > _THINNEST / 4


def _stern(hull: Hull) -> float:
    """Return where the hull ends and the tail begins, m; the middle of the whole is 0."""
    return hull.tail_to_nose_m / 2 - hull.length_m


def _parts(
    scene: viser.SceneApi, hull: Hull, scale: float
) -> list[viser.IcosphereHandle | viser.MeshHandle]:
    """Draw hull and wings in the body frame (x forward, y starboard, z down)."""
    length, width, height = (scale * size for size in (hull.length_m, hull.width_m, hull.height_m))
    middle = scale * (_stern(hull) + hull.length_m / 2)
    body = scene.add_icosphere(
        "/robot/hull", radius=1.0, color=ROBOT, scale=(length / 2, width / 2, height / 2),
        position=(middle, 0.0, 0.0), cast_shadow=False, receive_shadow=False,
    )  # fmt: skip
    chord, span = 0.28 * length, scale * hull.wingspan_m
    root, tip = middle + 0.5 * chord, middle - 0.3 * chord
    wing = np.array(
        [
            [root, 0.3 * width, 0.0], [root - chord, 0.3 * width, 0.0],
            [tip - 0.5 * chord, span / 2, 0.0], [tip, span / 2, 0.0],
        ]
    )  # fmt: skip
    port = wing * np.array([1.0, -1.0, 1.0])
    return [
        body,
        _plate(scene, "/robot/starboard_wing", wing, ROBOT),
        _plate(scene, "/robot/port_wing", port, ROBOT),
    ]


def _tail_fin(hull: Hull, scale: float) -> np.ndarray:
    """Return the tail in the frame of its own joint, from the hull to the tip."""
    end = scale * (hull.tail_to_nose_m - hull.length_m)
    near, far = 0.12 * scale * hull.height_m, 0.7 * scale * hull.height_m
    start = 0.25 * end
    return np.array([[start, 0.0, -near], [-end, 0.0, -far], [-end, 0.0, far], [start, 0.0, near]])


def _plate(
    scene: viser.SceneApi, name: str, corners: np.ndarray, colour: Colour
) -> viser.MeshHandle:
    return scene.add_mesh_simple(
        name, corners.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]]), color=colour,
        side="double", flat_shading=True, cast_shadow=False, receive_shadow=False,
    )  # fmt: skip


def ring_enu(centre_ned: np.ndarray, radius_m: float, points: int = 48) -> np.ndarray:
    """Return a horizontal circle in ENU metres, shape ``(points, 2, 3)`` as segments."""
    angle = np.linspace(0.0, 2 * np.pi, points + 1)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1) * radius_m
    ring = ned_to_enu(centre_ned + circle)
    return np.stack([ring[:-1], ring[1:]], axis=1)
