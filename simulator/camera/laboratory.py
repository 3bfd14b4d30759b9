"""The emulated laboratory: what is told of its tags, and what is true instead.

Told is what somebody measured with a ruler; true is that and an error, drawn by a seed. A simulated
tank has three cameras over it, fixed tags on the floor and on dry brackets at the rim, and three
tags on each robot.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.site import TANK
from autonomy.vision.camera import Camera
from autonomy.vision.lens import Lens
from autonomy.vision.rigid import Pose
from autonomy.vision.tag import ROBOT_IDS, Bundle, Layout, Tag
from robot_link.messages import RobotId
from simulator.camera.scene import Scene
from simulator.fleet import FLEET, is_sub

CAMERAS_MAX = 3
HEIGHT_M = 2.5
"""Of the cameras above the nominal level."""
FIRST_FLOOR_ID, FIRST_RIM_ID = 100, 120
SIZE_M = 0.15
_WIDTH_PX, _HEIGHT_PX, _ACROSS_DEG = 1280, 720, 82.0
_PLACES_NE_M = ((-1.2, -0.35), (0.0, 0.35), (1.2, -0.35))
"""Of the cameras, from the tank's middle."""
_AIMS_NE_M = ((-1.0, -0.3), (0.0, 0.3), (1.0, -0.3))
"""Where they look at 0.6 m below the level."""
_FLOOR_NORTHS_M, _FLOOR_EASTS_M = (-1.8, -0.6, 0.6, 1.8), (-1.05, 0.0, 1.05)
_RIM_NORTHS_M, _RIM_EASTS_M = (-1.3, 0.0, 1.3), (-1.2, 1.2)
_NUMBERS = len(ROBOT_IDS) // 3
_RIM_M, _FOOT_M = 0.15, 0.02
"""Height of the rim's tags above the nominal level, and of the feet of those on the floor."""


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How well somebody measured, and glued; standard deviations per axis."""

    survey_m: float = 0.002
    survey_deg: float = 0.3
    gluing_m: float = 0.0003
    gluing_deg: float = 0.2
    aim_m: float = 0.02
    """How far cameras hang from where the drawing has them, which nobody is told."""
    aim_deg: float = 1.0


def tank_robots(robots: Iterable[RobotId]) -> tuple[RobotId, ...]:
    """Return the simulated robots that swim in the tank; in this order they have their tags."""
    own = (robot for robot in robots if not is_sub(robot))
    return tuple(robot for robot in own if FLEET[robot].site.water == TANK.water)


def told_layout() -> Layout:
    """Return the fixed tags as they were measured: twelve on the floor, six at the rim."""
    north, east = _middle_ne_m()
    tags: list[Tag] = []
    floor = [(n, e) for n in _FLOOR_NORTHS_M for e in _FLOOR_EASTS_M]
    for i, (n, e) in enumerate(floor):
        place = (round(north + n, 3), round(east + e, 3), TANK.water.depth_max_m - _FOOT_M)
        tags.append(Tag(FIRST_FLOOR_ID + i, SIZE_M, place, heading_deg=20.0 * i))
    rim = [(n, e) for n in _RIM_NORTHS_M for e in _RIM_EASTS_M]
    for i, (n, e) in enumerate(rim):
        place = (round(north + n, 3), round(east + e, 3), -_RIM_M)
        tags.append(Tag(FIRST_RIM_ID + i, SIZE_M, place, heading_deg=-35.0 * i))
    return Layout(tuple(tags))


def told_bundle(robot: str, number: int) -> Bundle:
    """Return the tags of a robot as they were measured: ids 3k, 3k + 1, 3k + 2.

    Args:
        robot: Its name.
        number: k.

    Raises:
        ValueError: If there are no ids left for it.
    """
    first = 3 * number
    return Bundle(
        robot,
        (
            Tag(first, 0.100, (0.02, 0.0, -0.085)),
            Tag(first + 1, 0.080, (-0.10, -0.09, -0.06), roll_deg=-45.0),
            Tag(first + 2, 0.080, (-0.10, 0.09, -0.06), roll_deg=45.0),
        ),
    )


def told_bundles(robots: Sequence[str]) -> tuple[Bundle, ...]:
    """Return the tags of robots: ``mini-3`` has those of number 2, others what is free.

    Raises:
        ValueError: If there are no ids left for one.
    """
    numbers: dict[str, int] = {}
    for robot in robots:
        kind, _, number = robot.partition("-")
        if kind == "mini" and number.isdecimal() and 1 <= int(number) <= _NUMBERS:
            numbers[robot] = int(number) - 1
    free = (number for number in range(_NUMBERS + 1) if number not in numbers.values())
    return tuple(
        told_bundle(robot, numbers[robot] if robot in numbers else next(free)) for robot in robots
    )


def layout_document() -> dict[str, object]:
    """Return the fixed tags as JSON: what a laboratory writes down."""
    return {"tags": [_tag_document(tag) for tag in told_layout().tags]}


def bundle_documents(robots: Sequence[str]) -> list[dict[str, object]]:
    """Return the tags of robots as JSON."""
    return [
        {"robot": bundle.robot, "tags": [_tag_document(tag) for tag in bundle.tags]}
        for bundle in told_bundles(robots)
    ]


def told_document(robots: Sequence[str]) -> dict[str, object]:
    """Return layout and bundles as JSON, as a station is told them."""
    return {"layout": layout_document(), "bundles": bundle_documents(robots)}


def camera_names(count: int) -> tuple[str, ...]:
    """Return the names of the cameras.

    Raises:
        ValueError: If there is no place for so many.
    """
    if not 1 <= count <= CAMERAS_MAX:
        raise ValueError(f"cameras: {count} are not 1 to {CAMERAS_MAX}")
    return tuple(f"tank-{i + 1}" for i in range(count))


def true_scene(
    robots: Sequence[str], count: int = CAMERAS_MAX, seed: int = 0, accuracy: Accuracy | None = None
) -> Scene:
    """Return the laboratory as it truly is.

    Args:
        robots: Those that swim in the tank.
        count: How many cameras hang over it.
        seed: Draws lenses, aims and every error of what was told.
        accuracy: How large those errors are.

    Raises:
        ValueError: If there is no place for so many cameras or robots.
    """
    rough = accuracy or Accuracy()
    rng = np.random.default_rng([seed, 11])
    layout = Layout(
        tuple(_off(tag, rng, rough.survey_m, rough.survey_deg) for tag in told_layout().tags)
    )
    bundles = tuple(
        Bundle(
            told.robot,
            tuple(_off(tag, rng, rough.gluing_m, rough.gluing_deg) for tag in told.tags),
        )
        for told in told_bundles(robots)
    )
    cameras = tuple(
        Camera(name, _drawn_lens(rng), _drawn_pose(i, rng, rough))
        for i, name in enumerate(camera_names(count))
    )
    return Scene(cameras, layout, bundles, seed=seed)


def _middle_ne_m() -> tuple[float, float]:
    box = TANK.water
    return 0.5 * (box.x_min_m + box.x_max_m), 0.5 * (box.y_min_m + box.y_max_m)


def _drawn_lens(rng: np.random.Generator) -> Lens:
    """Return a lens of 82 deg across: one of a series, of which none is as the drawing has it."""
    usual = 0.5 * _WIDTH_PX / math.tan(math.radians(0.5 * _ACROSS_DEG))
    focal = usual * (1.0 + 0.005 * float(rng.standard_normal()))
    u, v = (np.array([639.5, 359.5]) + rng.normal(0.0, 3.0, 2)).tolist()
    k1, k2, p1, p2 = (
        np.array([-0.12, 0.03, 0.0, 0.0]) + rng.normal(0.0, [0.01, 0.005, 4e-4, 4e-4])
    ).tolist()
    return Lens("pinhole", _WIDTH_PX, _HEIGHT_PX, (focal, focal), (u, v), (k1, k2, p1, p2, 0.0))


def _drawn_pose(number: int, rng: np.random.Generator, rough: Accuracy) -> Pose:
    """Return a camera that is wide along the tank."""
    north, east = _middle_ne_m()
    (n, e), (aim_n, aim_e) = _PLACES_NE_M[number], _AIMS_NE_M[number]
    place = np.array([north + n, east + e, -HEIGHT_M])
    aim = np.array([north + aim_n, east + aim_e, 0.6])
    return looking(place, aim).moved(
        rng.normal(0.0, rough.aim_m, 3), np.radians(rng.normal(0.0, rough.aim_deg, 3))
    )


def looking(place_m: FloatArray, at_m: FloatArray) -> Pose:
    """Return the pose of a camera that looks at a place below it, the north right in its picture.

    Args:
        place_m: Where it hangs, in NED, shape ``(3,)``.
        at_m: What its optical axis meets, shape ``(3,)``.
    """
    forward = (at_m - place_m) / np.linalg.norm(at_m - place_m)
    down = np.cross(forward, [1.0, 0.0, 0.0])
    down /= np.linalg.norm(down)
    return Pose(np.column_stack([np.cross(down, forward), down, forward]), place_m)


def _off(tag: Tag, rng: np.random.Generator, std_m: float, std_deg: float) -> Tag:
    x, y, z = (np.array(tag.position_m) + rng.normal(0.0, std_m, 3)).tolist()
    roll, pitch, heading = rng.normal(0.0, std_deg, 3).tolist()
    return replace(
        tag,
        position_m=(x, y, z),
        roll_deg=tag.roll_deg + roll,
        pitch_deg=tag.pitch_deg + pitch,
        heading_deg=tag.heading_deg + heading,
    )


def _tag_document(tag: Tag) -> dict[str, object]:
    return {
        "id": tag.id,
        "size_m": tag.size_m,
        "position_m": list(tag.position_m),
        "roll_deg": tag.roll_deg,
        "pitch_deg": tag.pitch_deg,
        "heading_deg": tag.heading_deg,
    }
