"""What REST tells of tags."""

from dataclasses import dataclass
from datetime import datetime

from server.base.view import View


@dataclass(frozen=True, slots=True)
class DetectionView(View):
    """One transmission of a tag that was heard."""

    robot: str
    receiver: str
    tag: str
    measured_at: datetime
    sensor: float | None
    sensor_unit: str | None
    """``ADC`` for a raw value."""
    north_m: float | None
    """Null where nobody knows where the receiver was."""
    east_m: float | None
    depth_m: float | None
    position_std_m: float | None
    tag_name: str | None
    station: str | None
    doubtful: bool
    """Whether no other of the same tag on the same receiver was heard near in time."""


@dataclass(frozen=True, slots=True)
class DetectionsView(View):
    """Detections, the newest first."""

    detections: list[DetectionView]
    total: int
    """How many there are; the list may be shorter."""


@dataclass(frozen=True, slots=True)
class TagView(View):
    """What is known of one tag."""

    tag: str
    name: str | None
    detections: int
    doubtful: int
    first_at: datetime
    last_at: datetime
    hours: list[float]
    """Times of at most 600 detections since the first, h, for a plot of tags by time."""
    doubts: list[bool]
    """Of each of these, whether it is doubtful."""


@dataclass(frozen=True, slots=True)
class ReceiverView(View):
    """How the tag receiver on board fares since the robot was switched on."""

    receiver: int
    """Serial number; 0 before it was understood once."""
    at: datetime
    heard: int
    refused_sum: int
    refused_date: int
    refused_code: int
    clock_offset_s: float | None
    """The receiver's clock minus the robot's."""
    is_clock_off: bool
    """Whether it is so far off that the robot's time is used."""


@dataclass(frozen=True, slots=True)
class TagsView(View):
    """All tags that were heard, and the receiver."""

    robot: str
    tags: list[TagView]
    """By name."""
    detections: int
    doubtful: int
    receiver: ReceiverView | None
    simulation: bool


@dataclass(frozen=True, slots=True)
class RatePointView(View):
    """Detections an hour about a place of the track."""

    at: datetime
    north_m: float
    east_m: float
    per_hour: float


@dataclass(frozen=True, slots=True)
class TagTrackView(View):
    """The track, with what was heard along it."""

    robot: str
    tag: str | None
    points: list[RatePointView]


@dataclass(frozen=True, slots=True)
class RowView(View):
    """A part of a row of the grid."""

    row: int
    first: int
    """Column."""
    count: int


@dataclass(frozen=True, slots=True)
class RestingView(View):
    """Where a tag is if it stays where it is."""

    robot: str
    tag: str
    detections: int
    """That are beyond doubt and at a known place."""
    mean_ne_m: tuple[float, float]
    south_west_m: tuple[float, float]
    """Corner of the grid, north and east."""
    cell_m: tuple[float, float]
    """Size of a cell, north and east."""
    half: list[RowView]
    """Cells of the region that holds it with 50 %."""
    most: list[RowView]
    """Cells of the region that holds it with 90 %."""
    half_ha: float
    most_ha: float
    text: str
    """In words."""
