"""Tags as things in space: their corners, those of a robot, those of a tank, and who has which id.

A tag is a black square with a pattern (family tag36h11), printed with a white rim on a plate. Its
axes have their origin in the middle, x to the right and y down as printed, z into the plate. Angles
are counted from lying flat, face up, with the top edge to the north (on a robot: forward); at
pitch +90 deg it hangs on a north wall, faces south, and its top edge is up.

Corners are always in the order top left, top right, bottom right, bottom left of the print.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.vision.rigid import Pose

FAMILY = "tag36h11"
CELLS_BLACK, CELLS_PLATE = 8, 10
"""Cells along a side of the black square, whose side is the size of the tag, and of the plate."""
ROBOT_IDS, TANK_IDS, LATENCY_IDS = range(99), range(100, 200), range(200, 216)
"""Ids of tags on robots (3k to 3k + 2 are one robot's), in the tank, and of the latency check."""
CORNERS = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
"""Corners of a tag of size 1 in its axes, in order."""
_FLAT = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Axes of a tag that lies flat, top edge north, in NED."""
_APRILTAG_ORDER = (1, 0, 3, 2)
_TANK_STD_M, _TANK_STD_DEG = 0.002, 0.3
_ROBOT_STD_M, _ROBOT_STD_DEG = 0.0005, 0.6
_LARGEST_SIZE_M, _FARTHEST_M = 5.0, 1000.0


@dataclass(frozen=True, slots=True)
class Tag:
    """One tag and how it is fixed to its carrier: to a robot's body, or to the tank.

    Raises:
        ValueError: If a number cannot be one of a tag; the message begins with the field's name.
    """

    id: int
    size_m: float
    """Side of the black square."""
    position_m: tuple[float, float, float]
    """Middle of the tag, in body axes or in the tank's NED."""
    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    heading_deg: float = 0.0
    position_std_m: float | None = None
    """How well the position is known, per axis; if not told, 2 mm in a tank, 0.5 mm on a robot."""
    angle_std_deg: float | None = None
    """How well the angles are known, per axis; if not told, 0.3 deg in a tank, 0.6 on a robot."""

    def __post_init__(self) -> None:
        if self.id not in ROBOT_IDS and self.id not in TANK_IDS and self.id not in LATENCY_IDS:
            raise ValueError(
                f"id: {self.id} is none of a robot, of the tank or of the latency check"
            )
        if not 0.0 < self.size_m <= _LARGEST_SIZE_M:
            raise ValueError(f"size_m: {self.size_m} is not above 0 and at most {_LARGEST_SIZE_M}")
        if len(self.position_m) != 3 or not np.all(np.abs(self.position_m) <= _FARTHEST_M):
            raise ValueError(f"position_m: {self.position_m} are not three numbers in metres")
        for name in ("roll_deg", "pitch_deg", "heading_deg"):
            if not abs(getattr(self, name)) <= 360.0:
                raise ValueError(f"{name}: {getattr(self, name)} is no angle within 360 deg")
        for name, most in (("position_std_m", 1.0), ("angle_std_deg", 30.0)):
            std = getattr(self, name)
            if std is not None and not 0.0 <= std <= most:
                raise ValueError(f"{name}: {getattr(self, name)} is not within 0 and {most}")

    @property
    def pose(self) -> Pose:
        """Takes coordinates of the tag into those of its carrier."""
        angles = np.radians([self.roll_deg, self.pitch_deg, self.heading_deg]).tolist()
        flat = Pose.of_angles(self.position_m, *angles)
        return Pose(flat.rotation @ _FLAT, flat.position_m)

    @property
    def place_std_m(self) -> float:
        """How well the position is known, per axis."""
        usual = _ROBOT_STD_M if self.id in ROBOT_IDS else _TANK_STD_M
        return usual if self.position_std_m is None else self.position_std_m

    @property
    def turn_std_rad(self) -> float:
        """How well it is known how the tag is turned, per axis."""
        usual = _ROBOT_STD_DEG if self.id in ROBOT_IDS else _TANK_STD_DEG
        return math.radians(usual if self.angle_std_deg is None else self.angle_std_deg)

    @property
    def corners_m(self) -> FloatArray:
        """Corners in the axes of the carrier, shape ``(4, 3)``, m."""
        return self.pose.of_points(self.size_m * CORNERS)

    @classmethod
    def at_pose(cls, tag_id: int, size_m: float, pose: Pose) -> "Tag":
        """Return the tag that has a pose, with angles as they are told."""
        roll, pitch, heading = np.degrees(Pose(pose.rotation @ _FLAT.T, pose.position_m).angles_rad)
        north, east, down = pose.position_m.tolist()
        return cls(tag_id, size_m, (north, east, down), float(roll), float(pitch), float(heading))


@dataclass(frozen=True, slots=True)
class Bundle:
    """The tags of one robot, in its body axes.

    Raises:
        ValueError: If there is no tag, an id is not a robot's, or ids are of two robots.
    """

    robot: str
    tags: tuple[Tag, ...]

    def __post_init__(self) -> None:
        if not self.robot:
            raise ValueError("robot: has no name")
        if not self.tags:
            raise ValueError("tags: there is none")
        for i, tag in enumerate(self.tags):
            if tag.id not in ROBOT_IDS:
                raise ValueError(f"tags[{i}].id: {tag.id} is not one of a robot, 0 to 98")
            if tag.id // 3 != self.tags[0].id // 3:
                first = 3 * (self.tags[0].id // 3)
                raise ValueError(f"tags[{i}].id: {tag.id} is not one of {first} to {first + 2}")
        _refuse_twice(self.tags)

    def tag(self, tag_id: int) -> Tag | None:
        """Return the tag of an id, if the robot has it."""
        return next((tag for tag in self.tags if tag.id == tag_id), None)


@dataclass(frozen=True, slots=True)
class Layout:
    """The fixed tags of a tank, in its NED.

    Raises:
        ValueError: If an id is not one of the tank or is there twice.
    """

    tags: tuple[Tag, ...]

    def __post_init__(self) -> None:
        for i, tag in enumerate(self.tags):
            if tag.id not in TANK_IDS:
                raise ValueError(f"tags[{i}].id: {tag.id} is not one of the tank, 100 to 199")
        _refuse_twice(self.tags)

    def tag(self, tag_id: int) -> Tag | None:
        """Return the tag of an id, if the tank has it."""
        return next((tag for tag in self.tags if tag.id == tag_id), None)

    def without(self, tag_id: int) -> "Layout":
        """Return the layout that lacks a tag."""
        return Layout(tuple(tag for tag in self.tags if tag.id != tag_id))


@dataclass(frozen=True, slots=True)
class Registry:
    """Every tag of a site, each id once.

    Raises:
        ValueError: If two robots have one name or one id.
    """

    layout: Layout
    bundles: tuple[Bundle, ...] = ()

    def __post_init__(self) -> None:
        owners: dict[int, str] = {}
        names: set[str] = set()
        for bundle in self.bundles:
            if bundle.robot in names:
                raise ValueError(f"robot: {bundle.robot} has two bundles")
            names.add(bundle.robot)
            for i, tag in enumerate(bundle.tags):
                if tag.id in owners:
                    raise ValueError(
                        f"{bundle.robot}.tags[{i}].id: {tag.id} belongs to {owners[tag.id]} already"
                    )
                owners[tag.id] = bundle.robot

    def robot_of(self, tag_id: int) -> Bundle | None:
        """Return the robot that carries a tag; ``None`` where it is fixed or a stranger."""
        return next((bundle for bundle in self.bundles if bundle.tag(tag_id)), None)

    def is_stranger(self, tag_id: int) -> bool:
        """Tell whether nobody knows a tag."""
        return self.robot_of(tag_id) is None and self.layout.tag(tag_id) is None


def layout_of(document: Mapping[str, object]) -> Layout:
    """Read the layout of a tank: ``{"tags": [...]}``.

    Raises:
        ValueError: If something is missing or wrong; the message begins with its path.
    """
    return Layout(_tags_of(document))


def bundle_of(document: Mapping[str, object]) -> Bundle:
    """Read the tags of a robot: ``{"robot": "mini-1", "tags": [...]}``.

    Raises:
        ValueError: If something is missing or wrong; the message begins with its path.
    """
    robot = document.get("robot")
    if not isinstance(robot, str):
        raise ValueError("robot: is not a name")  # noqa: TRY004 - to a caller a document is a value
    return Bundle(robot, _tags_of(document))


def corners_from_apriltag(corners_px: npt.ArrayLike) -> FloatArray:
    """Return corners as the AprilTag library tells them in this project's order and pixels.

    It tells them half a turn away and counts the centre of the first pixel as (0.5, 0.5).

    Args:
        corners_px: Shape ``(..., 4, 2)``.
    """
    return np.asarray(corners_px, dtype=np.float64)[..., _APRILTAG_ORDER, :] - 0.5


def from_enlarged(pixels: npt.ArrayLike, scale: float) -> FloatArray:
    """Return in the pixels of a picture what was found in one enlarged by ``scale``.

    Args:
        pixels: Counted from the centre of the first pixel of the enlarged picture, any shape.
        scale: How many times larger that is.
    """
    return (np.asarray(pixels, dtype=np.float64) + 0.5) / scale - 0.5


def planes(tags: Sequence[Tag], thickness_m: float = 0.05) -> int:
    """Return on how many planes the middles of tags lie: 1, or 2 for more than one.

    Args:
        tags: Fixed tags.
        thickness_m: Root mean square distance from a plane up to which they lie on it.
    """
    places = np.array([tag.position_m for tag in tags]).reshape(-1, 3)
    if len(places) < 4:
        return 1
    spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)[-1]
    return 1 if spread <= thickness_m * math.sqrt(len(places)) else 2


def _refuse_twice(tags: Sequence[Tag]) -> None:
    seen: set[int] = set()
    for i, tag in enumerate(tags):
        if tag.id in seen:
            raise ValueError(f"tags[{i}].id: {tag.id} is there twice")
        seen.add(tag.id)


def _tags_of(document: Mapping[str, object]) -> tuple[Tag, ...]:
    entries = document.get("tags")
    if not isinstance(entries, Sequence) or isinstance(entries, str):
        raise ValueError("tags: is not a list")  # noqa: TRY004 - to a caller a document is a value
    return tuple(_tag_of(entry, f"tags[{i}]") for i, entry in enumerate(entries))


def _tag_of(entry: object, path: str) -> Tag:
    if not isinstance(entry, Mapping):
        raise ValueError(f"{path}: is not an object")  # noqa: TRY004 - as above
    fields = {str(name): value for name, value in entry.items()}
    tag_id, position = fields.pop("id", None), fields.pop("position_m", None)
    if not isinstance(tag_id, int) or isinstance(tag_id, bool):
        raise ValueError(f"{path}.id: is not a whole number")  # noqa: TRY004 - as above
    if not isinstance(position, Sequence) or isinstance(position, str) or len(position) != 3:
        raise ValueError(f"{path}.position_m: are not three numbers")
    x, y, z = (_number(value, f"{path}.position_m[{i}]") for i, value in enumerate(position))
    if "size_m" not in fields:
        raise ValueError(f"{path}.size_m: is missing")
    size_m = _number(fields.pop("size_m"), f"{path}.size_m")
    unknown = fields.keys() - Tag.__dataclass_fields__.keys()
    if unknown:
        raise ValueError(f"{path}.{min(unknown)}: no tag has this field")
    others = {
        name: _number(value, f"{path}.{name}")
        for name, value in fields.items()
        if value is not None  # as REST tells what nobody said
    }
    try:
        return Tag(tag_id, size_m, (x, y, z), **others)
    except ValueError as refused:
        raise ValueError(f"{path}.{refused}") from None


def _number(value: object, path: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"{path}: is not a finite number")
    return float(value)
