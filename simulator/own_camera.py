"""A simulated robot's own camera: it says which of the tank's tags it sees, and where.

No picture is drawn. The corners come from the exact model of lens and flat port at where the robot
truly is, with noise on them (``drawn_corner``). What is hidden, blurred by motion or dark is not
told from the rest. The detector itself is not exercised here: a real camera's node runs it.

What the robot is told of lens, port, mount and tags is wrong as a laboratory's measurements are,
by errors that are drawn once; the truth stays in here.
"""

import asyncio
import json
import math
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.site import TANK, Box
from autonomy.vision.camera import Camera
from autonomy.vision.lens import Lens
from autonomy.vision.onboard.own_camera import OwnCamera, own_camera_of
from autonomy.vision.onboard.own_fix import CAMERA
from autonomy.vision.refraction import FlatPort
from autonomy.vision.rigid import Pose
from autonomy.vision.sight import sights
from autonomy.vision.tag import Layout, Tag, layout_of
from onboard.node.camera import TagView
from onboard.own_camera_file import CAMERA_FILE, TANK_FILE
from robot_link.camera.sighting import TagSeen
from robot_link.clock import Clock
from robot_link.whole_file import replace_file
from simulator.camera.laboratory import told_layout
from simulator.drawn_corner import BLUR_PX, EDGE_SHARE, drawn_corners

_FIRST_ID = 140
_SIZE_M, _FOOT_M = 0.15, 0.02
_APART_M = 0.6
_DEPTHS_M = (0.35, 0.70)
"""Of the tags on the walls, in turn."""
PERIOD_S = 0.5
"""Between two pictures: a Raspberry Pi finds tags in about two a second."""
_LATENCY_S = 0.2
"""Until the tags of a picture are found."""
_BORDER_PX = 8.0
_SURVEY_M, _SURVEY_DEG, _WINDOW_M, _INDEX = 0.002, 0.3, 0.001, 0.0005
_MARGIN = 60.0
"""Of a tag that the detector decided well."""

CAMERA_DOCUMENT: dict[str, Any] = {
    "lens": {
        "kind": "pinhole",
        "width_px": 1296,
        "height_px": 972,
        "focal_px": [745.0, 745.0],
        "principal_px": [648.5, 486.0],
        "distortion": [-0.10, 0.02, 0.0003, -0.0002, 0.0],
        "focal_std_share": 0.0004,
        "principal_std_px": 0.5,
        "measured_in": "air",
    },
    "port": {"distance_m": 0.010, "thickness_m": 0.005, "glass_index": 1.49},
    "mount": {"position_m": [0.20, 0.0, 0.04], "position_std_m": 0.003, "angle_std_deg": 1.0},
}
"""What is told of the camera of every simulated Miniglider that has one."""


def tank_layout() -> Layout:
    """Return the tags of the tank as they were measured: floor and rim, and those on the walls."""
    return Layout((*told_layout().tags, *wall_tags()))


def wall_tags(water: Box = TANK.water) -> tuple[Tag, ...]:
    """Return the tags on the walls of a tank as they were measured."""
    tags: list[Tag] = []
    north = 0.5 * (water.x_min_m + water.x_max_m)
    east = 0.5 * (water.y_min_m + water.y_max_m)
    half = 0.5 * (water.x_max_m - water.x_min_m), 0.5 * (water.y_max_m - water.y_min_m)
    for wall in range(4):
        heading = wall * 0.5 * math.pi
        away = half[wall % 2] - _FOOT_M
        along = half[(wall + 1) % 2]
        count = int(2.0 * along / _APART_M)
        for i in range(count):
            aside = _APART_M * (i - 0.5 * (count - 1))
            place = (
                north + away * math.cos(heading) - aside * math.sin(heading),
                east + away * math.sin(heading) + aside * math.cos(heading),
                _DEPTHS_M[i % 2],
            )
            tag_id = _FIRST_ID + len(tags)
            tags.append(Tag(tag_id, _SIZE_M, place, 0.0, 90.0, math.degrees(heading)))
    return tuple(tags)


def tank_document(layout: Layout) -> dict[str, Any]:
    """Return a layout as its file on a robot has it."""
    return {
        "tags": [
            {
                "id": tag.id,
                "size_m": tag.size_m,
                "position_m": list(tag.position_m),
                "roll_deg": tag.roll_deg,
                "pitch_deg": tag.pitch_deg,
                "heading_deg": tag.heading_deg,
            }
            for tag in layout.tags
        ],
        "level_m": 0.0,
        "level_std_m": 0.005,
    }


def write_files(memory: Path) -> None:
    """Put what a laboratory measured into a robot's memory, where it is not there already."""
    memory.mkdir(parents=True, exist_ok=True)
    documents = {CAMERA_FILE: CAMERA_DOCUMENT, TANK_FILE: tank_document(tank_layout())}
    for name, document in documents.items():
        if not (memory / name).exists():
            replace_file(memory / name, json.dumps(document, indent=1).encode())


