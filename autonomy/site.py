"""Where a robot works: the water body, its frame, and the part of it that may be explored."""

import itertools
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator, model_validator

from autonomy.arrays import BoolArray, FloatArray
from autonomy.chart import CHARTS, Chart, between_lines
from autonomy.configuration import Configuration, quantity
from autonomy.frames import ned_from_wgs84, wgs84_from_ned
from autonomy.outline import Outline, first_crossing

NorthEast = tuple[float, float]
"""North and east in the site's frame, m."""

_FAR_M = 20_100_000.0
"""No place on Earth is farther from another along the surface."""
_Reach = Annotated[float, Field(ge=-_FAR_M, le=_FAR_M)]

_CORNERS_MIN = 3
CORNERS_MAX = 256
"""Corners of an outline that a document holds; longer ones are kept as charts."""
_LINES_MIN = 2
_LINES_MAX = 256
_THICKNESS_MIN = 1e-6
"""Least area of a polygon, as a share of the square of its circumference."""
_AREAS_MAX = 64
_PLACES_MAX = 500
_SAME_PLACE_M = 1.0
"""A place's two positions may differ by so much."""
_ORIGIN = ("origin_latitude_deg", "origin_longitude_deg")

Lines = Annotated[tuple[float, ...], Field(min_length=_LINES_MIN, max_length=_LINES_MAX)]


class Box(Configuration):
    """An axis-aligned box in the site's NED frame; depth is positive down from the surface."""

    x_min_m: float = quantity(0.0, "m", title="South edge (x)")
    """Smallest northing of the box in the site frame."""
    x_max_m: float = quantity(2.75, "m", title="North edge (x)")
    """Largest northing of the box in the site frame."""
    y_min_m: float = quantity(0.0, "m", title="West edge (y)")
    """Smallest easting of the box in the site frame."""
    y_max_m: float = quantity(1.37, "m", title="East edge (y)")
    """Largest easting of the box in the site frame."""
    depth_max_m: float = quantity(0.65, "m", title="Deepest", gt=0.0)
    """Greatest depth; the box always begins at the surface."""

    @model_validator(mode="after")
    def _has_volume(self) -> Self:
        if self.x_max_m <= self.x_min_m:
            raise ValueError("x_max_m must exceed x_min_m")
        if self.y_max_m <= self.y_min_m:
            raise ValueError("y_max_m must exceed y_min_m")
        return self

    def contains(self, x_m: float, y_m: float, z_m: float, margin_m: float = 0.0) -> bool:
        """Tell whether a point is inside the box, or within ``margin_m`` outside of it."""
        return (
            self.x_min_m - margin_m <= x_m <= self.x_max_m + margin_m
            and self.y_min_m - margin_m <= y_m <= self.y_max_m + margin_m
            and -margin_m <= z_m <= self.depth_max_m + margin_m
        )

    def is_inside(self, outer: "Box") -> bool:
        """Tell whether no part of this box leaves ``outer``."""
        return outer.contains(self.x_min_m, self.y_min_m, 0.0) and outer.contains(
            self.x_max_m, self.y_max_m, self.depth_max_m
        )


