"""What a camera saw in one picture, and what its process says of itself.

These cross the pipe between a camera's process and the station as JSON (see ``wire``).
Times are of the wall's clock; who runs by another clock counts back from the moment of arrival.
"""

import math
from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Literal

import msgspec

TAGS_MAX = 200
"""Tags of one picture that are told; the nearest to where they are expected come first."""
_SIDE_LEAST_PX, _SIDE_MOST_PX = 64, 4096
_FAR_PX = 16384.0

Sought = Literal["region", "whole"]
SourceState = Literal["opening", "running", "silent", "dark", "glare", "failed"]
"""``dark`` and ``glare`` are running, with pictures in which nothing can be found."""
Pixel = tuple[float, float]


class TagSeen(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One tag in one picture."""

    id: Annotated[int, msgspec.Meta(ge=0, le=586)]
    corners_px: tuple[Pixel, Pixel, Pixel, Pixel]
    """In the order of ``autonomy.vision.tag.CORNERS``; the first pixel's centre is (0, 0)."""
    sigma_px: Annotated[float, msgspec.Meta(gt=0.0, le=100.0)]
    """Noise of each coordinate."""
    margin: float
    """How surely the detector decided its bits."""
    hamming: Annotated[int, msgspec.Meta(ge=0, le=3)]
    blur_px: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)]
    is_fitted: bool = True
    """Its corners come from the line fit; otherwise they are the detector's own."""

    def __post_init__(self) -> None:
        for x, y in self.corners_px:
            if not (abs(x) <= _FAR_PX and abs(y) <= _FAR_PX):
                raise ValueError("corners_px: are not pixels of a picture")
        if not math.isfinite(self.margin):
            raise ValueError("margin: is not finite")


class BoardCorner(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One inner corner of the calibration board in one picture."""

    id: Annotated[int, msgspec.Meta(ge=0, le=9999)]
    pixel: Pixel


class BoardView(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The calibration board in one picture, because the station asked for it."""

    camera: str
    frame: Annotated[int, msgspec.Meta(ge=0)]
    size: tuple[int, int]
    corners: Annotated[list[BoardCorner], msgspec.Meta(max_length=10000)]


class Sighting(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All tags of one picture."""

    camera: str
    frame: Annotated[int, msgspec.Meta(ge=0)]
    """Number of the picture since the process began."""
    taken_at: datetime
    """When the picture was taken, by the wall's clock: the driver's time, or arrival - latency."""
    arrived_at: datetime
    size: tuple[int, int]
    """Width and height, px."""
    sought: Sought
    """Where tags were sought: in the regions that the station named, or everywhere."""
    tags: Annotated[list[TagSeen], msgspec.Meta(max_length=TAGS_MAX)]
    twice: Annotated[list[int], msgspec.Meta(max_length=TAGS_MAX)] = []
    """Ids that were seen more than once, none of which is among the tags."""
    cpu_ms: Annotated[float, msgspec.Meta(ge=0.0)] = 0.0

    def __post_init__(self) -> None:
        if self.taken_at.tzinfo is None or self.arrived_at.tzinfo is None:
            raise ValueError("taken_at, arrived_at: are not aware times")
        if not all(_SIDE_LEAST_PX <= side <= _SIDE_MOST_PX for side in self.size):
            raise ValueError(f"size: {self.size} is not {_SIDE_LEAST_PX} to {_SIDE_MOST_PX} px")
        ids = [tag.id for tag in self.tags]
        if len(set(ids)) != len(ids):
            raise ValueError("tags: an id is there twice")


class SourceReport(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a camera's process fares; told when it changes, and every second."""

    camera: str
    state: SourceState
    words: str
    """What is wrong, for a person; empty where nothing is."""
    pictures: int
    """Looked at since the process began: it does not grow while a camera is frozen, or sends what
    is no picture."""
    dropped: int
    """Came besides and were not looked at, because a newer one waited."""
    refused: dict[str, int]
    """Came besides and are no pictures, or the same again, by reason."""
    size: tuple[int, int] | None = None
    frames_per_s: float = 0.0


class Region(msgspec.Struct, frozen=True, forbid_unknown_fields=True, array_like=True):
    """A part of the picture where tags are expected, px, margins included."""

    left: int
    top: int
    right: int
    bottom: int


class Order(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the station wishes of a camera's process; each replaces the one before."""

    regions: Annotated[list[Region], msgspec.Meta(max_length=60)] = []
    """Where robots are expected; empty: seek everywhere in each picture."""
    wants_previews: bool = False
    """Somebody looks: send at most two pictures a second."""
    board_views: int = 0
    """Counts up: for each step the next picture is searched for the board, with one answer."""


class SourceSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a camera's process is told first, and once."""

    camera: str
    uri: str
    latency_s: float | None = None
    """Between exposure and arrival; if not told, the usual one of its kind of source."""
    folder: str | None = None
    """``GRACE_CAMERA_DIR``, below which folders and videos must lie."""
    user: str = ""
    password: str = ""


def perimeter_px(tag: TagSeen) -> float:
    """Return the way around a tag in the picture."""
    corners = tag.corners_px
    return sum(math.dist(corners[i], corners[i - 1]) for i in range(4))


def nearest_first(tags: Sequence[TagSeen], limit: int = TAGS_MAX) -> list[TagSeen]:
    """Return the tags that look largest, which are nearest to the camera, at most ``limit``."""
    return sorted(tags, key=perimeter_px, reverse=True)[:limit]
