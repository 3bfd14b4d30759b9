"""Compiled lens: a point before the camera to its pixel with derivatives, and a pixel to its ray.

A lens is handed over as one array, in the order of the names below. The same equations in their
readable form are in ``autonomy.vision.reference.optics``.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel

# fmt: off
KIND, FX, FY, CX, CY, D0, D1, D2, D3, D4, FOLD = range(11)
# fmt: on
"""Index of each number of a packed lens: kind, focal lengths and principal point in px, distortion,
and how far from the axis the model holds (square of the ray's slope, or of its angle in rad)."""
PINHOLE, FISHEYE = 0.0, 1.0
LENS_SIZE = 11
PARAMETERS = 9
"""Focal lengths, principal point and five of distortion, in the order of the array; a fisheye lens
uses four, and the derivatives by its fifth are 0."""

_NEAR_AXIS = 1e-6
"""Slope of a ray below which a fisheye lens is taken by its series."""
_SETTLED = 1e-15
_ACCURATE = 1e-12
"""Greatest error of a ray that is told, in pixels over the focal length."""
_STEPS = 60


@inner_kernel
def project_into(
    lens: FloatArray, x: float, y: float, z: float, slopes: FloatArray
) -> tuple[float, float]:
    """Return the pixel of a point in camera axes; NaN where the lens shows none.

    Args:
        lens: Packed lens, shape ``(11,)``.
        x: To the right in the picture, m.
        y: Down in the picture, m.
        z: Forward, m.
        slopes: Takes the derivatives by the point (px/m) and by the parameters, shape ``(2, 12)``.
    """
    if not z > 0.0:
        return math.nan, math.nan
    a, b = x / z, y / z
    if lens[KIND] == PINHOLE:
        p, q, pa, pb, qb = _bent_pinhole(lens, a, b, slopes)
    else:
        p, q, pa, pb, qb = _bent_fisheye(lens, a, b, slopes)
    if not pa * qb - pb * pb > 0.0:  # folded over, or NaN
        return math.nan, math.nan
    fx, fy = lens[FX], lens[FY]
    slopes[0, 0], slopes[0, 1] = fx * pa / z, fx * pb / z
    slopes[0, 2] = -fx * (pa * a + pb * b) / z
    slopes[1, 0], slopes[1, 1] = fy * pb / z, fy * qb / z
    slopes[1, 2] = -fy * (pb * a + qb * b) / z
    slopes[0, 3], slopes[0, 4], slopes[0, 5], slopes[0, 6] = p, 0.0, 1.0, 0.0
    slopes[1, 3], slopes[1, 4], slopes[1, 5], slopes[1, 6] = 0.0, q, 0.0, 1.0
    for i in range(7, 12):
        slopes[0, i] *= fx
        slopes[1, i] *= fy
    return fx * p + lens[CX], fy * q + lens[CY]


@inner_kernel
def _bent_pinhole(
    lens: FloatArray, a: float, b: float, slopes: FloatArray
) -> tuple[float, float, float, float, float]:
    """Return the bent slopes and their derivatives (by a, by the other, by b)."""
    k1, k2, p1, p2, k3 = lens[D0], lens[D1], lens[D2], lens[D3], lens[D4]
    r2 = a * a + b * b
    if r2 >= lens[FOLD]:
        return math.nan, math.nan, math.nan, math.nan, math.nan
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    grown = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)  # by r2
    slopes[0, 7], slopes[1, 7] = a * r2, b * r2
    slopes[0, 8], slopes[1, 8] = a * r2 * r2, b * r2 * r2
    slopes[0, 9], slopes[1, 9] = 2.0 * a * b, r2 + 2.0 * b * b
    slopes[0, 10], slopes[1, 10] = r2 + 2.0 * a * a, 2.0 * a * b
    slopes[0, 11], slopes[1, 11] = a * r2**3, b * r2**3
    return (
        a * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a),
        b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b,
        radial + 2.0 * a * a * grown + 2.0 * p1 * b + 6.0 * p2 * a,
        2.0 * a * b * grown + 2.0 * p1 * a + 2.0 * p2 * b,
        radial + 2.0 * b * b * grown + 6.0 * p1 * b + 2.0 * p2 * a,
    )


@inner_kernel
def _bent_fisheye(
    lens: FloatArray, a: float, b: float, slopes: FloatArray
) -> tuple[float, float, float, float, float]:
    """Return the bent slopes and their derivatives (by a, by the other, by b)."""
    r2 = a * a + b * b
    r = math.sqrt(r2)
    t = math.atan(r)
    t2 = t * t
    if t2 >= lens[FOLD]:
        return math.nan, math.nan, math.nan, math.nan, math.nan
    k1, k2, k3, k4 = lens[D0], lens[D1], lens[D2], lens[D3]
    if r > _NEAR_AXIS:
        straight = t / r
        share = straight * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
        speed = 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)))
        grown = (speed / (1.0 + r2) - share) / r2  # share by r, over r
    else:
        straight, share = 1.0, 1.0
        grown = 2.0 * (k1 - 1.0 / 3.0)
    power = straight
    for i in range(7, 11):
        power *= t2
        slopes[0, i], slopes[1, i] = a * power, b * power
    slopes[0, 11], slopes[1, 11] = 0.0, 0.0
    return (
        a * share,
        b * share,
        share + a * a * grown,
        a * b * grown,
        share + b * b * grown,
    )