class Area(Configuration):
    """A part of the surface with a name and straight sides: a lake's outline, or a keep-out."""

    name: str = Field(min_length=1, max_length=60, title="Name")
    """What operators call it; sentences about a plan name it."""
    corners_m: tuple[tuple[_Reach, _Reach], ...] = quantity(..., "m", title="Corners (north, east)")
    """Corners one after the other along the outline, 3 to 256, in the site frame. The last is
    joined to the first; the sides must not cross each other."""

    @field_validator("corners_m")
    @classmethod
    def _is_simple(cls, corners: tuple[NorthEast, ...]) -> tuple[NorthEast, ...]:
        if not _CORNERS_MIN <= len(corners) <= CORNERS_MAX:
            raise ValueError(
                f"corners_m needs {_CORNERS_MIN} to {CORNERS_MAX} corners, not {len(corners)}"
            )
        ring = np.array(corners)
        lengths = np.hypot(*(np.roll(ring, -1, axis=0) - ring).T)
        if not lengths.all():
            number = int(lengths.argmin()) + 1
            raise ValueError(
                f"corners_m has the same corner twice in a row, number {number}"
                " (the last is joined to the first without repeating it)"
            )
        crossing = first_crossing(ring)
        if crossing is not None:
            raise ValueError(
                f"corners_m crosses itself: the side after corner {crossing[0] + 1}"
                f" meets the side after corner {crossing[1] + 1}"
            )
        north, east = ring.T
        area = 0.5 * abs(float(north @ np.roll(east, -1) - east @ np.roll(north, -1)))
        if area < _THICKNESS_MIN * float(lengths.sum()) ** 2:
            raise ValueError("corners_m encloses no area: all its corners lie on one line")
        return corners

    @property
    def outline(self) -> Outline:
        """The corners as geometry."""
        return _outline_of((self.corners_m,))

    def contains(self, north_m: npt.ArrayLike, east_m: npt.ArrayLike) -> BoolArray:
        """Tell which points lie inside the outline.

        Args:
            north_m: Northings, any shape.
            east_m: Eastings, of a shape that goes with it.
        """
        return self.outline.contains(north_m, east_m)

    def distance_m(self, north_m: npt.ArrayLike, east_m: npt.ArrayLike) -> FloatArray:
        """Return how far points are from the outline, positive outside and negative inside.

        Args:
            north_m: Northings, any shape.
            east_m: Eastings, of a shape that goes with it.
        """
        return self.outline.distance_m(north_m, east_m)


@lru_cache(maxsize=64)
def _outline_of(rings: tuple[tuple[NorthEast, ...], ...]) -> Outline:
    return Outline([np.array(ring) for ring in rings])


class Bathymetry(Configuration):
    """Depth of the floor at the crossings of north and east lines, bilinear in between."""

    north_m: Lines = quantity(..., "m", title="North lines")
    """Northings of the lines, ascending, 2 to 256."""
    east_m: Lines = quantity(..., "m", title="East lines")
    """Eastings of the lines, ascending, 2 to 256."""
    depth_m: tuple[tuple[float, ...], ...] = quantity(..., "m", title="Depths")
    """Depth of the floor below the surface: a row for each north line, in it a depth for each
    east line; 0 or less on land."""

    @field_validator("north_m", "east_m")
    @classmethod
    def _ascends(cls, lines: tuple[float, ...]) -> tuple[float, ...]:
        for before, after in itertools.pairwise(lines):
            if after <= before:
                raise ValueError(f"lines must ascend, but {after:g} m follows {before:g} m")
        return lines

    @model_validator(mode="after")
    def _is_rectangular(self) -> Self:
        rows, columns = len(self.north_m), len(self.east_m)
        if len(self.depth_m) != rows:
            raise ValueError(
                f"depth_m needs {rows} rows, one a north line, not {len(self.depth_m)}"
            )
        for number, row in enumerate(self.depth_m, start=1):
            if len(row) != columns:
                raise ValueError(
                    f"row {number} of depth_m needs {columns} depths, one an east line,"
                    f" not {len(row)}"
                )
        return self

    def floor_m(self, north_m: npt.ArrayLike, east_m: npt.ArrayLike) -> FloatArray:
        """Return the floor's depth; beyond the outermost lines it goes on as it is there.

        Args:
            north_m: Northings, any shape.
            east_m: Eastings, of a shape that goes with it.
        """
        depth = np.array(self.depth_m)
        i, along = between_lines(np.array(self.north_m), np.asarray(north_m, float))
        j, across = between_lines(np.array(self.east_m), np.asarray(east_m, float))
        south = depth[i, j] + across * (depth[i, j + 1] - depth[i, j])
        north = depth[i + 1, j] + across * (depth[i + 1, j + 1] - depth[i + 1, j])
        return np.asarray(south + along * (north - south))


