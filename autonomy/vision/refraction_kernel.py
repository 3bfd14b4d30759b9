"""Compiled refraction: through the surface of the water from above, and through a flat port.

``autonomy.vision.reference.optics`` has the same equations in their readable form.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel

# fmt: off
PORT_DISTANCE, PORT_THICKNESS, GLASS_INDEX = range(3)
# fmt: on
"""Index of each number of a packed port: from lens to window m, thickness m, and the glass's index
of refraction."""
PORT_SIZE = 3

_LONGEST_SEARCH = 60
_SETTLED = 1e-12
"""A Newton step of so small a share is the last: the next one would be lost in rounding."""
_STRAIGHT_M = 1e-9
"""Below this distance from the eye's foot a ray goes straight down."""


@inner_kernel
def surface_way(
    r: float, h: float, d: float, index: float
) -> tuple[float, float, float, float, float]:
    """Return how far from the eye's foot light leaves the water, and the derivatives.

    Snell's law says ``f(x) = x/sqrt(x^2+h^2) - n (r-x)/sqrt((r-x)^2+d^2) = 0``; f rises, so there
    is one root.

    Args:
        r: Horizontal distance from eye to point, m, not negative.
        h: Height of the eye above the surface, m, positive.
        d: Depth of the point below it, m, positive.
        index: Index of refraction of the water.

    Returns:
        The distance, m, and its derivatives by r, h, d (m/m) and index (m).
    """
    low, high = 0.0, r
    x = r * h / (h + d / index)  # exact where the ray is steep
    for _ in range(_LONGEST_SEARCH):
        over, under = math.hypot(x, h), math.hypot(r - x, d)
        f = x / over - index * (r - x) / under
        if f < 0.0:
            low = x
        else:
            high = x
        new = x - f / (h * h / over**3 + index * d * d / under**3)
        if not low <= new <= high:
            new = 0.5 * (low + high)
        move = abs(new - x)
        x = new
        if move <= _SETTLED * r:
            break
    over, under = math.hypot(x, h), math.hypot(r - x, d)
    by_x = h * h / over**3 + index * d * d / under**3
    return (
        x,
        index * d * d / under**3 / by_x,
        x * h / over**3 / by_x,
        -index * (r - x) * d / under**3 / by_x,
        (r - x) / under / by_x,
    )


@inner_kernel
def seen_into(
    eye: FloatArray,
    point: FloatArray,
    level: float,
    index: float,
    sight: FloatArray,
    slopes: FloatArray,
) -> bool:
    """Write the way from an eye above the water to where it sees a point; tell if it sees one.

    A point under water is seen where its light leaves the surface, a dry one where it is.

    Args:
        eye: North, east, down, shape ``(3,)``, m.
        point: North, east, down, shape ``(3,)``, m.
        level: Down coordinate of the surface, m.
        index: Index of refraction of the water.
        sight: Takes the way in NED, shape ``(3,)``, m.
        slopes: Takes its derivatives by eye (3 columns), point (3), level and index, ``(3, 8)``.
    """
    h, d = level - eye[2], point[2] - level
    if not h > 0.0:
        return False
    slopes[:] = 0.0
    north, east = point[0] - eye[0], point[1] - eye[1]
    if d <= 0.0:
        sight[0], sight[1], sight[2] = north, east, point[2] - eye[2]
        for i in range(3):
            slopes[i, i], slopes[i, 3 + i] = -1.0, 1.0
        return True
    r = math.hypot(north, east)
    x, by_r, by_h, by_d, by_index = surface_way(r, h, d, index)
    if r > _STRAIGHT_M:
        e0, e1, share = north / r, east / r, x / r
    else:
        e0, e1, share = 1.0, 0.0, by_r
    sight[0], sight[1], sight[2] = share * north, share * east, h
    slopes[0, 3] = share + (by_r - share) * e0 * e0
    slopes[0, 4] = (by_r - share) * e0 * e1
    slopes[1, 3] = slopes[0, 4]
    slopes[1, 4] = share + (by_r - share) * e1 * e1
    slopes[0, 5], slopes[1, 5] = by_d * e0, by_d * e1
    for i in range(2):
        slopes[i, 0], slopes[i, 1] = -slopes[i, 3], -slopes[i, 4]
    slopes[0, 2], slopes[1, 2], slopes[2, 2] = -by_h * e0, -by_h * e1, -1.0
    slopes[0, 6], slopes[1, 6], slopes[2, 6] = (by_h - by_d) * e0, (by_h - by_d) * e1, 1.0
    slopes[0, 7], slopes[1, 7] = by_index * e0, by_index * e1
    return True


