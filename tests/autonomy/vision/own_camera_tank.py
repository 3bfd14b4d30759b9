"""A wall with tags and robots that look at it with their own cameras, with stated errors."""

from dataclasses import dataclass

import numpy as np

from autonomy.vision.calibration.board import BoardView, pose_of_board
from autonomy.vision.camera import Camera
from autonomy.vision.fix import Sighting, Telemetry
from autonomy.vision.lens import Lens
from autonomy.vision.onboard.own_camera import Mount, OwnCamera
from autonomy.vision.onboard.own_fix import CAMERA
from autonomy.vision.refraction import FlatPort
from autonomy.vision.rigid import Pose
from autonomy.vision.tag import Layout, Tag
from tests.autonomy.vision.boards import BOARD, drawn_views
from tests.autonomy.vision.tank import lens_covariance, see, surveyed

LENS = Lens(
    "pinhole", 1296, 972, (745.0, 745.0), (650.0, 484.0), (-0.10, 0.02, 0.0003, -0.0002, 0.0)
)
PORT = FlatPort()
MOUNT = Mount.of_angles((0.22, 0.0, 0.01))
WALL_NORTH_M = 4.6
LAYOUT = Layout(
    tuple(
        Tag(100 + i, 0.15, (WALL_NORTH_M, east, down), pitch_deg=90.0)
        for i, (east, down) in enumerate(
            ((1.35, 0.5), (1.75, 0.6), (0.6, 0.55), (2.5, 0.5), (1.0, 0.8), (2.1, 0.85))
        )
    )
)
"""Six tags on the north wall; 100 and 101 are next to each other in the middle."""


@dataclass(frozen=True, eq=False)
class TrueEye:
    """A camera as it is, the tags as they hang, and what is told of the camera."""

    lens: Lens
    port: FlatPort
    mount: Mount
    index: float
    tags: tuple[Tag, ...]
    told: OwnCamera


def drawn_eyes(count: int, seed: int) -> list[TrueEye]:
    """Return cameras told wrong at random.

    The lens by what twenty boards leave of it, the window by 2 mm, the index by 0.0005, the tags
    by 2 mm and 0.3 deg, the mount by what its covariance says.
    """
    rng = np.random.default_rng(seed)
    covariance = lens_covariance(LENS)
    told = OwnCamera(LENS, "air", MOUNT, PORT, covariance)
    eyes: list[TrueEye] = []
    for _ in range(count):
        lens = Lens.of_parameters(
            "pinhole",
            LENS.width_px,
            LENS.height_px,
            LENS.parameters + rng.multivariate_normal(np.zeros(9), covariance),
        )
        port = FlatPort(max(PORT.distance_m + rng.normal(0.0, 0.002), 0.0))
        off = rng.multivariate_normal(np.zeros(6), MOUNT.covariance)
        mount = Mount(MOUNT.pose.moved(off[:3], off[3:]), MOUNT.covariance)
        index = float(rng.normal(1.333, 0.0005))
        tags = surveyed(LAYOUT, rng, 0.002, 0.3).tags
        eyes.append(TrueEye(lens, port, mount, index, tags, told))
    return eyes


def facing_wall(rng: np.random.Generator, distance_m: float) -> Pose:
    """Return a robot whose camera is so far from the wall, about, and sees its middle."""
    place = [
        WALL_NORTH_M - distance_m - MOUNT.position_m[0],
        1.55 + rng.normal(0.0, 0.05),
        0.55 + rng.normal(0.0, 0.03),
    ]
    roll, pitch, heading = rng.normal(0.0, np.radians([3.0, 3.0, 5.0])).tolist()
    return Pose.of_angles(place, roll, pitch, heading)


def look(
    eye: TrueEye, body: Pose, rng: np.random.Generator, ids: tuple[int, ...] | None = None
) -> list[Sighting]:
    """Return what a robot's camera sees of the wall, with noise and an edge error."""
    pose = body @ eye.mount.pose.inverse
    camera = Camera(CAMERA, eye.lens, pose, port=eye.port)
    tags = [tag for tag in eye.tags if ids is None or tag.id in ids]
    return see([camera], tags, Pose.identity(), rng, index=eye.index)


def said_by(body: Pose, rng: np.random.Generator) -> Telemetry:
    """Return what the robot's own sensors say: tilt to 0.6 deg, depth to 5 mm."""
    roll, pitch, _ = body.angles_rad
    tilt = roll + rng.normal(0.0, 0.01), pitch + rng.normal(0.0, 0.01)
    return Telemetry.of_tilt(*tilt, float(body.position_m[2] + rng.normal(0.0, 0.005)))


def wet_board_views(eye: TrueEye, count: int, seed: int) -> list[BoardView]:
    """Return boards under water at 0.4 to 1 m, as the camera sees them through its window."""
    rng = np.random.default_rng(seed)
    straight = Lens(
        "pinhole",
        LENS.width_px,
        LENS.height_px,
        (1.333 * LENS.focal_px[0], 1.333 * LENS.focal_px[1]),
        LENS.principal_px,
    )
    views: list[BoardView] = []
    points = BOARD.points_m(np.arange(70))
    for number, dry in enumerate(drawn_views(straight, count, seed, 0.0)):
        pose = _pose_of(dry, straight)
        there = pose.of_points(points)
        sights, _ = eye.port.sights(there, eye.index)
        pixels = eye.lens.project(sights)
        shown = np.isfinite(pixels).all(axis=1) & eye.lens.shows(pixels, 2.0)
        noise = rng.normal(0.0, 0.1, (int(shown.sum()), 2))
        views.append(BoardView(f"wet {number}", points[shown], pixels[shown] + noise))
    return views


def _pose_of(view: BoardView, lens: Lens) -> Pose:
    pose = pose_of_board(view, lens)
    assert pose is not None
    return pose