class Place(Configuration):
    """A place of a water that has a name.

    One who writes it may leave out latitude and longitude, or north and east.
    """

    name: str = Field(min_length=1, max_length=60, title="Name")
    """What operators call it."""
    kind: Literal["dock", "beacon", "receiver", "landmark"] = "landmark"
    """What is there."""
    latitude_deg: float = quantity(..., "deg", title="Latitude", ge=-90.0, le=90.0)
    """WGS84 latitude."""
    longitude_deg: float = quantity(..., "deg", title="Longitude", ge=-180.0, le=180.0)
    """WGS84 longitude."""
    north_m: float = quantity(..., "m", title="North")
    """Northing in the site frame."""
    east_m: float = quantity(..., "m", title="East")
    """Easting in the site frame."""
    depth_m: float = quantity(0.0, "m", title="Depth", ge=0.0, le=12_000.0)
    """Depth below the surface."""


class ChartSummary(Configuration):
    """What is kept of a water as a chart, beside its document (``autonomy.chart``)."""

    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    """Name of the chart: what its content gives."""
    corners: int = Field(ge=0)
    """Corners of the shoreline and the islands; 0 without an outline."""
    islands: int = Field(ge=0)
    """Islands in the shoreline."""
    rows: int = Field(ge=0)
    """North lines of the depth grid; 0 without one."""
    columns: int = Field(ge=0)
    """East lines of the depth grid."""
    spacing_m: float = Field(ge=0.0)
    """Largest distance between two lines; 0 without a depth grid."""


