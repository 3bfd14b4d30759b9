"""Places of a file in the frame of a water, where asked for moved into its middle."""

import math
from collections.abc import Sequence

import numpy as np

from autonomy.frames import ned_from_wgs84
from autonomy.outline import first_crossing
from autonomy.site import Site
from robot_link.service.item_place import ItemWater
from server.plan_file.proposal import (
    AreaRole,
    Findings,
    LatitudeLongitude,
    MarkKind,
    NorthEast,
    ReadArea,
    ReadChoices,
    ReadMark,
)

REACH_M = 1_000_000.0
"""A design holds places up to so far from the origin of its water."""
_CORNERS_MAX = 5_000


class Placement:
    """Where the places of one file lie in one water.

    Args:
        site: The water.
        choices: Whether the file is moved, and how high the water stands.
        middle_deg: Middle of the file's own places, on which a moved file turns; None without any.
    """

    def __init__(
        self, site: Site, choices: ReadChoices, middle_deg: LatitudeLongitude | None
    ) -> None:
        self._site = site
        self._shift = (0.0, 0.0)
        self._origin = (site.origin_latitude_deg, site.origin_longitude_deg)
        self.is_moved = choices.is_moved and middle_deg is not None
        if self.is_moved and middle_deg is not None:
            self._origin = middle_deg
            box = site.domain
            self._shift = (0.5 * (box.x_min_m + box.x_max_m), 0.5 * (box.y_min_m + box.y_max_m))
        altitude = choices.surface_altitude_m
        if altitude is None:
            altitude = 0.0 if site.kind == "sea" else site.surface_altitude_m
        is_charted = site.bathymetry is not None or site.chart is not None
        self.water = ItemWater(*self._origin, altitude, self._floor_m if is_charted else None)

    def _floor_m(self, north_m: float, east_m: float) -> float:
        """Return the depth of the floor at a place of the file's own frame."""
        return float(self._site.floor_m(*self.shifted((north_m, east_m))))

    def shifted(self, place: NorthEast) -> NorthEast:
        """Return where a place of the file's own frame lies in the water's."""
        return place[0] + self._shift[0], place[1] + self._shift[1]

    def unshifted(self, at: LatitudeLongitude) -> NorthEast:
        """Return where a place of the globe lies in the file's own frame."""
        north, east = self.place(*at)
        return north - self._shift[0], east - self._shift[1]

    def place(self, latitude_deg: float, longitude_deg: float) -> NorthEast:
        """Return where a place of the globe lies in the water's frame."""
        return self.places([(latitude_deg, longitude_deg)])[0]

    def places(self, corners: Sequence[LatitudeLongitude]) -> list[NorthEast]:
        """Return where places of the globe lie in the water's frame."""
        if not corners:
            return []
        latitude, longitude = np.array(corners, dtype=np.float64).T
        found = ned_from_wgs84(latitude, longitude, *self._origin) + np.array(self._shift)
        return [(north, east) for north, east in found.tolist()]

    def is_near(self, place: NorthEast) -> bool:
        """Tell whether a place is in the water's box."""
        return self._site.water.contains(*place, 0.0)

    def away(self, place: NorthEast) -> str:
        """Say how far a place is from the water."""
        return f"{distance_words(math.hypot(*place))} from {self._site.name}"


def distance_words(distance_m: float) -> str:
    """Return a distance as people say it."""
    return f"{distance_m / 1e3:,.0f} km" if distance_m >= 10_000.0 else f"{distance_m:,.0f} m"


def middle_of(places: Sequence[LatitudeLongitude]) -> LatitudeLongitude | None:
    """Return the middle of the bounds of places that are some."""
    real = [
        (a, b) for a, b in places if abs(a) <= 90.0 and abs(b) <= 180.0 and (a, b) != (0.0, 0.0)
    ]
    if not real:
        return None
    latitude, longitude = np.array(real).T
    return (
        0.5 * float(latitude.min() + latitude.max()),
        0.5 * float(longitude.min() + longitude.max()),
    )


def add_area(
    findings: Findings,
    placement: Placement,
    place: str,
    role: AreaRole,
    ring: Sequence[LatitudeLongitude],
    name: str = "",
    note: str = "",
) -> ReadArea | None:
    """Note a polygon, or why it is none; its area is by shoelace in the plane at its middle."""
    corners = [at for number, at in enumerate(ring) if at != ring[number - 1]]
    flaw = _flaw(corners)
    if flaw:
        findings.refuse(place, f"polygon of {len(ring)} corners", flaw)
        return None
    latitude, longitude = np.array(corners).T
    plane = ned_from_wgs84(latitude, longitude, latitude.mean(), longitude.mean())
    crossing = first_crossing(plane)
    if crossing is not None:
        reason = (
            f"crosses itself: the side after corner {crossing[0] + 1}"
            f" meets the side after corner {crossing[1] + 1}"
        )
        findings.refuse(place, f"polygon of {len(ring)} corners", reason)
        return None
    north, east = plane.T
    sides = np.roll(plane, -1, axis=0) - plane
    area = ReadArea(
        number=len(findings.areas) + 1,
        name=name,
        role=role,
        corners_deg=tuple(corners),
        corners_m=tuple(placement.places(corners)),
        area_m2=0.5 * abs(float(north @ np.roll(east, -1) - east @ np.roll(north, -1))),
        circumference_m=float(np.hypot(*sides.T).sum()),
        note=note,
    )
    findings.areas.append(area)
    return area


def _flaw(corners: Sequence[LatitudeLongitude]) -> str:
    if len(set(corners)) < 3:
        return "a polygon needs three corners"
    if len(corners) > _CORNERS_MAX:
        return f"more corners than the {_CORNERS_MAX:,} taken"
    for latitude, longitude in corners:
        if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
            return f"{latitude:g}, {longitude:g} are no latitude and longitude"
        if latitude == 0.0 and longitude == 0.0:
            return "latitude 0, longitude 0 stands for no place"
    return ""


def add_mark(
    findings: Findings,
    placement: Placement,
    place: str,
    kind: MarkKind,
    at: LatitudeLongitude,
    name: str,
    note: str = "",
) -> None:
    """Note a place that is not flown to, or why it is none."""
    flaw = _flaw([at, (1.0, 1.0), (2.0, 2.0), (3.0, 3.0)])
    if flaw:
        findings.refuse(place, f"{at[0]:g}, {at[1]:g}", flaw)
        return
    where = placement.place(*at)
    away = "" if placement.is_near(where) else placement.away(where)
    words = ", ".join(word for word in (note, away) if word)
    findings.marks.append(ReadMark(name, kind, at, where, words))
