"""Cameras and tags as REST shows them."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Literal, Self

from pydantic import Field, SecretStr, field_validator

from autonomy.vision.tag import Tag
from server.base.view import Body, View
from server.camera.address import checked_uri

CameraId = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")]
"""Short name: lower-case letters, digits and dashes."""
Place = tuple[float, float, float]
CameraState = Literal[
    "not_installed",
    "too_fast",
    "starting",
    "opening",
    "running",
    "silent",
    "dark",
    "glare",
    "failed",
]
SetUpStep = Literal["lens", "tags", "pose", "done"]


class NewCamera(Body):
    """A camera to add."""

    id: CameraId
    """Its name, also in the words of alarms."""
    uri: str = Field(max_length=500)
    """Where its pictures come from: ``v4l2:``, ``http:``, ``https:``, ``rtsp:``, ``folder:`` or
    ``video:``, without user and password."""

    @field_validator("uri")
    @classmethod
    def _is_one(cls, value: str) -> str:
        return checked_uri(value)


class CameraChanges(Body):
    """What is to be changed of a camera; ``null`` leaves it."""

    uri: str | None = Field(default=None, max_length=500)
    """Where its pictures come from. An account is forgotten where that is another host; lens and
    place are to be found anew where more than the options is another."""
    latency_s: float | None = Field(default=None, ge=0.0, le=5.0, allow_inf_nan=False)
    """Time between exposure and arrival."""
    latency_std_s: float | None = Field(default=None, ge=0.0, le=1.0, allow_inf_nan=False)
    """How well that is known."""

    @field_validator("uri")
    @classmethod
    def _is_one(cls, value: str | None) -> str | None:
        return None if value is None else checked_uri(value)


class CameraAccountBody(Body):
    """What the camera asks for; it is kept in the secret folder and never shown."""

    user: str = Field(max_length=200)
    """Name of the account."""
    password: SecretStr = Field(max_length=500)
    """Password of the account."""


@dataclass(frozen=True, slots=True)
class LensView(View):
    """A calibrated lens."""

    calibration: str
    """Id of the calibration that found it."""
    kind: Literal["pinhole", "fisheye"]
    size: tuple[int, int]
    """Pictures that it holds for, px."""
    focal_px: tuple[float, float]
    principal_px: tuple[float, float]
    distortion: list[float]
    rms_px: float
    focal_std_share: float
    """How well the focal length is known, as a part of it."""
    at: datetime


@dataclass(frozen=True, slots=True)
class CameraPlaceView(View):
    """Where a camera hangs."""

    position_ned_m: Place
    rotation: tuple[Place, Place, Place]
    """Rows of the matrix that takes camera axes (x right, y down, z forward) into NED."""
    corner_rays_ned: list[Place]
    """Directions of length 1 in air along which the corners of the picture look: top left, top
    right, bottom right, bottom left."""
    position_std_m: float
    """Of the worst axis."""
    angle_std_deg: float


@dataclass(frozen=True, slots=True)
class CameraView(View):
    """A camera, how its process fares and what it sees."""

    id: str
    uri: str
    version: int
    """Grows with each change; quoted, it is the ``ETag``."""
    created_at: datetime
    created_by: str
    changed_at: datetime
    latency_s: float | None
    """Between exposure and arrival, as measured; ``null``: the usual one of its kind of source."""
    latency_std_s: float | None
    has_account: bool
    """Whether user and password are kept for it."""
    step: SetUpStep
    """What its set-up lacks next."""
    missing: str
    """The same in words; empty when it is done."""
    state: CameraState
    """``dark`` and ``glare`` are running, with pictures in which nothing can be found."""
    words: str
    """What is wrong and what to do, empty where nothing is."""
    size: tuple[int, int] | None
    """Of its pictures, px."""
    frames_per_s: float
    pictures: int
    """Since its process began."""
    dropped: int
    """Of them, those that were dropped because a newer one waited."""
    refused: dict[str, int]
    """Pictures and times that were not used, by reason, since the station began."""
    restarts: int
    """Of its process since the station began."""
    seen_at: datetime | None
    """When its newest picture was taken, by the station's clock."""
    tags: list[int]
    """Ids in its newest picture."""
    strangers: list[int]
    """Ids of those that nobody knows."""
    blur_px: float | None
    """Median over the tags in its newest picture."""
    advice: str
    """What would make its pictures better; empty where nothing is known."""
    stand: Literal["holds", "moved", "left_out", "unknown"]
    """Whether it still is where the calibration left it."""
    shift_px: float
    """How far the fixed tags are from where they should be; 0 where that is unknown."""
    moved: str
    """The same in words; empty where it holds."""
    is_used: bool
    """Whether robots are found by it."""
    lens: LensView | None
    place: CameraPlaceView | None


class TagBody(Body):
    """One tag and how it is fixed to its carrier."""

    id: int
    """0 to 98 of robots, of which 3k to 3k + 2 are one robot's; 100 to 199 of the tank."""
    size_m: float
    """Side of the black square, not of the plate."""
    position_m: Place
    """Middle of the tag: in the robot's body axes, or in the tank's NED."""
    roll_deg: float = 0.0
    """Counted, as the others, from lying flat, face up, top edge north (on a robot: forward)."""
    pitch_deg: float = 0.0
    """At 90 deg a plate hangs on a north wall and faces south, its top edge up."""
    heading_deg: float = 0.0
    """Where its top edge points."""
    position_std_m: float | None = None
    """How well the position is known per axis; by default 2 mm in a tank, 0.5 mm on a robot."""
    angle_std_deg: float | None = None
    """How well the angles are known; by default 0.3 deg in a tank, 0.6 on a robot."""

    @classmethod
    def of(cls, tag: Tag) -> Self:
        """Show a tag."""
        return cls.model_validate({name: getattr(tag, name) for name in Tag.__dataclass_fields__})

    def tag(self) -> Tag:
        """Return the tag.

        Raises:
            ValueError: If a number cannot be one of a tag; it begins with the field's name.
        """
        return Tag(**self.model_dump())


class BundleBody(Body):
    """The tags of one robot."""

    robot: str = Field(max_length=100)
    """Whose they are."""
    tags: list[TagBody] = Field(max_length=3)
    """In its body axes."""


class LayoutBody(Body):
    """The fixed tags of the tank."""

    tags: list[TagBody] = Field(max_length=100)
    """In the tank's NED, as surveyed; on two planes at least."""


class TagsBody(Body):
    """All tags of the site."""

    layout: LayoutBody
    """Those that do not move."""
    bundles: list[BundleBody] = Field(max_length=33)
    """Those on robots."""


@dataclass(frozen=True, slots=True)
class TagsView(View):
    """All tags of the site, as they are now."""

    layout: LayoutBody
    bundles: list[BundleBody]
    version: int
    """Grows with each change, 0 before the first; quoted, it is the ``ETag``."""
    changed_at: datetime | None
    changed_by: str | None


@dataclass(frozen=True, slots=True)
class CalibrationView(View):
    """One calibration of a lens, or of all cameras together."""

    id: str
    kind: Literal["lens", "rig"]
    at: datetime
    by: str
    summary: str
    """What it found, in words."""
    is_used: bool
    is_usable: bool
    """Whether it can be chosen: cameras that it rests on are still there."""