class Site(Configuration):
    """A water body with a local NED frame; the frame's origin lies at the surface."""

    name: str
    """What operators call the place."""
    kind: Literal["tank", "lake", "sea"]
    """Shape of the surroundings in the 3D view; walls exist in a tank only."""
    water: Box
    """All the water: walls or shore, and the floor. No plan may leave it."""
    domain: Box
    """The part to explore: the default domain of a survey."""
    origin_latitude_deg: float
    """WGS84 latitude of the frame's origin."""
    origin_longitude_deg: float
    """WGS84 longitude of the frame's origin."""
    radio_under_water: bool
    """Whether radio reaches a submerged robot (a shallow tank) or only a surfaced one."""
    variable: str
    """The field that a survey maps here, a key of the catalogue of channels."""
    shoreline: Area | None = None
    """Outline of the water inside of the box; without one the box is all water. Beside a chart a
    simpler one that leaves the chart's water nowhere."""
    bathymetry: Bathymetry | None = None
    """Depth of the floor; without one the floor is flat, as deep as the box. Beside a chart a
    coarser one that is nowhere deeper."""
    islands: Annotated[tuple[Area, ...], Field(max_length=_AREAS_MAX)] = ()
    """Land inside of the shoreline, at most 64 areas."""
    keep_outs: Annotated[tuple[Area, ...], Field(max_length=_AREAS_MAX)] = ()
    """Where no robot may plan to be, whatever the survey, at most 64 areas."""
    places: Annotated[tuple[Place, ...], Field(max_length=_PLACES_MAX)] = ()
    """Docks, beacons, receivers and landmarks, at most 500."""
    depth_datum: str = Field(default="", max_length=200)
    """In words, what the depths count from, such as ``mean lower low water``."""
    tide_offset_m: float = Field(default=0.0, ge=-20.0, le=20.0)
    """How much higher the surface is taken to stand than the depths' datum, m: the floor is so
    much deeper than the depths say."""
    surface_altitude_m: float | None = Field(default=None, ge=-500.0, le=9000.0)
    """How high the surface stands above mean sea level, m, for files that tell altitudes; None
    where nobody said."""
    chart: ChartSummary | None = None
    """Outline and depths in full, where they are too large for this document."""

    @model_validator(mode="before")
    @classmethod
    def _with_both_positions(cls, value: Any) -> Any:  # noqa: ANN401 - whatever is validated
        """Give places that tell one kind of position the other."""
        if not isinstance(value, Mapping):
            return value
        places, origin = value.get("places"), [value.get(name) for name in _ORIGIN]
        if not isinstance(places, list | tuple) or not _are_numbers(origin):
            return value
        return {**value, "places": [_both_positions(place, origin) for place in places]}

    @model_validator(mode="after")
    def _has_different_names(self) -> Self:
        for field in ("islands", "keep_outs", "places"):
            names = [each.name for each in getattr(self, field)]
            twice = next((name for name in names if names.count(name) > 1), None)
            if twice is not None and field != "islands":
                raise ValueError(f"{field} must have different names, but two are {twice!r}")
        for number, place in enumerate(self.places):
            at = ned_from_wgs84(place.latitude_deg, place.longitude_deg, *self._origin)
            apart_m = math.dist(at.tolist(), (place.north_m, place.east_m))
            if apart_m > _SAME_PLACE_M:
                raise ValueError(
                    f"places.{number} ({place.name}) is at two places, {apart_m:.3g} m apart:"
                    " give latitude and longitude, or north and east"
                )
        return self

    @property
    def _origin(self) -> tuple[float, float]:
        return self.origin_latitude_deg, self.origin_longitude_deg

    @property
    def _charted(self) -> Chart | None:
        """The chart, where this process has it."""
        return None if self.chart is None else CHARTS.find(self.chart.sha256)

    @property
    def shore(self) -> Outline | None:
        """Shoreline and islands as well as they are known here; None where the box is the shore."""
        chart = self._charted
        if chart is not None and chart.shore is not None:
            return chart.shore
        if self.shoreline is None:
            return None
        return _outline_of((self.shoreline.corners_m, *(area.corners_m for area in self.islands)))

    @property
    def depth_lines(self) -> tuple[FloatArray, FloatArray] | None:
        """Northings and eastings between which the floor is bilinear; None where it is flat."""
        chart = self._charted
        if chart is not None and chart.depths is not None:
            return chart.depths.north_m, chart.depths.east_m
        if self.bathymetry is None:
            return None
        return np.array(self.bathymetry.north_m), np.array(self.bathymetry.east_m)

    def floor_m(self, north_m: npt.ArrayLike, east_m: npt.ArrayLike) -> FloatArray:
        """Return the depth of the floor, never deeper than the box of water, 0 or less on land.

        Args:
            north_m: Northings, any shape.
            east_m: Eastings, of a shape that goes with it.
        """
        deepest, chart = self.water.depth_max_m, self._charted
        depths = self.bathymetry if chart is None or chart.depths is None else chart.depths
        if depths is None:
            shape = np.broadcast_shapes(np.shape(north_m), np.shape(east_m))
            return np.full(shape, deepest)
        return np.minimum(depths.floor_m(north_m, east_m) + self.tide_offset_m, deepest)

    def clearance_m(self, north_m: float, east_m: float) -> float:
        """Return how far one point of the surface is from the nearest wall or shore.

        Without arrays where the outline is short, for a robot that asks ten times a second about
        a few points.

        Args:
            north_m: Its northing.
            east_m: Its easting.

        Returns:
            The distance, negative outside of the water.
        """
        box = self.water
        to_wall = min(
            north_m - box.x_min_m, box.x_max_m - north_m, east_m - box.y_min_m, box.y_max_m - east_m
        )
        chart = self._charted
        if chart is not None and chart.shore is not None:
            return min(to_wall, -float(chart.shore.distance_m(north_m, east_m)))
        if self.shoreline is None:
            return to_wall
        to_land = [_depth_within(area.corners_m, north_m, east_m) for area in self.islands]
        to_shore = _depth_within(self.shoreline.corners_m, north_m, east_m)
        return min(to_wall, to_shore, *(-inside for inside in to_land))


def _are_numbers(values: Sequence[object]) -> bool:
    return all(isinstance(value, int | float) and math.isfinite(value) for value in values)


def _both_positions(place: Any, origin: list[Any]) -> Any:  # noqa: ANN401 - whatever is validated
    """Return a place's fields with those that its others tell."""
    if not isinstance(place, Mapping):
        return place
    globe, frame = (
        [cast(Any, place.get(name)) for name in names]
        for names in (("latitude_deg", "longitude_deg"), ("north_m", "east_m"))
    )
    if frame == [None, None] and _are_numbers(globe):
        north, east = ned_from_wgs84(globe[0], globe[1], *origin).tolist()
        return {**place, "north_m": north, "east_m": east}
    if globe == [None, None] and _are_numbers(frame):
        latitude, longitude = wgs84_from_ned(frame, *origin).tolist()
        return {**place, "latitude_deg": latitude, "longitude_deg": longitude}
    return place


