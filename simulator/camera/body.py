"""Things in the picture: plates, hulls, wings and the board, packed for the kernels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray, IntArray
from autonomy.vehicle.hull import Hull
from autonomy.vision.calibration.board import Board
from autonomy.vision.camera import Camera
from autonomy.vision.refraction import surface_sights
from autonomy.vision.rigid import Pose
from autonomy.vision.tag import Tag
from simulator.camera import trace_kernel as kernel
from simulator.camera.pattern import BOARD_RIM_M, Print, board_print, tag_print
from simulator.camera.scene import Motion, Scene

_CHORD_M, _TAIL_HIGH_M = 0.08, 0.15
_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
_CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
_MARGIN_PX = 3.0
_BODY_REACH_M = 0.4


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """A flat rectangle, told in the axes of what carries it."""

    corner_m: FloatArray
    """Its first corner, shape ``(3,)``."""
    across_m: FloatArray
    """From there along its first row."""
    down_m: FloatArray
    """And along its first column; ``across x down`` points into it."""
    printed: Print | None = None
    plain: float = 0.0
    """Its shade where nothing is printed on it."""

    @property
    def corners_m(self) -> FloatArray:
        """Its corners, shape ``(4, 3)``."""
        return self.corner_m + _SQUARE @ np.array([self.across_m, self.down_m])


@dataclass(frozen=True, slots=True, eq=False)
class Capsule:
    """A hull: all that is nearer than a radius to a line, told in the axes of its carrier."""

    ends_m: FloatArray
    """Shape ``(2, 3)``."""
    radius_m: float
    shade: float

    @property
    def corners_m(self) -> FloatArray:
        """Corners of a box around it, shape ``(16, 3)``."""
        return (self.ends_m[:, None] + self.radius_m * _CUBE).reshape(-1, 3)


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """What moves, or stands, together."""

    panels: tuple[Panel, ...]
    capsules: tuple[Capsule, ...] = ()


def plate(tag: Tag) -> Panel:
    """Return the plate of a tag, in the axes of its carrier.

    Raises:
        CameraExtraMissingError: If OpenCV is not installed.
    """
    printed = tag_print(tag.id, tag.size_m)
    side = printed.cell_m * len(printed.cells)
    pose = tag.pose
    corner = pose.of_points(np.array([-0.5 * side, -0.5 * side, 0.0]))
    return Panel(corner, side * pose.rotation[:, 0], side * pose.rotation[:, 1], printed)


def robot_body(tags: Sequence[Tag], shade: float, hull: Hull | None = None) -> Body:
    """Return a robot with its plates: hull, two wings and a tail, all dark.

    Raises:
        CameraExtraMissingError: If OpenCV is not installed.
    """
    hull = hull or Hull()
    radius = 0.5 * max(hull.width_m, hull.height_m)
    reach = 0.5 * hull.length_m - radius
    ends = np.array([[-reach, 0.0, 0.0], [reach, 0.0, 0.0]])
    wing = 0.5 * hull.wingspan_m
    back = np.array([-_CHORD_M, 0.0, 0.0])
    tail = hull.tail_to_nose_m - hull.length_m
    root = np.array([0.5 * _CHORD_M, 0.0, 0.0])
    stern = np.array([-0.5 * hull.length_m, 0.0, -0.5 * _TAIL_HIGH_M])
    behind, high = np.array([-tail, 0.0, 0.0]), np.array([0.0, 0.0, _TAIL_HIGH_M])
    fins = (
        Panel(root, back, np.array([0.0, wing, 0.0]), plain=shade),
        Panel(root, back, np.array([0.0, -wing, 0.0]), plain=shade),
        Panel(stern, behind, high, plain=shade),
    )
    return Body((*map(plate, tags), *fins), (Capsule(ends, radius, shade),))


def board_body() -> Body:
    """Return the board for lenses, in its own axes.

    Raises:
        CameraExtraMissingError: If OpenCV is not installed.
    """
    printed = board_print()
    rows, columns = printed.cells.shape
    corner = np.array([-BOARD_RIM_M, -BOARD_RIM_M, 0.0])
    across = np.array([printed.cell_m * columns, 0.0, 0.0])
    down = np.array([0.0, printed.cell_m * rows, 0.0])
    return Body((Panel(corner, across, down, printed),))


def board_middle_m() -> FloatArray:
    """Return the middle of the board in its own axes, shape ``(3,)``, m."""
    board = Board()
    half = 0.5 * board.square_m
    return np.array([half * board.squares_across, half * board.squares_down, 0.0])


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """Bodies as one camera's picture needs them."""

    panels: FloatArray
    """At each moment of the exposure, shape ``(9, n, 17)``."""
    panel_boxes: IntArray
    """Pixels that may show each, shape ``(n, 4)``: rows from and to, columns from and to."""
    hulls: FloatArray
    """Shape ``(9, m, 9)``."""
    hull_boxes: IntArray
    """Shape ``(m, 4)``."""
    motion_px: float = 0.0
    """How far things go in the picture during the exposure, at most."""

    @property
    def boxes(self) -> IntArray:
        """All boxes, shape ``(n + m, 4)``."""
        return np.vstack([self.panel_boxes, self.hull_boxes])

    def within(self, box: IntArray) -> "Shown":
        """Return what of this may be seen within a box."""
        panels, hulls = overlaps(self.panel_boxes, box), overlaps(self.hull_boxes, box)
        return Shown(
            np.ascontiguousarray(self.panels[:, panels]),
            self.panel_boxes[panels],
            np.ascontiguousarray(self.hulls[:, hulls]),
            self.hull_boxes[hulls],
            self.motion_px,
        )

    def beside(self, other: "Shown") -> "Shown":
        """Return both."""
        return Shown(
            np.concatenate([self.panels, other.panels], axis=1),
            np.vstack([self.panel_boxes, other.panel_boxes]),
            np.concatenate([self.hulls, other.hulls], axis=1),
            np.vstack([self.hull_boxes, other.hull_boxes]),
            max(self.motion_px, other.motion_px),
        )


