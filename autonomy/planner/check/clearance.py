"""How far a way stays from shores, keep-outs and the floor, exactly."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.outline import Outline
from autonomy.planner.leg import drift
from autonomy.planner.plan import Leg, PrimitiveKind
from autonomy.site import Area, Site

_CHORD_RAD = 0.02
_PAIRS_MAX = 1_000_000
"""Corners of a way times sides of an outline that are compared at once."""
_ENDS = 2
"""Corners of a straight way."""
_FLOOR_POINTS = 9
"""Places between two lines of the bathymetry at which a way is compared with the floor."""


@dataclass(frozen=True, slots=True)
class FloorContact:
    """Where a way is nearest to the floor, or deepest under it."""

    clearance_m: float
    """Height above the floor, negative under it."""
    floor_m: float
    north_m: float
    east_m: float


def true_way(leg: Leg, course: drift.Course) -> FloatArray:
    """Return corners of the way that a robot really takes on a leg, shape ``(m, 3)``, m."""
    chords = 1
    if leg.kind is PrimitiveKind.SPIRAL:
        chords = max(int(np.ceil(abs(leg.turn_rad) / _CHORD_RAD)), 1)
    parts = np.linspace(0.0, 1.0, chords + 1)
    return np.array([drift.position_at(leg, course, float(part)) for part in parts])


def clearance_m(area: Area | Outline, way: FloatArray, within_m: float = math.inf) -> float:
    """Return the least horizontal distance between a way and an area's outline, 0 if they meet.

    Args:
        area: The area.
        way: Corners of the way, shape ``(m, 2)`` or more columns.
        within_m: Distance beyond which the answer may be infinite; the nearer, the faster.
    """
    outline = area.outline if isinstance(area, Area) else area
    low, high = way[:, :2].min(axis=0), way[:, :2].max(axis=0)
    corners, following = outline.sides_near(low - within_m, high + within_m)
    if not len(corners):
        return math.inf
    begins, ends = way[:-1, :2], way[1:, :2]
    least = math.inf
    for part in np.array_split(np.arange(len(corners)), -(-len(corners) * len(way) // _PAIRS_MAX)):
        one, other = corners[part], following[part]
        if _meet(begins, ends, one, other):
            return 0.0
        tips = np.concatenate([one, other])
        least = min(
            least,
            float(_distance(way[:, :2], one, other).min()),
            float(_distance(tips, begins, ends).min()),
        )
    return least


def nearest_m(area: Area | Outline, way: FloatArray, side: float) -> float:
    """Return how near a way comes to an outline; not above 0 if it crosses that.

    Args:
        area: What to keep away from.
        way: Corners of the way, shape ``(m, 2)`` or more columns.
        side: 1 if the way must stay outside, -1 if inside.
    """
    outline = area.outline if isinstance(area, Area) else area
    extent = float(np.ptp(outline.begins, axis=0).max()) + float(np.ptp(way[:, :2], axis=0).max())
    reach, distance = extent / 256.0, math.inf
    while distance > reach and reach < 512.0 * extent:
        distance = clearance_m(outline, way, reach)
        reach *= 4.0
    is_wrong = outline.contains(way[:, 0], way[:, 1]) == (side > 0.0)
    if is_wrong.any():
        beyond = way[is_wrong]
        return min(distance, -float(np.abs(outline.distance_m(beyond[:, 0], beyond[:, 1])).max()))
    return distance


def floor_contact(site: Site, way: FloatArray) -> FloorContact:
    """Return where a way is nearest to the floor.

    Args:
        site: The floor.
        way: Corners of the way, shape ``(m, 3)``; those of a bend must lie close to each other.
    """
    track = way
    if len(way) == _ENDS:
        parts = _parts_over_lines(site, way[0], way[1])
        track = way[0] + parts[:, None] * (way[1] - way[0])  # (p, 3)
    floor = site.floor_m(track[:, 0], track[:, 1])
    above = floor - track[:, 2]
    i = int(above.argmin())
    return FloorContact(float(above[i]), float(floor[i]), float(track[i, 0]), float(track[i, 1]))


def _parts_over_lines(site: Site, begin: FloatArray, end: FloatArray) -> FloatArray:
    """Return the parts (0..1) of a piece at which to look: in and between crossed lines."""
    crossings = [np.array([0.0, 1.0])]
    for axis, lines in enumerate(site.depth_lines or ()):
        change = end[axis] - begin[axis]
        if change != 0.0:
            parts = (lines - begin[axis]) / change
            crossings.append(parts[(parts > 0.0) & (parts < 1.0)])
    crossed = np.unique(np.concatenate(crossings))
    shares = np.linspace(0.0, 1.0, _FLOOR_POINTS)
    between = crossed[:-1, None] + shares * np.diff(crossed)[:, None]
    return np.unique(between)


def _distance(points: FloatArray, begins: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the distances of points (p, 2) from segments (s, 2), shape ``(p, s)``."""
    along = ends - begins
    length = np.maximum((along**2).sum(axis=1), 1e-300)
    offset = points[:, None, :] - begins[None]  # (p, s, 2)
    part = np.clip((offset * along).sum(axis=2) / length, 0.0, 1.0)
    return np.hypot(*np.moveaxis(offset - part[:, :, None] * along, 2, 0))


def _meet(begins: FloatArray, ends: FloatArray, others: FloatArray, closes: FloatArray) -> bool:
    """Tell whether any of the first segments crosses any of the others."""

    def turns(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        ab, ac = (b - a), (c - a)
        return ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]

    a, b = begins[:, None, :], ends[:, None, :]
    c, d = others[None], closes[None]
    return bool(
        ((turns(a, b, c) * turns(a, b, d) < 0.0) & (turns(c, d, a) * turns(c, d, b) < 0.0)).any()
    )