def _depth_within(corners: tuple[NorthEast, ...], x: float, y: float) -> float:
    """Return how far inside of an outline a point lies; negative outside."""
    squared, is_inside = math.inf, False
    x0, y0 = corners[-1]
    for x1, y1 in corners:
        dx, dy = x1 - x0, y1 - y0
        part = min(max(((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
        off_x, off_y = x - x0 - part * dx, y - y0 - part * dy
        squared = min(squared, off_x * off_x + off_y * off_y)
        if (y0 <= y) != (y1 <= y):
            is_inside ^= x < x0 + (y - y0) * dx / dy
        x0, y0 = x1, y1
    return math.sqrt(squared) if is_inside else -math.sqrt(squared)


TANK = Site(
    name="Test tank",
    kind="tank",
    water=Box(x_min_m=-0.925, x_max_m=3.675, y_min_m=-0.865, y_max_m=2.235, depth_max_m=1.2),
    domain=Box(),
    origin_latitude_deg=42.7251,
    origin_longitude_deg=-84.4791,
    radio_under_water=True,
    variable="blue_light",
)
"""The thesis's tank, 4.6 x 3.1 x 1.2 m, around its exploration domain (thesis 5.5.1)."""

_LAKE_SHORE: tuple[NorthEast, ...] = (
    (487.0, 259.0),
    (491.0, 332.0),
    (479.0, 400.0),
    (418.0, 454.0),
    (349.0, 485.0),
    (276.0, 488.0),
    (218.0, 484.0),
    (131.0, 485.0),
    (61.0, 452.0),
    (25.0, 404.0),
    (18.0, 314.0),
    (8.0, 247.0),
    (13.0, 180.0),
    (26.0, 106.0),
    (61.0, 37.0),
    (144.0, 16.0),
    (225.0, 13.0),
    (279.0, 17.0),
    (356.0, 17.0),
    (436.0, 34.0),
    (477.0, 110.0),
    (487.0, 173.0),
)
_LAKE_LINES_M = tuple(50.0 * line for line in range(11))
_LAKE_FLOOR_M = (
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 0.0, 8.0, 12.5, 14.5, 15.0, 13.5, 12.0, 9.5, 0.0, 0.0),
    (0.0, 9.0, 17.5, 18.5, 19.0, 19.0, 19.0, 19.0, 17.5, 8.0, 0.0),
    (0.0, 13.0, 18.5, 19.5, 19.5, 19.5, 19.5, 19.5, 18.5, 13.0, 0.0),
    (0.0, 13.5, 19.0, 19.5, 19.0, 19.0, 19.0, 19.0, 18.5, 13.0, 0.0),
    (0.0, 13.5, 19.0, 19.0, 19.0, 19.0, 19.0, 19.0, 18.5, 13.5, 0.0),
    (0.0, 12.5, 18.0, 17.5, 18.0, 18.5, 19.0, 19.0, 18.5, 14.0, 0.0),
    (0.0, 11.5, 14.5, 13.5, 15.0, 17.5, 19.0, 19.0, 18.5, 12.5, 0.0),
    (0.0, 8.0, 12.5, 12.0, 14.0, 17.5, 19.0, 19.0, 16.5, 5.0, 0.0),
    (0.0, 0.0, 6.5, 10.5, 12.5, 13.5, 14.5, 14.0, 8.5, 0.0, 0.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)
"""Steep shores, a basin of 19 m, and a shoal in the north-west that rises to 12 m."""

LAKE = Site(
    name="Practice lake",
    kind="lake",
    water=Box(x_min_m=0.0, x_max_m=500.0, y_min_m=0.0, y_max_m=500.0, depth_max_m=20.0),
    domain=Box(x_min_m=40.0, x_max_m=460.0, y_min_m=40.0, y_max_m=460.0, depth_max_m=16.0),
    origin_latitude_deg=42.7600,
    origin_longitude_deg=-84.3800,
    radio_under_water=False,
    variable="chlorophyll",
    shoreline=Area(name="Shore", corners_m=_LAKE_SHORE),
    bathymetry=Bathymetry(north_m=_LAKE_LINES_M, east_m=_LAKE_LINES_M, depth_m=_LAKE_FLOOR_M),
)
"""A lake of 500 x 500 x 20 m for GRACE 3 (field of the specification's synthetic chlorophyll)."""