NOTHING = Shown(
    np.zeros((kernel.SLOTS, 0, kernel.PANEL_SIZE)),
    np.zeros((0, 4), dtype=np.int64),
    np.zeros((kernel.SLOTS, 0, kernel.HULL_SIZE)),
    np.zeros((0, 4), dtype=np.int64),
)


def overlaps(boxes: IntArray, box: IntArray) -> npt.NDArray[np.bool_]:
    """Tell which boxes share a pixel with one, shape ``(n,)``."""
    rows = (boxes[:, 0] < box[1]) & (boxes[:, 1] > box[0])
    return rows & (boxes[:, 2] < box[3]) & (boxes[:, 3] > box[2])


class Prints:
    """The patterns of all panels, one after the other, as kernels read them."""

    def __init__(self) -> None:
        self._firsts: dict[int, int] = {}
        self._kept: list[Print] = []
        self.cells: kernel.Cells = np.zeros(0, dtype=np.uint8)

    def first_cell(self, printed: Print) -> int:
        """Return where a print's cells begin; they are taken in at first sight."""
        first = self._firsts.get(id(printed))
        if first is None:
            first = self._firsts[id(printed)] = len(self.cells)
            self._kept.append(printed)
            self.cells = np.concatenate([self.cells, printed.cells.ravel()])
        return first


def shown(scene: Scene, camera: Camera, body: Body, motion: Motion, prints: Prints) -> Shown:
    """Return a body as a camera's picture needs it, in the middle of whose exposure it is there."""
    exposure = scene.sensor.exposure_s
    moves = bool(motion.velocity_ned_m_s.any() or motion.turn_rad_s.any())
    ends = (motion.pose,)
    turns, places = motion.pose.rotation[None], motion.pose.position_m[None]
    if moves:  # by so little that it is straight
        ends = (motion.after(-0.5 * exposure), motion.after(0.5 * exposure))
        share = np.linspace(0.0, 1.0, kernel.SLOTS)
        turns = _between(ends[0].rotation, ends[1].rotation, share[:, None, None])
        places = _between(ends[0].position_m, ends[1].position_m, share[:, None])
    panels = _packed_panels(body.panels, turns, places, prints, scene.level_m)
    hulls = _packed_hulls(body.capsules, turns, places, scene.level_m)
    return Shown(
        panels,
        _boxes(scene, camera, ends, [panel.corners_m for panel in body.panels]),
        hulls,
        _boxes(scene, camera, ends, [capsule.corners_m for capsule in body.capsules]),
        _motion_px(scene, camera, motion) if moves else 0.0,
    )


def _between(begin: FloatArray, end: FloatArray, share: FloatArray) -> FloatArray:
    return begin + share * (end - begin)


def _packed_panels(
    panels: Sequence[Panel], R: FloatArray, places: FloatArray, prints: Prints, level_m: float
) -> FloatArray:
    packed = np.zeros((kernel.SLOTS, len(panels), kernel.PANEL_SIZE))
    if not panels:
        return packed
    across, down = (_along(R, [p.across_m for p in panels]), _along(R, [p.down_m for p in panels]))
    corner = _along(R, [p.corner_m for p in panels]) + places[:, None]
    counts = np.array([(1, 1) if p.printed is None else p.printed.cells.shape for p in panels])
    normal = np.cross(across, down)
    packed[:, :, : kernel.ACROSS] = corner
    for first, vector, count in ((kernel.ACROSS, across, 1), (kernel.DOWN, down, 0)):
        length2 = (vector * vector).sum(axis=-1, keepdims=True)
        packed[:, :, first : first + 3] = vector / length2 * counts[:, count, None]
    packed[:, :, kernel.NORMAL : kernel.COLUMNS] = (
        normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    )  # fmt: skip
    packed[:, :, kernel.COLUMNS], packed[:, :, kernel.ROWS] = counts[:, 1], counts[:, 0]
    packed[:, :, kernel.FIRST_CELL] = [
        -1 if p.printed is None else prints.first_cell(p.printed) for p in panels
    ]
    packed[:, :, kernel.PLAIN] = [p.plain for p in panels]
    downs = corner[..., 2:] + np.stack(
        [0.0 * across[..., 2], across[..., 2], down[..., 2], across[..., 2] + down[..., 2]], axis=-1
    )
    packed[:, :, kernel.MEDIUM] = _medium(downs.min(axis=-1), downs.max(axis=-1), level_m)
    return packed


