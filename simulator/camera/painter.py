"""Draws the pictures of one camera: still things once, what moves in every picture."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.vision.camera import Camera
from autonomy.vision.rigid import Pose
from simulator.camera import trace_kernel as kernel
from simulator.camera.body import (
    NOTHING,
    Body,
    Prints,
    Shown,
    board_body,
    overlaps,
    plate,
    robot_body,
    shown,
)
from simulator.camera.caustics import caustic_net
from simulator.camera.scene import Motion, Scene

_NOISES = 1 << 18
_GREYS = 1 << 14
_NET_WAYS = np.array([[1.0, 0.3], [-0.6, -0.8]])
"""Directions in which the two layers of the caustic net move."""


@dataclass(slots=True, eq=False)
class _Film:
    """Light of a whole picture in parts, as ``trace_kernel`` writes it."""

    base: kernel.Light
    swing: kernel.Light
    place: kernel.Places

    @classmethod
    def blank(cls, rows: int, columns: int) -> "_Film":
        light = np.zeros((rows, columns), dtype=np.float32)
        return cls(light, light.copy(), np.zeros((rows, columns), dtype=np.int32))

    def copy(self) -> "_Film":
        return _Film(self.base.copy(), self.swing.copy(), self.place.copy())

    def part(self, box: IntArray) -> "_Film":
        """Return a rectangle, which is the film's own."""
        rows, columns = slice(box[0], box[1]), slice(box[2], box[3])
        return _Film(self.base[rows, columns], self.swing[rows, columns], self.place[rows, columns])

    def put(self, box: IntArray, other: "_Film") -> None:
        """Take a rectangle over from another film."""
        own, new = self.part(box), other.part(box)
        own.base[:], own.swing[:], own.place[:] = new.base, new.swing, new.place


class Painter:
    """Draws what one camera of a scene sees. Belongs to one thread at a time.

    Args:
        scene: What there is; a change of it needs a new painter.
        camera: One of the scene's.

    Raises:
        CameraExtraMissingError: If OpenCV is not installed.
    """

    def __init__(self, scene: Scene, camera: Camera) -> None:
        self.scene = scene
        self.camera = camera
        self._size = rows, columns = camera.lens.height_px, camera.lens.width_px
        self._world = scene.world
        self._rng = np.random.default_rng([scene.seed, *camera.name.encode()])
        self._noise = self._rng.standard_normal(_NOISES, dtype=np.float32)
        self._greys = _curve(scene.sensor.gamma)
        self._net = caustic_net(scene.seed) * np.float32(scene.lighting.caustics_std / np.sqrt(2.0))
        self._weights = _gaussian(scene.sensor.blur_px)
        self._prints = Prints()
        self._bodies = {
            bundle.robot: robot_body(bundle.tags, scene.shades.hull) for bundle in scene.bundles
        }
        self._board = board_body()
        self._rays = _rays(camera)
        fixed = Body(tuple(plate(tag) for tag in scene.layout.tags))
        self._fixed = shown(scene, camera, fixed, Motion(Pose.identity()), self._prints)
        wet = [tag.corners_m[:, 2].max() > scene.level_m for tag in scene.layout.tags]
        self._wet_boxes = self._fixed.panel_boxes[np.array(wet, dtype=np.bool_)]
        self._sharp = self._traced(np.array([0, rows, 0, columns]), self._fixed, None)
        self._still = self._sharp.copy()
        self._blurred_into(self._sharp, np.array([0, rows, 0, columns]), self._still)
        self._film = self._still.copy()
        self._dirty: list[IntArray] = []

    def picture(
        self,
        time_s: float,
        robots: Mapping[str, Motion] | None = None,
        board: Pose | None = None,
    ) -> kernel.Cells:
        """Draw a picture.

        Args:
            time_s: Middle of the exposure; moves caustics and ripples.
            robots: Robots of the scene's bundles that are there then, by name; others, and robots
                without a bundle, are not drawn.
            board: Takes the axes of a board that is held before the camera into the camera's.

        Returns:
            Grey values, shape ``(rows, columns)``.
        """
        for box in self._dirty:
            self._film.put(box, self._still)
        waves = self.scene.waves(time_s)
        moving = self._moving(robots or {}, board)
        everything = self._fixed.beside(moving)
        boxes = list(moving.boxes) + (list(self._wet_boxes) if len(waves) else [])
        self._dirty = [_grown(box, len(self._weights), self._size) for box in _joined(boxes)]
        for box in self._dirty:
            wide = _grown(box, len(self._weights), self._size)
            traced = self._traced(wide, everything.within(wide), waves)
            self._blurred_into(traced, wide, self._film, box)
        return self._developed(time_s)

    def jpeg(self, picture: kernel.Cells) -> bytes:
        """Return a picture as a JPEG file."""
        import cv2

        quality = [cv2.IMWRITE_JPEG_QUALITY, self.scene.sensor.jpeg_quality]
        is_done, encoded = cv2.imencode(".jpg", picture, quality)
        if not is_done:
            raise RuntimeError("OpenCV wrote no JPEG")
        return encoded.tobytes()

    def _moving(self, robots: Mapping[str, Motion], board: Pose | None) -> Shown:
        moving = NOTHING
        for name, motion in robots.items():
            if name in self._bodies:
                body = self._bodies[name]
                moving = moving.beside(shown(self.scene, self.camera, body, motion, self._prints))
        if board is not None:
            held = Motion(self.camera.pose @ board)
            moving = moving.beside(shown(self.scene, self.camera, self._board, held, self._prints))
        return moving

    def _traced(self, box: IntArray, things: Shown, waves: FloatArray | None) -> _Film:
        """Trace a rectangle under some waves, where it shows things; all of it if none are told."""
        rows, columns = int(box[1] - box[0]), int(box[3] - box[2])
        is_still = waves is not None
        film = self._sharp.part(box).copy() if is_still else _Film.blank(rows, columns)
        kernel.trace(
            box[::2].copy(),
            self._rays,
            self.camera.pose.position_m,
            self._world,
            np.zeros((0, 5)) if waves is None else waves,
            things.panels,
            things.panel_boxes,
            things.hulls,
            things.hull_boxes,
            self._prints.cells,
            max(math.ceil(0.5 + 0.5 * things.motion_px), 1),
            is_still,
            film.base,
            film.swing,
            film.place,
        )
        return film

    def _blurred_into(
        self, traced: _Film, wide: IntArray, film: _Film, box: IntArray | None = None
    ) -> None:
        box = wide if box is None else box
        top, left = int(box[0] - wide[0]), int(box[2] - wide[2])
        into, scratch = film.part(box), np.empty_like(traced.base)
        kernel.blur(traced.base, self._weights, top, left, scratch, into.base)
        kernel.blur(traced.swing, self._weights, top, left, scratch, into.swing)
        into.place[:] = traced.place[top : top + len(into.place), left : left + into.place.shape[1]]

    def _developed(self, time_s: float) -> kernel.Cells:
        scene, (rows, columns) = self.scene, self._size
        way = scene.lighting.caustics_m_s * time_s * kernel.TILE / kernel.TILE_M
        shifts = np.floor(way * _NET_WAYS).astype(np.int64) % kernel.TILE
        starts = self._rng.integers(0, _NOISES - columns, rows)
        picture = np.empty((rows, columns), dtype=np.uint8)
        kernel.develop(
            self._film.base,
            self._film.swing,
            self._film.place,
            self._net,
            shifts,
            scene.lighting.brightness,
            self._noise,
            starts,
            scene.sensor.shot_variance,
            scene.sensor.read_std,
            self._greys,
            picture,
        )
        return picture


