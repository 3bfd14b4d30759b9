"""Where a robot works: the water body, its frame, and the part of it that may be explored."""

import itertools
import math
from typing import Annotated, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator, model_validator

from autonomy.arrays import BoolArray, FloatArray
from autonomy.configuration import Configuration, quantity

NorthEast = tuple[float, float]
"""North and east in the site's frame, m."""

_CORNERS_MIN = 3
_CORNERS_MAX = 64
_LINES_MIN = 2
_LINES_MAX = 256
_THICKNESS_MIN = 1e-6
"""Least area of a polygon, as a share of the square of its circumference."""

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
    corners_m: tuple[NorthEast, ...] = quantity(..., "m", title="Corners (north, east)")
    """Corners one after the other along the outline, 3 to 64, in the site frame. The last is
    joined to the first; the sides must not cross each other."""

    @field_validator("corners_m")
    @classmethod
    def _is_simple(cls, corners: tuple[NorthEast, ...]) -> tuple[NorthEast, ...]:
        if not _CORNERS_MIN <= len(corners) <= _CORNERS_MAX:
            raise ValueError(
                f"corners_m needs {_CORNERS_MIN} to {_CORNERS_MAX} corners, not {len(corners)}"
            )
        sides = _sides(np.array(corners))
        lengths = np.hypot(*(sides[1] - sides[0]).T)
        if not lengths.all():
            number = int(lengths.argmin()) + 1
            raise ValueError(
                f"corners_m has the same corner twice in a row, number {number}"
                " (the last is joined to the first without repeating it)"
            )
        for i, j in itertools.combinations(range(len(corners)), 2):
            are_neighbours = j == i + 1 or (i == 0 and j == len(corners) - 1)
            if not are_neighbours and _cross(sides[:, i], sides[:, j]):
                raise ValueError(
                    f"corners_m crosses itself: the side after corner {i + 1}"
                    f" meets the side after corner {j + 1}"
                )
        north, east = np.array(corners).T
        area = 0.5 * abs(float(north @ np.roll(east, -1) - east @ np.roll(north, -1)))
        if area < _THICKNESS_MIN * float(lengths.sum()) ** 2:
            raise ValueError("corners_m encloses no area: all its corners lie on one line")
        return corners

    def contains(self, north_m: npt.ArrayLike, east_m: npt.ArrayLike) -> BoolArray:
        """Tell which points lie inside the outline.

        Args:
            north_m: Northings, any shape.
            east_m: Eastings, of a shape that goes with it.
        """
        x, y = np.broadcast_arrays(np.asarray(north_m, float), np.asarray(east_m, float))
        inside = np.zeros(x.shape, dtype=np.bool_)
        for (x0, y0), (x1, y1) in zip(*_sides(np.array(self.corners_m)), strict=True):
            if y0 != y1:
                spans = (y0 <= y) != (y1 <= y)
                inside ^= spans & (x < x0 + (y - y0) * ((x1 - x0) / (y1 - y0)))
        return inside

    def distance_m(self, north_m: npt.ArrayLike, east_m: npt.ArrayLike) -> FloatArray:
        """Return how far points are from the outline, positive outside and negative inside.

        Args:
            north_m: Northings, any shape.
            east_m: Eastings, of a shape that goes with it.
        """
        x, y = np.broadcast_arrays(np.asarray(north_m, float), np.asarray(east_m, float))
        squared = np.full(x.shape, np.inf)
        for (x0, y0), (x1, y1) in zip(*_sides(np.array(self.corners_m)), strict=True):
            dx, dy = x1 - x0, y1 - y0
            part = np.clip(((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
            squared = np.minimum(squared, (x - x0 - part * dx) ** 2 + (y - y0 - part * dy) ** 2)
        return np.where(self.contains(x, y), -1.0, 1.0) * np.sqrt(squared)


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
        i, along = _between_lines(np.array(self.north_m), np.asarray(north_m, float))
        j, across = _between_lines(np.array(self.east_m), np.asarray(east_m, float))
        south = depth[i, j] + across * (depth[i, j + 1] - depth[i, j])
        north = depth[i + 1, j] + across * (depth[i + 1, j + 1] - depth[i + 1, j])
        return np.asarray(south + along * (north - south))


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
    """The field that a survey maps here, a key of ``autonomy.field.variable``."""
    shoreline: Area | None = None
    """Outline of the water inside of the box; without one the box is all water."""
    bathymetry: Bathymetry | None = None
    """Depth of the floor; without one the floor is flat, as deep as the box."""

    def floor_m(self, north_m: npt.ArrayLike, east_m: npt.ArrayLike) -> FloatArray:
        """Return the depth of the floor, never deeper than the box of water, 0 or less on land.

        Args:
            north_m: Northings, any shape.
            east_m: Eastings, of a shape that goes with it.
        """
        deepest = self.water.depth_max_m
        if self.bathymetry is None:
            shape = np.broadcast_shapes(np.shape(north_m), np.shape(east_m))
            return np.full(shape, deepest)
        return np.minimum(self.bathymetry.floor_m(north_m, east_m), deepest)

    def clearance_m(self, north_m: float, east_m: float) -> float:
        """Return how far one point of the surface is from the nearest wall or shore.

        Without arrays, for a robot that asks ten times a second about a few points.

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
        if self.shoreline is None:
            return to_wall
        return min(to_wall, _depth_within(self.shoreline.corners_m, north_m, east_m))


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


def _sides(corners: FloatArray) -> FloatArray:
    """Return where each side begins and ends, shape ``(2, n, 2)``."""
    return np.stack([corners, np.roll(corners, -1, axis=0)])


def _cross(first: FloatArray, second: FloatArray) -> bool:
    """Tell whether two segments, shape ``(2, 2)`` each, have a point in common."""
    a, b = first
    c, d = second
    if (np.maximum(a, b) < np.minimum(c, d)).any() or (np.maximum(c, d) < np.minimum(a, b)).any():
        return False
    return _turn(a, b, c) * _turn(a, b, d) <= 0.0 and _turn(c, d, a) * _turn(c, d, b) <= 0.0


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    """Return the sign of the turn from the way a-b to the way a-c; 0 on one line."""
    return float(np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])))


def _between_lines(
    lines: FloatArray, values: FloatArray
) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """Return the line below each value, and how far (0..1) the value is on to the next."""
    below = np.clip(np.searchsorted(lines, values, side="right") - 1, 0, len(lines) - 2)
    part = (values - lines[below]) / (lines[below + 1] - lines[below])
    return below, np.clip(part, 0.0, 1.0)


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