@dataclass(frozen=True, slots=True, eq=False)
class TrueEye:
    """A camera and the tank's tags as they truly are."""

    lens: Lens
    port: FlatPort
    mount: Pose
    """Takes body axes into camera axes."""
    layout: Layout
    index: float

    @classmethod
    def drawn(cls, told: OwnCamera, layout: Layout, rng: np.random.Generator) -> "TrueEye":
        """Return a truth of which something is told with usual errors.

        Args:
            told: The camera, with a port.
            layout: The tags.
            rng: Draws the errors: of lens and mount what their covariances say, of the window's
                distance 1 mm, of the index 0.0005, of each tag 2 mm and 0.3 deg per axis.

        Raises:
            ValueError: If the camera has no port.
        """
        if told.port is None or told.lens_covariance is None:
            raise ValueError("a simulated camera has a port, and a lens that is not exact")
        lens = told.lens
        parameters = lens.parameters + rng.multivariate_normal(np.zeros(9), told.lens_covariance)
        off = rng.multivariate_normal(np.zeros(6), told.mount.covariance)
        distance_m = max(told.port.distance_m + float(rng.normal(0.0, _WINDOW_M)), 0.0)
        return cls(
            Lens.of_parameters(lens.kind, lens.width_px, lens.height_px, parameters),
            replace(told.port, distance_m=distance_m),
            told.mount.pose.moved(off[:3], off[3:]),
            Layout(tuple(_hung(tag, rng) for tag in layout.tags)),
            float(rng.normal(told.index, _INDEX)),
        )

    def seen(self, body: Pose, level_m: float, rng: np.random.Generator) -> list[TagSeen]:
        """Return the tags that the detector would find from where the robot is.

        Args:
            body: Takes body axes into the tank's NED.
            level_m: Down coordinate of the surface; what is above it is not seen.
            rng: Draws noise and misses.
        """
        eye = body @ self.mount.inverse
        if eye.position_m[2] <= level_m:
            return []
        camera = Camera(CAMERA, self.lens, eye, port=self.port).packed[None]
        tags = [tag for tag in self.layout.tags if tag.corners_m[:, 2].min() > level_m]
        corners_m = np.array([tag.corners_m for tag in tags])
        numbers = np.zeros(len(tags), dtype=np.int64)
        still = [Pose.identity()] * len(tags)
        exact = sights(camera, numbers, still, corners_m, level_m, self.index).pixels
        edge = EDGE_SHARE * float(rng.normal())
        found = (
            _found(tag, corners, edge, rng)
            for tag, corners in zip(tags, exact, strict=True)
            if np.isfinite(corners).all() and self.lens.shows(corners, _BORDER_PX).all()
        )
        return [tag for tag in found if tag is not None]


class SimulatedEye:
    """The camera's node sees through this (``onboard.node.camera.TagSource``).

    Args:
        body: Where the robot truly is.
        count_s: The robot's counter at the same moment.
        clock: The time that the robot lives by.
        rng: Draws errors, noise and misses.
    """

    def __init__(
        self,
        body: Callable[[], Pose],
        count_s: Callable[[], float],
        clock: Clock,
        rng: np.random.Generator,
    ) -> None:
        self._body = body
        self._count_s = count_s
        self._clock = clock
        self._rng = rng
        told = own_camera_of(CAMERA_DOCUMENT)
        self.truth = TrueEye.drawn(told, layout_of(tank_document(tank_layout())), rng)
        """Of which the robot is told something else."""

    async def views(self) -> AsyncIterator[TagView]:
        """Yield what is seen, about twice a second of the robot."""
        while True:
            count_s, seen = self._count_s(), self.truth.seen(self._body(), 0.0, self._rng)
            await asyncio.sleep(_LATENCY_S / self._clock.speed)
            yield TagView(count_s, seen)
            await asyncio.sleep((PERIOD_S - _LATENCY_S) / self._clock.speed)


def pose_of_state(state: FloatArray) -> Pose:
    """Return the pose of a body in NED from the first numbers of its state."""
    roll, pitch, heading = state[3:6].tolist()
    return Pose.of_angles(state[:3], roll, pitch, heading)


def _hung(tag: Tag, rng: np.random.Generator) -> Tag:
    """Return a tag where it truly hangs."""
    north, east, down = rng.normal(tag.position_m, _SURVEY_M).tolist()
    angles = (tag.roll_deg, tag.pitch_deg, tag.heading_deg)
    roll, pitch, heading = rng.normal(angles, _SURVEY_DEG).tolist()
    return replace(
        tag, position_m=(north, east, down), roll_deg=roll, pitch_deg=pitch, heading_deg=heading
    )


def _found(tag: Tag, corners: FloatArray, edge: float, rng: np.random.Generator) -> TagSeen | None:
    """Return a tag as the detector would tell it, or nothing where it is missed."""
    drawn = drawn_corners(corners, edge, rng)
    if drawn is None:
        return None
    (a, b), (c, d), (e, f), (g, h) = drawn[0].tolist()
    return TagSeen(tag.id, ((a, b), (c, d), (e, f), (g, h)), drawn[1], _MARGIN, 0, BLUR_PX)
