"""What REST says of designs."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from pydantic import Field

from autonomy.design.document import Design
from autonomy.planner.plan import PrimitiveKind
from server.base.view import Body, View, one_of
from server.battery.view import BatteryAfterView
from server.plan.view import WayThereView

Change = Annotated[str, one_of("same", "moved", "changed", "added", "removed")]


@dataclass(frozen=True, slots=True)
class VersionView(View):
    """A saved version of a design."""

    number: int
    at: datetime
    by: str
    comment: str
    plan: str | None
    """Plan that was made of it last."""


@dataclass(frozen=True, slots=True)
class VersionDocumentView(View):
    """A saved version with its document."""

    number: int
    at: datetime
    by: str
    comment: str
    plan: str | None
    document: Design


@dataclass(frozen=True, slots=True)
class DesignSummaryView(View):
    """A design as a list shows it."""

    id: str
    robot: str
    name: str
    water: str | None
    kind: str
    revision: int
    versions: int
    changed_at: datetime
    changed_by: str
    is_archived: bool


@dataclass(frozen=True, slots=True)
class DesignView(View):
    """A design with its working document."""

    id: str
    robot: str
    name: str
    water: str | None
    """Id of the water that it is drawn in."""
    revision: int
    """For ``If-Match``: grows with each change, undoing included."""
    document: Design
    what: str
    """What the last change was."""
    changed_at: datetime
    changed_by: str
    created_at: datetime
    created_by: str
    is_archived: bool
    undo: list[str]
    """What can be undone, the newest first, at most 50."""
    redo: list[str]
    """What can be done again, the next first."""
    versions: list[VersionView]
    """The newest first."""


@dataclass(frozen=True, slots=True)
class OutlineWaypointView(View):
    """A waypoint as it is laid out."""

    number: int
    """Counted from 0."""
    name: str
    north_m: float
    east_m: float
    first_leg: int | None
    """First leg that leads here; ``null`` for the first waypoint."""


@dataclass(frozen=True, slots=True)
class OutlineLegView(View):
    """A leg of a design."""

    number: int
    waypoint: int
    """Waypoint that it leads to."""
    kind: PrimitiveKind
    start_ned: tuple[float, float, float]
    end_ned: tuple[float, float, float]
    duration_s: float
    energy: float


@dataclass(frozen=True, slots=True)
class OutlineViolationView(View):
    """One limit that a design breaks, and where."""

    field: str
    message: str
    waypoint: int | None
    leg: int | None
    place_ned: tuple[float, float, float] | None
    """Middle of the leg."""


@dataclass(frozen=True, slots=True)
class OutlineNoteView(View):
    """Something that the one who draws should know."""

    waypoint: int | None
    message: str


@dataclass(frozen=True, slots=True)
class OutlineAccountView(View):
    """What a design costs, the way there included."""

    energy: float
    energy_wh: float | None
    """Of the battery, as it is learned; by the vehicle's model alone while the robot has not said
    what its battery has left, ``null`` where the vehicle is not known."""
    duration_s: float
    distance_m: float
    """Along the legs, horizontally."""
    surfacings: int
    worst_std_m: float
    """Greatest standard deviation of the position between two surfacings."""
    satellite_bytes: int
    """What the robot says by satellite at its surfacings, where there is no radio."""
    credits: int | None
    """Satellite credits of sending the design once; ``null`` if it is too long for satellite."""
    battery_left: float | None
    """Part of a full battery that the robot said was left; ``null`` where it said nothing."""
    battery_after: BatteryAfterView | None
    """What is left at its end; ``null`` where the robot never said what it has, or its vehicle is
    not known."""


@dataclass(frozen=True, slots=True)
class OutlineView(View):
    """A design laid out: what the robot would fly, what that costs, what speaks against it."""

    waypoints: list[OutlineWaypointView]
    legs: list[OutlineLegView]
    way_there: WayThereView | None
    """``null`` where the robot has not said where it is, or is there."""
    account: OutlineAccountView | None
    """``null`` for a design without legs."""
    violations: list[OutlineViolationView]
    notes: list[OutlineNoteView]
    spacing_m: float
    """Spacing of a pattern that says none."""
    usual_deep_m: float
    """Deep turn of a manner that says none."""
    usual_angle_rad: float
    """Glide angle of a manner that says none."""


@dataclass(frozen=True, slots=True)
class FieldChangeView(View):
    """A part of a document that differs between two."""

    path: str
    """JSON pointer."""
    title: str
    first: str | None
    """As a person reads it; ``null`` where it is not there."""
    second: str | None


@dataclass(frozen=True, slots=True)
class LegChangeView(View):
    """A leg of one or both of two ways, in order."""

    change: Change
    first: int | None
    """Its number in the first, counted from 0."""
    second: int | None
    moved_m: float | None
    """How far its end lies from where it was."""
    message: str
    """What differs, for a person; "" where nothing does."""


@dataclass(frozen=True, slots=True)
class DifferenceView(View):
    """How two designs, or what is on board, differ."""

    first: str
    second: str
    fields: list[FieldChangeView]
    """Empty beside a plan, which has legs and no document."""
    legs: list[LegChangeView]
    first_legs: list[OutlineLegView]
    second_legs: list[OutlineLegView]


class TemplateParameter(Body):
    """A number that whoever begins from a template says."""

    key: str = Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")
    """Names the parameter in the design."""
    title: str = Field(min_length=1, max_length=60)
    """What the form calls it."""
    unit: str = Field(default="", max_length=20)
    """Unit that stands beside the number; empty for none."""
    default: float | None = None
    """``null``: it must be said."""
    low: float | None = None
    """Smallest that may be said."""
    high: float | None = None
    """Greatest that may be said."""
    paths: list[str] = Field(min_length=1, max_length=64)
    """JSON pointers to the numbers of the document that it sets."""


@dataclass(frozen=True, slots=True)
class TemplateView(View):
    """A document with parameters."""

    id: str
    name: str
    document: Design
    parameters: list[TemplateParameter]
    by: str
    at: datetime


class NewDesign(Body):
    """A new design: from a document, another design, a plan, or a template; else empty."""

    name: str = Field(min_length=1, max_length=80)
    """What lists call it."""
    document: Design | None = None
    """The design."""
    design: str | None = None
    """Id of a design that is copied."""
    version: int | None = None
    """Of that design; by default its working document."""
    shift_north_m: float = Field(default=0.0, ge=-1e6, le=1e6, allow_inf_nan=False)
    """How far a copy or a plan is shifted."""
    shift_east_m: float = Field(default=0.0, ge=-1e6, le=1e6, allow_inf_nan=False)
    """How far the copy lies to the east, m."""
    plan: str | None = None
    """Id of a plan, of whatever state, that is opened again."""
    template: str | None = None
    """Id of a template."""
    values: dict[str, float] = Field(default_factory=dict)
    """Of the template's parameters."""


class DocumentChange(Body):
    """A changed document."""

    document: Design
    """The design as it is after the change."""
    what: str = Field(min_length=1, max_length=120)
    """What was changed, for whoever undoes it."""


class Saving(Body):
    """What is said of a version."""

    comment: str = Field(default="", max_length=500)
    """What this version is; empty for nothing."""


class Restoring(Body):
    """Which version becomes the working document."""

    version: int = Field(ge=1)
    """Number of the version that the design is to be again."""


class Renaming(Body):
    """A design's name, or whether it is put away."""

    name: str | None = Field(default=None, min_length=1, max_length=80)
    """What lists call it."""
    is_archived: bool | None = None
    """Whether lists leave it out."""


class Checking(Body):
    """A document that is only looked at."""

    document: Design
    """The design as it is drawn."""


class Planning(Body):
    """Which version becomes a plan."""

    version: int | None = Field(default=None, ge=1)
    """By default the working document, saved as a version if it is none yet."""


class NewTemplate(Body):
    """A template."""

    name: str = Field(min_length=1, max_length=80)
    """What lists call it."""
    document: Design
    """The design with which others begin."""
    parameters: list[TemplateParameter] = Field(default_factory=list, max_length=32)
    """What is asked for each time."""
