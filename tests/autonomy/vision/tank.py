"""The thesis's tank with three overhead cameras, and what they see, with stated noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.calibration.lens_fit import LensCalibration, calibrate_lens
from autonomy.vision.camera import Camera
from autonomy.vision.constants import CAMERA_ERRORS
from autonomy.vision.corner import area_px2, corner_sigma_px
from autonomy.vision.fix import Sighting
from autonomy.vision.lens import Lens
from autonomy.vision.rigid import Pose
from autonomy.vision.sight import sights
from autonomy.vision.tag import Bundle, Layout, Tag
from tests.autonomy.vision.boards import drawn_views

LENGTH_M, WIDTH_M, DEPTH_M = 4.6, 3.1, 1.2
HEIGHT_M = 2.5
LENS = Lens(
    "pinhole", 1280, 720, (736.0, 736.0), (641.0, 358.0), (-0.12, 0.03, 0.0004, -0.0003, 0.0)
)
ROBOT = Bundle(
    "mini-1",
    (
        Tag(0, 0.100, (0.02, 0.0, -0.085)),
        Tag(1, 0.080, (-0.10, -0.09, -0.06), roll_deg=-45.0),
        Tag(2, 0.080, (-0.10, 0.09, -0.06), roll_deg=45.0),
    ),
)


def looking(place_m: Sequence[float], at_m: Sequence[float]) -> Pose:
    """Return the pose of a camera that looks at a place, the north up in its picture."""
    forward = np.subtract(at_m, place_m)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [1.0, 0.0, 0.0])  # north is up, so east is right
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    return Pose(np.column_stack([right, down, forward]), np.array(place_m, dtype=float))


def overhead_cameras(lens: Lens = LENS) -> tuple[Camera, ...]:
    """Return three cameras 2.5 m above the water, that are wide along the tank."""
    aims = (
        ((1.1, 1.3, -HEIGHT_M), (1.3, 1.35, 0.6)),
        ((2.3, 1.8, -HEIGHT_M), (2.3, 1.75, 0.6)),
        ((3.5, 1.3, -HEIGHT_M), (3.3, 1.35, 0.6)),
    )
    wide = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # along the tank
    poses = [looking(*aim) for aim in aims]
    return tuple(
        Camera(f"tank-{i + 1}", lens, Pose(pose.rotation @ wide, pose.position_m))
        for i, pose in enumerate(poses)
    )


def tank_layout() -> Layout:
    """Return twelve tags on the floor and six on dry brackets at the rim."""
    tags: list[Tag] = []
    for i, (north, east) in enumerate(
        (n, e) for n in (0.5, 1.7, 2.9, 4.1) for e in (0.5, 1.55, 2.6)
    ):
        tags.append(Tag(100 + i, 0.15, (north, east, DEPTH_M), heading_deg=20.0 * i))
    for i, (north, east) in enumerate((n, e) for n in (0.6, 2.3, 4.0) for e in (0.3, 2.8)):
        tags.append(Tag(120 + i, 0.15, (north, east, -0.15), heading_deg=-35.0 * i))
    return Layout(tuple(tags))


def surveyed(
    layout: Layout, rng: np.random.Generator, position_std_m: float, angle_std_deg: float
) -> Layout:
    """Return a layout as somebody measured it, with errors drawn per axis."""
    return Layout(tuple(_shifted(tag, rng, position_std_m, angle_std_deg) for tag in layout.tags))


def mounted(
    bundle: Bundle, rng: np.random.Generator, position_std_m: float, angle_std_deg: float
) -> Bundle:
    """Return a robot's tags as they are really glued on, with errors drawn per axis."""
    tags = tuple(_shifted(tag, rng, position_std_m, angle_std_deg) for tag in bundle.tags)
    return Bundle(bundle.robot, tags)


def _shifted(
    tag: Tag, rng: np.random.Generator, position_std_m: float, angle_std_deg: float
) -> Tag:
    north, east, down = (np.array(tag.position_m) + rng.normal(0.0, position_std_m, 3)).tolist()
    roll, pitch, heading = rng.normal(0.0, angle_std_deg, 3).tolist()
    return replace(
        tag,
        position_m=(north, east, down),
        roll_deg=tag.roll_deg + roll,
        pitch_deg=tag.pitch_deg + pitch,
        heading_deg=tag.heading_deg + heading,
    )


def random_pose(rng: np.random.Generator, depth_m: float, pitch_deg: float = 30.0) -> Pose:
    """Return a robot somewhere in the middle of the tank at a depth, m."""
    place = [rng.uniform(0.6, LENGTH_M - 0.6), rng.uniform(0.6, WIDTH_M - 0.6), depth_m]
    roll, pitch = np.radians(rng.uniform([-10.0, -pitch_deg], [10.0, pitch_deg])).tolist()
    return Pose.of_angles(place, roll, pitch, float(rng.uniform(-np.pi, np.pi)))


