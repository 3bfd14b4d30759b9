"""A design: a mission as people work on it, before it becomes the legs of a plan.

A design says places and manners (waypoints, a pattern over an area, a line to repeat), not legs:
``way`` lays its waypoints out, ``glide_path`` turns those into glides and swims from wherever the
robot is. So a design never goes stale because an idle robot drifts.

Places are north and east in the frame of the design's water, metres; depths are positive down.
"""

from datetime import datetime
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from autonomy.channel import KEY_PATTERN
from autonomy.configuration import Configuration, quantity

WAYPOINTS_MAX = 500
"""Waypoints of one design, patterns laid out."""
REPEATS_MAX = 100
"""Of a section."""
_FAR_M = 1e6
_DEEP_M = 12_000.0
_RULES_MAX = 4
_KEEP_FAR_M, _KEEP_LONG_S = 10_000.0, 604_800.0
_CORNERS_MIN = 3
_CORNERS_MAX = 256
_TIMES_MAX = 100
_HALF_TURN_RAD = 1.5707963267948966


class Spot(Configuration):
    """A place at the surface."""

    north_m: float = quantity(..., "m", title="North", ge=-_FAR_M, le=_FAR_M)
    """Northing in the water's frame."""
    east_m: float = quantity(..., "m", title="East", ge=-_FAR_M, le=_FAR_M)
    """Easting in the water's frame."""

    @property
    def ne_m(self) -> tuple[float, float]:
        """North and east, m."""
        return self.north_m, self.east_m


Motion = Literal["glide", "swim"]


class Manner(Configuration):
    """How legs are flown unless a waypoint says otherwise."""

    motion: Motion = quantity("glide", title="Motion")
    """Glides between two depths, or swims along the surface."""
    shallow_m: float = quantity(0.0, "m", title="Shallow turn", ge=0.0, le=_DEEP_M)
    """Depth at which a climb turns into the next descent; 0 comes up to the surface each time."""
    deep_m: float | None = quantity(None, "m", title="Deep turn", gt=0.0, le=_DEEP_M)
    """Depth at which a descent turns into a climb, less where a leg is too short for it; by default
    as deep as the robot's surveys go."""
    glide_angle_rad: float | None = quantity(
        None, "rad", title="Glide angle", gt=0.0, lt=_HALF_TURN_RAD, display_unit="deg"
    )
    """Angle of the path below and above the horizon; by default the middle of what the planner
    allows the robot."""
    glide_speed_m_s: float | None = quantity(
        None, "m/s", title="Vertical speed of glides", gt=0.0, le=5.0
    )
    """By default the planner's for the robot."""
    swim_speed_m_s: float | None = quantity(None, "m/s", title="Swimming speed", gt=0.0, le=5.0)
    """By default the planner's for the robot."""
    floor_clearance_m: float | None = quantity(
        None, "m", title="Clearance above the floor", ge=0.0, le=_DEEP_M
    )
    """Deep turns stay so far above the floor under them; without it a design that is too deep is a
    violation."""

    @model_validator(mode="after")
    def _turns_in_order(self) -> Self:
        if self.deep_m is not None and self.shallow_m >= self.deep_m:
            raise ValueError("shallow_m must be less than deep_m")
        return self


class Waypoint(Spot):
    """A place to come to, and how."""

    name: str = Field(default="", max_length=60, title="Name")
    """What operators call it."""
    motion: Motion | None = quantity(None, title="Motion")
    """How the robot comes here; by default the design's."""
    shallow_m: float | None = quantity(None, "m", title="Shallow turn", ge=0.0, le=_DEEP_M)
    """On the way here; by default the design's."""
    deep_m: float | None = quantity(None, "m", title="Deep turn", gt=0.0, le=_DEEP_M)
    """On the way here; by default the design's."""
    glide_angle_rad: float | None = quantity(
        None, "rad", title="Glide angle", gt=0.0, lt=_HALF_TURN_RAD, display_unit="deg"
    )
    """On the way here; by default the design's."""
    speed_m_s: float | None = quantity(None, "m/s", title="Speed", gt=0.0, le=5.0)
    """On the way here: vertical in a glide, along the way in a swim; by default the design's."""
    surfaces: bool | None = quantity(None, title="Comes up here")
    """By default as the rules of surfacing say; a design ends at the surface in any case."""

    def manner(self, usual: Manner) -> Manner:
        """Return how the robot comes here.

        Raises:
            ValueError: If the shallow turn is not above the deep one.
        """
        own = {
            name: getattr(self, name)
            for name in ("motion", "shallow_m", "deep_m", "glide_angle_rad")
            if getattr(self, name) is not None
        }
        if self.speed_m_s is not None:
            is_swim = (self.motion or usual.motion) == "swim"
            own["swim_speed_m_s" if is_swim else "glide_speed_m_s"] = self.speed_m_s
        return Manner(**(usual.model_dump() | own))