@inner_kernel
def refracted(
    x: float, y: float, z: float, nx: float, ny: float, nz: float, ratio: float
) -> tuple[float, float, float]:
    """Return the direction of light behind a surface; NaN where it is reflected totally.

    Args:
        x: Direction of the light before the surface, with ``y`` and ``z`` of length 1.
        y: Its second component.
        z: Its third component.
        nx: Normal of the surface to where the light goes, with ``ny`` and ``nz`` of length 1.
        ny: Its second component.
        nz: Its third component.
        ratio: Index of refraction before the surface over that behind it.
    """
    towards = x * nx + y * ny + z * nz
    inner = 1.0 - ratio * ratio * (1.0 - towards * towards)
    if not (towards > 0.0 and inner >= 0.0):
        return math.nan, math.nan, math.nan
    along = math.sqrt(inner) - ratio * towards
    return ratio * x + along * nx, ratio * y + along * ny, ratio * z + along * nz


@inner_kernel
def through_port_into(
    port: FloatArray,
    x: float,
    y: float,
    z: float,
    index: float,
    sight: FloatArray,
    slopes: FloatArray,
) -> bool:
    """Write along which direction a lens sees a point behind a window; tell if it sees one.

    ``a s + b tan(tg) + z_w tan(tw) = r`` is solved for s, the slope of the ray before the window;
    its left side rises.

    Args:
        port: Packed port, shape ``(3,)``; its normal is the optical axis.
        x: Point in camera axes, to the right, m.
        y: Down in the picture, m.
        z: Forward, m.
        index: Index of refraction of the water.
        sight: Takes the direction, of which z is 1, shape ``(3,)``.
        slopes: Takes its derivatives by the point (3 columns) and by the index, shape ``(3, 4)``.
    """
    a, b, glass = port[PORT_DISTANCE], port[PORT_THICKNESS], port[GLASS_INDEX]
    behind = z - a - b
    if not behind > 0.0:
        return False
    slopes[:] = 0.0
    r = math.hypot(x, y)
    s, low, high = r / (a + b / glass + behind / index), 0.0, math.inf
    by_s, by_index = 1.0, 0.0
    for _ in range(_LONGEST_SEARCH):
        sine = s / math.sqrt(1.0 + s * s)
        cosine3 = 1.0 / (1.0 + s * s) ** 1.5
        g, w = math.sqrt(glass * glass - sine * sine), math.sqrt(index * index - sine * sine)
        off = a * s + b * sine / g + behind * sine / w - r
        by_s = a + cosine3 * (b * glass * glass / g**3 + behind * index * index / w**3)
        by_index = -behind * sine * index / w**3
        if off < 0.0:
            low = s
        else:
            high = s
        new = s - off / by_s
        if not low <= new <= high:
            new = 0.5 * (low + high) if high < math.inf else 2.0 * s + 1.0
        move = abs(new - s)
        s = new
        if move <= _SETTLED * (1.0 + s):
            break
    sine = s / math.sqrt(1.0 + s * s)
    by_z = sine / math.sqrt(index * index - sine * sine)
    if r > _STRAIGHT_M:
        e0, e1, share = x / r, y / r, s / r
    else:
        e0, e1, share = 1.0, 0.0, 1.0 / by_s
    sight[0], sight[1], sight[2] = share * x, share * y, 1.0
    slopes[0, 0] = share + (1.0 / by_s - share) * e0 * e0
    slopes[0, 1] = (1.0 / by_s - share) * e0 * e1
    slopes[1, 0] = slopes[0, 1]
    slopes[1, 1] = share + (1.0 / by_s - share) * e1 * e1
    slopes[0, 2], slopes[1, 2] = -by_z / by_s * e0, -by_z / by_s * e1
    slopes[0, 3], slopes[1, 3] = -by_index / by_s * e0, -by_index / by_s * e1
    return True


@inner_kernel
def port_ray(
    port: FloatArray, x: float, y: float, z: float, index: float
) -> tuple[float, float, float, float, float]:
    """Return where a ray of the lens enters the water, and its direction there.

    Args:
        port: Packed port, shape ``(3,)``.
        x: Direction in air in camera axes, with ``y`` and ``z`` of length 1.
        y: Its second component.
        z: Its third component, positive.
        index: Index of refraction of the water.

    Returns:
        x and y of the point on the window's outer face, m, and the direction in the water, of
        length 1.
    """
    a, b, glass = port[PORT_DISTANCE], port[PORT_THICKNESS], port[GLASS_INDEX]
    gx, gy, gz = refracted(x, y, z, 0.0, 0.0, 1.0, 1.0 / glass)
    wx, wy, wz = refracted(x, y, z, 0.0, 0.0, 1.0, 1.0 / index)
    return a * x / z + b * gx / gz, a * y / z + b * gy / gz, wx, wy, wz


