"""Where the waypoints of a pattern lie: pure geometry in the water's frame, north and east in m.

A heading is counted from north to starboard, so its direction is ``(cos, sin)`` in north and east.
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

NorthEast = tuple[float, float]

_CHORD_RAD = math.radians(40.0)
"""Angle between two corners of a spiral that is flown in straight legs."""
_CLOSE_M = 1e-9
_DEPTH_CLOSE_M = 1e-3
_DEPTH_ROUGH_M = 0.1
"""Where the floor is rough an isobath may be so far off."""
_CORRECTIONS = 8
"""Most Newton steps back to an isobath."""


def lawnmower(
    corners: Sequence[NorthEast], spacing_m: float, heading_rad: float
) -> list[NorthEast]:
    """Return the ends of parallel lines over a polygon, to and fro.

    The outermost lines lie half a spacing or less inside of the polygon's edges, evenly. Where a
    line leaves the polygon and comes back, each part inside is flown.

    Args:
        corners: Of the polygon, in order.
        spacing_m: Most between two lines.
        heading_rad: Of the first line.
    """
    ring = _turned(np.array(corners, dtype=np.float64), -heading_rad)
    low, high = float(ring[:, 1].min()), float(ring[:, 1].max())
    lines = max(1, math.ceil((high - low) / spacing_m - 1e-9))
    step = (high - low) / lines
    found: list[NorthEast] = []
    for number in range(lines):
        across = low + (number + 0.5) * step
        ends = _crossings(ring, across)
        if number % 2:
            ends.reverse()
        found += [(along, across) for along in ends]
    return _as_pairs(_turned(np.array(found).reshape(-1, 2), heading_rad))


def expanding_square(
    centre: NorthEast, spacing_m: float, turns: int, heading_rad: float
) -> list[NorthEast]:
    """Return the corners of a square spiral outwards; the first is the centre.

    Its legs are 1, 1, 2, 2, 3, 3, ... spacings long, each a quarter turn to starboard of the one
    before.
    """
    here, heading = np.array(centre), heading_rad
    corners = [here.copy()]
    for leg in range(4 * turns):
        here = here + (leg // 2 + 1) * spacing_m * _direction(heading)
        corners.append(here)
        heading += math.pi / 2.0
    return _as_pairs(np.array(corners))


def spiral_out(centre: NorthEast, spacing_m: float, radius_m: float) -> list[NorthEast]:
    """Return points of a spiral of Archimedes from a centre to a radius, a spacing a turn."""
    whole_rad = 2.0 * math.pi * radius_m / spacing_m
    count = max(2, math.ceil(whole_rad / _CHORD_RAD))
    angles = np.linspace(0.0, whole_rad, count + 1)
    reach = spacing_m * angles / (2.0 * math.pi)
    offsets = np.column_stack([reach * np.cos(angles), reach * np.sin(angles)])
    return _as_pairs(np.array(centre) + offsets)


def star(centre: NorthEast, radius_m: float, lines: int, heading_rad: float) -> list[NorthEast]:
    """Return the ends of lines through a centre, each flown the other way than the one before."""
    points: list[np.ndarray] = []
    for number in range(lines):
        reach = radius_m * _direction(heading_rad + number * math.pi / lines)
        ends = [np.array(centre) - reach, np.array(centre) + reach]
        points += ends if number % 2 == 0 else ends[::-1]
    return _as_pairs(np.array(points))


def passes(line: Sequence[NorthEast], count: int, spacing_m: float) -> list[NorthEast]:
    """Return a line followed to and fro, each pass a spacing farther to starboard.

    Raises:
        ValueError: If two successive corners of the line are the same.
    """
    found: list[NorthEast] = []
    for number in range(count):
        beside = beside_line(line, number * spacing_m)
        found += beside if number % 2 == 0 else beside[::-1]
    return found


def beside_line(line: Sequence[NorthEast], offset_m: float) -> list[NorthEast]:
    """Return a line at a distance to starboard; its corners are mitred, at most twice as far.

    Raises:
        ValueError: If two successive corners of the line are the same.
    """
    points = np.array(line, dtype=np.float64)
    along = np.diff(points, axis=0)
    lengths = np.hypot(*along.T)
    if not lengths.all():
        number = int(lengths.argmin()) + 1
        raise ValueError(f"corners {number} and {number + 1} of the line are the same place")
    along /= lengths[:, None]
    starboard = np.column_stack([-along[:, 1], along[:, 0]])
    before = np.vstack([starboard[:1], starboard])
    after = np.vstack([starboard, starboard[-1:]])
    middle = before + after
    share = np.maximum((middle * after).sum(axis=1), 1.0)  # 1 + cos of the bend, at least 1
    return _as_pairs(points + offset_m * middle / share[:, None])


def repeated(line: Sequence[NorthEast], count: int) -> list[NorthEast]:
    """Return a line flown so often, each time the other way."""
    found: list[NorthEast] = list(line)
    for number in range(1, count):
        found += list(line)[::-1][1:] if number % 2 else list(line)[1:]
    return found


def isobath(
    floor_m: Callable[[np.ndarray, np.ndarray], np.ndarray],
    depth_m: float,
    near: NorthEast,
    length_m: float,
    step_m: float,
    *,
    is_reversed: bool,
    reach_m: float,
) -> list[NorthEast]:
    """Follow a line of equal depth of the floor: a step along it, then back to it.

    Args:
        floor_m: Depth of the floor at northings and eastings.
        depth_m: Which isobath.
        near: It begins where it is nearest to this.
        length_m: How far it is followed.
        step_m: Between two points.
        is_reversed: With the shallow side to port instead of to starboard.
        reach_m: How far around ``near`` it is looked for.

    Raises:
        ValueError: If there is none within reach.
    """

    def error_at(place: np.ndarray) -> float:
        return float(floor_m(place[:1], place[1:])[0]) - depth_m

    def slope_at(place: np.ndarray) -> np.ndarray:
        small = 0.05 * step_m
        steps = small * np.eye(2)
        rises = [error_at(place + step) - error_at(place - step) for step in steps]
        return np.array(rises) / (2.0 * small)

    here = _nearest_on_isobath(error_at, np.array(near), step_m, reach_m)
    points = [here]
    for _ in range(math.ceil(length_m / step_m)):
        slope = slope_at(here)
        steepness = float(np.hypot(*slope))
        if steepness < _CLOSE_M:
            break
        # deeper is along the slope: with it to port, shallow water lies to starboard
        side = np.array([-slope[1], slope[0]]) / steepness
        there = _corrected(error_at, slope_at, here + step_m * (-side if is_reversed else side))
        if there is None or math.dist(there, here) < 0.2 * step_m:
            break
        points.append(there)
        here = there
    return _as_pairs(np.array(points))


def _nearest_on_isobath(
    error_at: Callable[[np.ndarray], float], near: np.ndarray, step_m: float, reach_m: float
) -> np.ndarray:
    """Return the nearest place, along 72 rays, where the sign of the error changes."""
    found: list[np.ndarray] = []
    for heading in np.arange(72) * math.pi / 36.0:
        ray = [near + s * _direction(heading) for s in np.arange(0.0, reach_m + step_m, step_m)]
        errors = [error_at(place) for place in ray]
        for (a, b), (x, y) in zip(pairwise(ray), pairwise(errors), strict=True):
            if x * y <= 0.0 and x != y:
                found.append(a + (b - a) * x / (x - y))
                break
    if not found:
        raise ValueError(f"the floor has no such depth within {reach_m:.3g} m of the place")
    return min(found, key=lambda place: math.dist(place, near))


def _corrected(
    error_at: Callable[[np.ndarray], float],
    slope_at: Callable[[np.ndarray], np.ndarray],
    place: np.ndarray,
) -> np.ndarray | None:
    """Return the place moved along the slope until its error is gone; None where it stays."""
    for _ in range(_CORRECTIONS):
        error, slope = error_at(place), slope_at(place)
        if abs(error) < _DEPTH_CLOSE_M:
            return place
        steepness = float(slope @ slope)
        if steepness < _CLOSE_M:
            return None
        place = place - error * slope / steepness
    return place if abs(error_at(place)) < _DEPTH_ROUGH_M else None


def _crossings(ring: np.ndarray, across: float) -> list[float]:
    """Return where a line at constant second coordinate enters and leaves a ring, ascending."""
    found: list[float] = []
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        if (a[1] <= across) != (b[1] <= across):
            found.append(float(a[0] + (b[0] - a[0]) * (across - a[1]) / (b[1] - a[1])))
    return sorted(found)


def _direction(heading_rad: float) -> np.ndarray:
    return np.array([math.cos(heading_rad), math.sin(heading_rad)])


def _turned(points: np.ndarray, angle_rad: float) -> np.ndarray:
    """Return points turned about the origin by an angle, from north to east."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return points @ np.array([[c, s], [-s, c]])


def _as_pairs(points: np.ndarray) -> list[NorthEast]:
    return [(float(north), float(east)) for north, east in points]