class Way(Configuration):
    """Waypoints, one after the other."""

    kind: Literal["waypoints"] = "waypoints"
    """Names the kind of this document."""
    waypoints: Annotated[tuple[Waypoint, ...], Field(max_length=WAYPOINTS_MAX)] = ()
    """In order, at most 500."""
    returns: bool = quantity(False, title="Return to the first")
    """Whether the robot comes back to the first waypoint at the end."""


Corners = Annotated[tuple[Spot, ...], Field(min_length=_CORNERS_MIN, max_length=_CORNERS_MAX)]
Line = Annotated[tuple[Spot, ...], Field(min_length=2, max_length=_CORNERS_MAX)]
_SPACING = quantity(None, "m", title="Spacing", gt=0.0, le=_FAR_M)
_HEADING = quantity(0.0, "rad", title="Heading", ge=-7.0, le=7.0, display_unit="deg")


class Lawnmower(Configuration):
    """Parallel lines over an area, to and fro; cross-hatched with a second set across."""

    kind: Literal["lawnmower"] = "lawnmower"
    """Names the kind of this document."""
    area: Corners = Field(title="Area")
    """Corners of the area, 3 to 256."""
    spacing_m: float | None = _SPACING
    """Between two lines; by default the correlation length of the robot's map."""
    heading_rad: float = _HEADING
    """Of the first line."""
    is_crossed: bool = quantity(False, title="Cross-hatch")
    """Whether the area is covered once more, across."""


class ExpandingSquare(Configuration):
    """A square spiral outwards from a place: the search for something lost."""

    kind: Literal["expanding_square"] = "expanding_square"
    """Names the kind of this document."""
    centre: Spot
    """Where it begins."""
    spacing_m: float | None = _SPACING
    """Between two turns; by default the correlation length of the robot's map."""
    turns: int = quantity(3, title="Turns", ge=1, le=60)
    """Times around."""
    heading_rad: float = _HEADING
    """Of the first leg."""


class SpiralOut(Configuration):
    """A round spiral outwards from a place, in straight legs."""

    kind: Literal["spiral"] = "spiral"
    """Names the kind of this document."""
    centre: Spot
    """Where it begins."""
    spacing_m: float | None = _SPACING
    """Between two turns; by default the correlation length of the robot's map."""
    radius_m: float = quantity(..., "m", title="Radius", gt=0.0, le=_FAR_M)
    """Where it ends."""


class Star(Configuration):
    """Lines through a place at evenly spread headings."""

    kind: Literal["star"] = "star"
    """Names the kind of this document."""
    centre: Spot
    """Where the lines cross."""
    radius_m: float = quantity(..., "m", title="Radius", gt=0.0, le=_FAR_M)
    """Half the length of a line."""
    lines: int = quantity(3, title="Lines", ge=2, le=36)
    """How many."""
    heading_rad: float = _HEADING
    """Of the first line."""


class AlongLine(Configuration):
    """Along a line, and back beside it as often as asked."""

    kind: Literal["along_line"] = "along_line"
    """Names the kind of this document."""
    line: Line = Field(title="Line")
    """Corners of the line, 2 to 256."""
    passes: int = quantity(1, title="Passes", ge=1, le=50)
    """How often it is followed, to and fro."""
    spacing_m: float | None = _SPACING
    """Between two passes, to starboard of the line; by default the correlation length."""


class AlongIsobath(Configuration):
    """Along a line of equal depth of the floor, from where it is nearest to a place."""

    kind: Literal["along_isobath"] = "along_isobath"
    """Names the kind of this document."""
    depth_m: float = quantity(..., "m", title="Depth of the floor", gt=0.0, le=_DEEP_M)
    """Which isobath."""
    near: Spot
    """It begins where the isobath is nearest to this."""
    length_m: float = quantity(..., "m", title="Length", gt=0.0, le=_FAR_M)
    """How far it is followed; it ends earlier where the isobath does."""
    is_reversed: bool = quantity(False, title="The other way")
    """With the shallow side to port instead of to starboard."""


class Section(Configuration):
    """A line that is repeated: the classic section of oceanography."""

    kind: Literal["section"] = "section"
    """Names the kind of this document."""
    line: Line = Field(title="Line")
    """Corners of the line, 2 to 256."""
    repeats: int = quantity(2, title="Times", ge=1, le=REPEATS_MAX)
    """How often it is flown, each time the other way."""


class Mooring(Configuration):
    """A virtual mooring: profiles at one place, spiral down and up, for some time."""

    kind: Literal["mooring"] = "mooring"
    """Names the kind of this document."""
    place: Spot
    """Where."""
    duration_s: float = quantity(..., "s", title="Duration", gt=0.0, le=2_592_000.0)
    """How long, from the arrival; at least one profile is flown."""