@kernel
def seen(
    eye: FloatArray,
    points: FloatArray,
    level: float,
    index: float,
    sights: FloatArray,
    slopes: FloatArray,
) -> None:
    """Write for many points what ``seen_into`` does; NaN where the eye is not above the water.

    Args:
        eye: North, east, down, shape ``(3,)``, m.
        points: Shape ``(n, 3)``, m.
        level: Down coordinate of the surface, m.
        index: Index of refraction of the water.
        sights: Takes the ways, shape ``(n, 3)``, m.
        slopes: Takes their derivatives, shape ``(n, 3, 8)``.
    """
    for i in range(points.shape[0]):
        if not seen_into(eye, points[i], level, index, sights[i], slopes[i]):
            sights[i] = math.nan
            slopes[i] = math.nan


@kernel
def into_water(
    eye: FloatArray,
    directions: FloatArray,
    level: float,
    index: float,
    entries: FloatArray,
    inside: FloatArray,
) -> None:
    """Write where rays from an eye enter the water, and their directions there; NaN if they do not.

    Args:
        eye: North, east, down, shape ``(3,)``, m, above the surface.
        directions: Rays in NED, of length 1, shape ``(n, 3)``.
        level: Down coordinate of the surface, m.
        index: Index of refraction of the water.
        entries: Takes the points on the surface, shape ``(n, 3)``, m.
        inside: Takes the directions, of length 1, shape ``(n, 3)``.
    """
    h = level - eye[2]
    for i in range(directions.shape[0]):
        x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
        if h > 0.0 and z > 0.0:
            entries[i, 0], entries[i, 1] = eye[0] + h * x / z, eye[1] + h * y / z
            entries[i, 2] = level
            x, y, z = refracted(x, y, z, 0.0, 0.0, 1.0, 1.0 / index)
            inside[i, 0], inside[i, 1], inside[i, 2] = x, y, z
        else:
            entries[i] = math.nan
            inside[i] = math.nan


@kernel
def through_port(
    port: FloatArray, points: FloatArray, index: float, sights: FloatArray, slopes: FloatArray
) -> None:
    """Write for many points what ``through_port_into`` does; NaN where the lens sees none.

    Args:
        port: Packed port, shape ``(3,)``.
        points: In camera axes, shape ``(n, 3)``, m.
        index: Index of refraction of the water.
        sights: Takes the directions, shape ``(n, 3)``.
        slopes: Takes their derivatives, shape ``(n, 3, 4)``.
    """
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if not through_port_into(port, x, y, z, index, sights[i], slopes[i]):
            sights[i] = math.nan
            slopes[i] = math.nan


@kernel
def port_rays(
    port: FloatArray, directions: FloatArray, index: float, exits: FloatArray, inside: FloatArray
) -> None:
    """Write for many rays what ``port_ray`` tells; NaN where one does not go forward.

    Args:
        port: Packed port, shape ``(3,)``.
        directions: In air, of length 1, shape ``(n, 3)``.
        index: Index of refraction of the water.
        exits: Takes the points on the outer face in camera axes, shape ``(n, 3)``, m.
        inside: Takes the directions in the water, of length 1, shape ``(n, 3)``.
    """
    for i in range(directions.shape[0]):
        if directions[i, 2] > 0.0:
            x, y, wx, wy, wz = port_ray(
                port, directions[i, 0], directions[i, 1], directions[i, 2], index
            )
            exits[i, 0], exits[i, 1] = x, y
            exits[i, 2] = port[PORT_DISTANCE] + port[PORT_THICKNESS]
            inside[i, 0], inside[i, 1], inside[i, 2] = wx, wy, wz
        else:
            exits[i] = math.nan
            inside[i] = math.nan


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    eye, points, down = np.array([0.0, 0.0, -1.0]), np.ones((1, 3)), np.array([[0.0, 0.0, 1.0]])
    port = np.array([0.01, 0.005, 1.49])
    out, inside = np.empty((1, 3)), np.empty((1, 3))
    seen(eye, points, 0.0, 1.333, out, np.empty((1, 3, 8)))
    into_water(eye, down, 0.0, 1.333, out, inside)
    through_port(port, points, 1.333, out, np.empty((1, 3, 4)))
    port_rays(port, down, 1.333, out, inside)