def _rays(camera: Camera) -> kernel.Light:
    """Return the rays of all pixels in NED, and of one more on each side of the picture."""
    rows, columns = camera.lens.height_px, camera.lens.width_px
    v, u = np.mgrid[-1 : rows + 1, -1 : columns + 1].astype(np.float64)
    rays = camera.lens.rays(np.stack([u, v], axis=-1))
    return np.nan_to_num(rays @ camera.pose.rotation.T).astype(np.float32)


def _curve(gamma: float) -> kernel.Cells:
    light = np.arange(_GREYS + 1) / _GREYS
    return np.round(255.0 * light ** (1.0 / gamma)).astype(np.uint8)


def _gaussian(std_px: float) -> kernel.Light:
    """Return the weights of a blur: of the middle and of one side."""
    reach = int(np.ceil(3.0 * std_px))
    offsets = np.arange(reach + 1)
    weights = np.exp(-0.5 * (offsets / max(std_px, 1e-6)) ** 2)
    return (weights / (weights[0] + 2.0 * weights[1:].sum())).astype(np.float32)


def _grown(box: IntArray, by: int, size: tuple[int, int]) -> IntArray:
    grown = box + np.array([-by, by, -by, by])
    return np.clip(grown, 0, [size[0], size[0], size[1], size[1]])


def _joined(boxes: Sequence[IntArray]) -> list[IntArray]:
    """Return boxes none of which overlaps another, that together hold all of the given ones."""
    apart: list[IntArray] = []
    for box in boxes:
        if box[0] >= box[1] or box[2] >= box[3]:
            continue
        grown = box.copy()
        while True:
            touching = overlaps(np.array(apart).reshape(-1, 4), grown)
            if not touching.any():
                break
            both = np.array([grown, *(apart[i] for i in np.flatnonzero(touching))])
            grown[::2], grown[1::2] = both[:, ::2].min(axis=0), both[:, 1::2].max(axis=0)
            apart = [one for one, touches in zip(apart, touching, strict=True) if not touches]
        apart.append(grown)
    return apart