def _packed_hulls(
    capsules: Sequence[Capsule], R: FloatArray, places: FloatArray, level_m: float
) -> FloatArray:
    packed = np.zeros((kernel.SLOTS, len(capsules), kernel.HULL_SIZE))
    for i, capsule in enumerate(capsules):
        ends = _along(R, list(capsule.ends_m)) + places[:, None]
        packed[:, i, : kernel.RADIUS] = ends.reshape(-1, 6)
        packed[:, i, kernel.RADIUS] = capsule.radius_m
        packed[:, i, kernel.HULL_SHADE] = capsule.shade
        top, bottom = ends[..., 2].min(axis=-1), ends[..., 2].max(axis=-1)
        packed[:, i, kernel.HULL_MEDIUM] = _medium(
            top - capsule.radius_m, bottom + capsule.radius_m, level_m
        )
    return packed


def _medium(tops: FloatArray, bottoms: FloatArray, level_m: float) -> FloatArray:
    """Return in which media things are, by the least and the greatest depth of each."""
    either = np.where(bottoms < level_m, kernel.IN_AIR, kernel.EVERYWHERE)
    return np.where(tops > level_m, kernel.IN_WATER, either)


def _along(R: FloatArray, vectors: Sequence[FloatArray]) -> FloatArray:
    """Turn vectors of a body, ``(n, 3)``, as it is turned at each moment, to ``(9, n, 3)``."""
    return np.einsum("sij,nj->sni", R, np.array(vectors).reshape(-1, 3))


def _boxes(
    scene: Scene, camera: Camera, poses: Sequence[Pose], hullpoints: Sequence[FloatArray]
) -> IntArray:
    """Return the pixels that may show each of some convex things at either of the poses."""
    boxes = np.zeros((len(hullpoints), 4), dtype=np.int64)
    if not hullpoints:
        return boxes
    points = np.concatenate(hullpoints)
    owners = np.repeat(np.arange(len(hullpoints)), [len(one) for one in hullpoints])
    pixels = np.array([_pixels(scene, camera, pose.of_points(points)) for pose in poses])
    margin = _MARGIN_PX + _ripple_px(scene, camera)
    most = camera.lens.height_px, camera.lens.width_px
    for i in range(len(boxes)):
        own = pixels[:, owners == i].reshape(-1, 2)
        if not np.isfinite(own).all():  # part of it is behind the camera or out of the lens
            boxes[i] = 0, most[0], 0, most[1]
            continue
        low, high = own.min(axis=0) - margin, own.max(axis=0) + margin + 1.0
        boxes[i, ::2] = np.clip(np.floor(low[::-1]), 0, most)
        boxes[i, 1::2] = np.clip(np.ceil(high[::-1]), 0, most)
    return boxes


def _pixels(scene: Scene, camera: Camera, points_ned_m: FloatArray) -> FloatArray:
    ways, _ = surface_sights(camera.pose.position_m, points_ned_m, scene.level_m, scene.index)
    return camera.lens.project(ways @ camera.pose.rotation)


def _ripple_px(scene: Scene, camera: Camera) -> float:
    """Return by how much ripples move the deepest things at most."""
    depth = scene.water.depth_max_m - scene.level_m
    height = max(scene.level_m - float(camera.pose.position_m[2]), 0.1)
    tilt = 4.0 * scene.ripple_slope_rad * depth * (1.0 - 1.0 / scene.index)
    return max(camera.lens.focal_px) * tilt / height


def _motion_px(scene: Scene, camera: Camera, motion: Motion) -> float:
    """Return how far a body goes in the picture during the exposure, at most."""
    speed = float(np.linalg.norm(motion.velocity_ned_m_s))
    speed += _BODY_REACH_M * float(np.linalg.norm(motion.turn_rad_s))
    away = float(np.linalg.norm(motion.pose.position_m - camera.pose.position_m))
    focal = max(camera.lens.focal_px)
    return scene.sensor.exposure_s * speed * focal / max(away - _BODY_REACH_M, 0.1)