def ripple_px(
    camera: Camera, middle_m: FloatArray, level_m: float, slope_rad: float, rng: np.random.Generator
) -> FloatArray:
    """Return by how much ripples move a tag in the picture, drawn at random, shape ``(2,)``, px."""
    depth = max(float(middle_m[2]) - level_m, 0.0)
    height = level_m - camera.pose.position_m[2]
    flat = float(np.hypot(*(middle_m[:2] - camera.pose.position_m[:2])))
    away = float(np.hypot(flat, height + depth / 1.333))
    size = camera.lens.focal_px[0] / away * depth * (1.0 - 1.0 / 1.333) * slope_rad
    return rng.normal(0.0, size, 2)


def see(
    cameras: Sequence[Camera],
    tags: Sequence[Tag],
    carrier: Pose,
    rng: np.random.Generator,
    *,
    level_m: float = 0.0,
    index: float = 1.333,
    slope_rad: float = 0.0,
    noise: float = 1.0,
    edge_share: float = 0.6,
    least_side_px: float = 12.0,
) -> list[Sighting]:
    """Return what cameras see of tags: noise of each corner, a common edge error, ripples.

    Args:
        cameras: As they really are.
        tags: As they are really fixed to their carrier.
        carrier: Takes its axes into NED.
        rng: Draws the errors.
        level_m: Down coordinate of the surface.
        index: Index of refraction.
        slope_rad: Root mean square slope of the surface.
        noise: Noise of the corners over what a line fit has.
        edge_share: Standard deviation of the common edge error over the noise.
        least_side_px: Smaller sides are not found.
    """
    edge = edge_share * float(rng.normal())
    found: list[Sighting] = []
    everywhere = carrier.of_points([tag.corners_m for tag in tags])
    packed = np.array([camera.packed for camera in cameras])
    numbers = np.repeat(np.arange(len(cameras)), len(tags))
    still = [Pose.identity()] * len(numbers)
    exact = sights(
        packed, numbers, still, np.tile(everywhere, (len(cameras), 1, 1)), level_m, index
    )
    for i, camera in enumerate(cameras):
        for j, tag in enumerate(tags):
            corners_m, corners = everywhere[j], exact.pixels[i * len(tags) + j]
            if not np.isfinite(corners).all() or not camera.lens.shows(corners, 5.0).all():
                continue
            sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
            if area_px2(corners) < 64.0 or sides.min() < least_side_px:
                continue
            if area_px2(corners) < 0.35 * sides.max() ** 2:
                continue
            sigma = corner_sigma_px(float(sides.mean()), 0.8)
            ahead = (np.roll(corners, -1, axis=0) - corners) / sides[:, None]
            moved = corners + edge * sigma * (ahead - np.roll(ahead, 1, axis=0))
            moved = moved + rng.normal(0.0, noise * sigma, (4, 2))
            moved += ripple_px(camera, corners_m.mean(axis=0), level_m, slope_rad, rng)
            found.append(Sighting(camera.name, tag.id, moved, sigma))
    return found


@dataclass(frozen=True, eq=False)
class TrueTank:
    """What really is, and what is told of it; all that is wrong of the telling is drawn."""

    cameras: tuple[Camera, ...]
    tags: tuple[Tag, ...]
    level_m: float
    index: float
    told_cameras: tuple[Camera, ...]
    told_layout: Layout
    lens_covariances: tuple[FloatArray, ...]


def lens_covariance(lens: Lens) -> FloatArray:
    """Return how well twenty boards tell a lens."""
    views = drawn_views(lens, 20, 1)
    found = calibrate_lens(lens.kind, lens.width_px, lens.height_px, views)
    assert isinstance(found, LensCalibration)
    return found.covariance


def true_tank(
    seed: int,
    covariance: FloatArray,
    *,
    level_std_m: float = 0.005,
    index_std: float = 0.0005,
    edge_std_px: float = 0.1,
    survey_std_m: float = 0.002,
    survey_std_deg: float = 0.3,
    lens: Lens = LENS,
) -> TrueTank:
    """Return a tank of which lenses, edges, level, index and survey are told wrong at random."""
    rng = np.random.default_rng(seed)
    told = overhead_cameras(lens)
    cameras: list[Camera] = []
    for camera in told:
        errors = np.zeros(CAMERA_ERRORS)
        errors[6:15] = rng.multivariate_normal(np.zeros(9), covariance)
        errors[15] = rng.normal(0.0, edge_std_px)
        cameras.append(camera.moved(errors))
    layout = tank_layout()
    return TrueTank(
        tuple(cameras),
        surveyed(layout, rng, survey_std_m, survey_std_deg).tags,
        float(rng.normal(0.0, level_std_m)),
        float(rng.normal(1.333, index_std)),
        told,
        layout,
        (covariance,) * len(told),
    )


def see_means(tank: TrueTank, seed: int, **changes: float) -> list[Sighting]:
    """Return the means of 50 pictures of the fixed tags."""
    rng = np.random.default_rng(seed)
    water = {"level_m": tank.level_m, "index": tank.index, **changes}
    seen = see(tank.cameras, tank.tags, Pose.identity(), rng, noise=0.0, edge_share=0.0, **water)
    means: list[Sighting] = []
    for sighting in seen:
        sigma = float(np.hypot(sighting.sigma_px / np.sqrt(50.0), 0.03))
        noise = rng.normal(0.0, sigma, (4, 2))
        means.append(replace(sighting, corners_px=sighting.corners_px + noise, sigma_px=sigma))
    return means