class StationKeep(Configuration):
    """Staying near a place at the surface for some time."""

    kind: Literal["station_keep"] = "station_keep"
    """Names the kind of this document."""
    place: Spot
    """Where."""
    radius_m: float = quantity(..., "m", title="Radius", gt=0.0, le=_KEEP_FAR_M)
    """How far the robot may drift before it swims back."""
    duration_s: float = quantity(..., "s", title="Duration", gt=0.0, le=_KEEP_LONG_S)
    """How long, from the arrival."""


RELATIVE_ROWS = "rows"
"""Field of a reference whose places count from its own origin, not from the water's."""


class ReferenceRow(Spot):
    """A moment of a reference trajectory."""

    time_s: float = quantity(..., "s", title="Time", ge=0.0, le=2_592_000.0)
    """Since its beginning."""
    depth_m: float = quantity(..., "m", title="Depth", ge=0.0, le=_DEEP_M)
    """Positive down."""


class Reference(Configuration):
    """A trajectory in time, flown from turn to turn at the speeds that it asks for."""

    kind: Literal["reference"] = "reference"
    """Names the kind of this document."""
    shape: Literal["diagonal", "figure_of_eight", "rows"] = quantity("diagonal", title="Shape")
    """Thesis Eq. 3.21, Eq. 3.22 with its printed ``015`` read as 0.15, or rows of one's own."""
    origin: Spot
    """Where the origin of the reference lies in the water."""
    duration_s: float = quantity(225.0, "s", title="Duration", gt=0.0, le=86_400.0)
    """Of a shape of the thesis."""
    rows: Annotated[tuple[ReferenceRow, ...], Field(max_length=WAYPOINTS_MAX)] = ()
    """Of one's own, in order of time, 2 to 500; north and east from the origin."""

    @model_validator(mode="after")
    def _rows_ascend(self) -> Self:
        if self.shape == "rows" and len(self.rows) < 2:
            raise ValueError(f"rows needs at least 2 rows, not {len(self.rows)}")
        for number, (a, b) in enumerate(pairwise(self.rows), start=1):
            if b.time_s <= a.time_s:
                raise ValueError(f"rows.{number}.time_s must exceed the {a.time_s:g} s before it")
        return self


Content = Annotated[
    Way
    | Lawnmower
    | ExpandingSquare
    | SpiralOut
    | Star
    | AlongLine
    | AlongIsobath
    | Section
    | Mooring
    | StationKeep
    | Reference,
    Field(discriminator="kind"),
]


class ValueRule(Configuration):
    """A value of a channel that brings the robot up."""

    channel: str = Field(pattern=KEY_PATTERN, title="Channel")
    """Key of a channel of the catalogue that the robot measures."""
    side: Literal["above", "below"] = quantity("below", title="When it is")
    """On which side of the value the robot comes up."""
    value: float = quantity(..., title="Value", ge=-1e12, le=1e12)
    """In the channel's unit."""


class SurfacingRules(Configuration):
    """When the robot comes up between the beginning and the end."""

    at_waypoints: bool = quantity(True, title="At every waypoint")
    """A waypoint may say otherwise for itself."""
    every_s: float | None = quantity(None, "s", title="At least every", gt=0.0, le=2_592_000.0)
    """The robot comes up before it is under water for longer."""
    at_utc: Annotated[tuple[AwareDatetime, ...], Field(max_length=_TIMES_MAX)] = Field(
        default=(), title="At times (UTC)"
    )
    """The last climb before each of these leads to the surface."""
    max_uncertainty_m: float | None = quantity(
        None, "m", title="When its position is less certain than", gt=0.0, le=_FAR_M
    )
    """Standard deviation; by default the planner's for the robot."""
    samples_waiting: int | None = quantity(
        None, title="When so many samples wait", ge=1, le=1_000_000
    )
    """Samples that are not known to be stored ashore; kept by the robot itself."""
    on_value: Annotated[tuple[ValueRule, ...], Field(max_length=_RULES_MAX)] = Field(
        default=(), title="When a value is beyond a limit"
    )
    """At most 4; kept by the robot itself."""
    hold_off_s: float = quantity(600.0, "s", title="Then not again for", ge=0.0, le=86_400.0)
    """After waiting samples or a value brought the robot up, none of these rules does for so long.
    """

    @property
    def times(self) -> tuple[datetime, ...]:
        """Moments of ``at_utc``, ascending."""
        return tuple(sorted(self.at_utc))


class Design(Configuration):
    """What a version of a design says."""

    content: Content = Field(default_factory=Way)
    """What is flown."""
    manner: Manner = Manner()
    """How, unless a waypoint says otherwise."""
    surfacing: SurfacingRules = SurfacingRules()
    """When the robot comes up."""