@inner_kernel
def ray_of(lens: FloatArray, u: float, v: float) -> tuple[float, float, float]:
    """Return the direction in camera axes that a pixel looks along, of length 1; NaN where none.

    Args:
        lens: Packed lens, shape ``(11,)``.
        u: To the right from the centre of the first pixel, px.
        v: Down from there, px.
    """
    p, q = (u - lens[CX]) / lens[FX], (v - lens[CY]) / lens[FY]
    wanted = math.hypot(p, q)
    if not wanted < math.inf:
        return math.nan, math.nan, math.nan
    if lens[KIND] == FISHEYE:
        t = _unbent(lens, wanted)
        if not t < math.inf:
            return math.nan, math.nan, math.nan
        if wanted == 0.0:
            return 0.0, 0.0, 1.0
        return p / wanted * math.sin(t), q / wanted * math.sin(t), math.cos(t)
    return _unbent_pinhole(lens, p, q, wanted)


@inner_kernel
def _unbent_pinhole(
    lens: FloatArray, p: float, q: float, wanted: float
) -> tuple[float, float, float]:
    r = _unbent(lens, wanted)
    if not r < math.inf:  # decentring may bring in what the radial part alone does not
        r = 0.999 * math.sqrt(lens[FOLD])
    scale = r / wanted if wanted > 0.0 else 1.0
    a, b = p * scale, q * scale
    scratch = np.empty((2, 12))
    off = math.inf
    for _ in range(_STEPS):
        x, y, xa, xb, yb = _bent_pinhole(lens, a, b, scratch)
        determinant = xa * yb - xb * xb
        if not determinant > 0.0:
            return math.nan, math.nan, math.nan
        dx, dy = x - p, y - q
        last, off = off, math.hypot(dx, dy)
        if off <= _SETTLED * (1.0 + wanted) or (off <= _ACCURATE and off >= last):
            break
        a -= (yb * dx - xb * dy) / determinant
        b -= (xa * dy - xb * dx) / determinant
    if not off <= _ACCURATE * (1.0 + wanted):
        return math.nan, math.nan, math.nan
    length = math.sqrt(1.0 + a * a + b * b)
    return a / length, b / length, 1.0 / length


@inner_kernel
def _bent_way(lens: FloatArray, r: float) -> tuple[float, float]:
    """Return how far from the axis the radial part puts a ray, and the derivative.

    ``r`` is the ray's slope, or its angle where the lens is a fisheye.
    """
    w = r * r
    if lens[KIND] == PINHOLE:
        k1, k2, k3, k4 = lens[D0], lens[D1], lens[D4], 0.0
    else:
        k1, k2, k3, k4 = lens[D0], lens[D1], lens[D2], lens[D3]
    way = r * (1.0 + w * (k1 + w * (k2 + w * (k3 + w * k4))))
    return way, 1.0 + w * (3.0 * k1 + w * (5.0 * k2 + w * (7.0 * k3 + w * 9.0 * k4)))


@inner_kernel
def _unbent(lens: FloatArray, wanted: float) -> float:
    """Return the slope or the angle that the radial part puts so far from the axis, or infinity."""
    if wanted == 0.0:
        return 0.0
    low, high = 0.0, math.sqrt(lens[FOLD])
    if high == math.inf:
        high = wanted
        while _bent_way(lens, high)[0] < wanted:
            high *= 2.0
    elif _bent_way(lens, high)[0] <= wanted:
        return math.inf
    r = min(wanted, 0.5 * (low + high))
    for _ in range(_STEPS):
        way, speed = _bent_way(lens, r)
        if way < wanted:
            low = r
        else:
            high = r
        new = r - (way - wanted) / speed
        if not low <= new <= high:
            new = 0.5 * (low + high)
        step = abs(new - r)
        r = new
        if step <= _SETTLED * r:
            break
    return r


@kernel
def project(lens: FloatArray, points: FloatArray, pixels: FloatArray, slopes: FloatArray) -> None:
    """Write the pixels of points and their derivatives; NaN where the lens shows none.

    Args:
        lens: Packed lens, shape ``(11,)``.
        points: In camera axes, shape ``(n, 3)``, m.
        pixels: Takes the pixels, shape ``(n, 2)``.
        slopes: Takes the derivatives, shape ``(n, 2, 12)``.
    """
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        pixels[i, 0], pixels[i, 1] = project_into(lens, x, y, z, slopes[i])
        if math.isnan(pixels[i, 0]):
            slopes[i] = math.nan


@kernel
def rays(lens: FloatArray, pixels: FloatArray, directions: FloatArray) -> None:
    """Write the directions of length 1 that pixels look along; NaN where there is none.

    Args:
        lens: Packed lens, shape ``(11,)``.
        pixels: Shape ``(n, 2)``.
        directions: Takes the rays in camera axes, shape ``(n, 3)``.
    """
    for i in range(pixels.shape[0]):
        x, y, z = ray_of(lens, pixels[i, 0], pixels[i, 1])
        directions[i, 0], directions[i, 1], directions[i, 2] = x, y, z


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    lens = np.array([PINHOLE, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, math.inf])
    project(lens, np.ones((1, 3)), np.zeros((1, 2)), np.zeros((1, 2, 12)))
    rays(lens, np.ones((1, 2)), np.zeros((1, 3)))
