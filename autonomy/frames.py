"""Frames and angles: NED inside the project, ENU in a 3D view, WGS84 on a map.

The local frame of a site is north, east, down (NED) with its origin at the surface; down is depth.
The body frame is forward, starboard, down. Attitude is roll, pitch, heading in the ZYX convention
(thesis section 5.3).
"""

import math

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray

WGS84_EQUATOR_M = 6378137.0
"""Semi-major axis of the ellipsoid."""
WGS84_FLATTENING = 1.0 / 298.257223563
"""Flattening of the ellipsoid."""
_AXIS_RATIO_SQUARED = (1.0 - WGS84_FLATTENING) ** 2


def ned_to_enu(points: FloatArray) -> FloatArray:
    """Turn north, east, down into east, north, up (x right, y up the map, z up); ``(..., 3)``."""
    return np.stack([points[..., 1], points[..., 0], -points[..., 2]], axis=-1)


def wrap_angle(angle_rad: npt.ArrayLike) -> FloatArray:
    """Return the same direction in ``[-pi, pi)``, elementwise."""
    wrapped = (np.asarray(angle_rad, dtype=np.float64) + math.pi) % (2.0 * math.pi) - math.pi
    return np.where(wrapped < math.pi, wrapped, -math.pi)  # a tiny negative remainder rounds up


def rotation_ned_from_body(roll_rad: float, pitch_rad: float, heading_rad: float) -> FloatArray:
    """Return the matrix that turns body components into NED components, shape ``(3, 3)``.

    Source:
        Thesis section 3.1.1, R after Eq. 3.2.
    """
    sf, cf = math.sin(roll_rad), math.cos(roll_rad)
    st, ct = math.sin(pitch_rad), math.cos(pitch_rad)
    sp, cp = math.sin(heading_rad), math.cos(heading_rad)
    return np.array(
        [
            [ct * cp, cp * st * sf - cf * sp, sf * sp + cf * cp * st],
            [ct * sp, cf * cp + st * sf * sp, cf * st * sp - cp * sf],
            [-st, ct * sf, ct * cf],
        ]
    )


def quaternion_enu_from_body(
    roll_rad: float, pitch_rad: float, heading_rad: float
) -> tuple[float, float, float, float]:
    """Return the unit quaternion (w, x, y, z) that turns body axes into a z-up view.

    NED to ENU is a half turn about the horizontal axis between north and east.
    """
    half = 0.5 * roll_rad, 0.5 * pitch_rad, 0.5 * heading_rad
    sf, st, sp = (math.sin(angle) for angle in half)
    cf, ct, cp = (math.cos(angle) for angle in half)
    w = cf * ct * cp + sf * st * sp
    x = sf * ct * cp - cf * st * sp
    y = cf * st * cp + sf * ct * sp
    z = cf * ct * sp - sf * st * cp
    half_turn = math.sqrt(0.5)  # quaternion (0, half_turn, half_turn, 0)
    return (
        -half_turn * (x + y),
        half_turn * (w + z),
        half_turn * (w - z),
        half_turn * (y - x),
    )


def ned_from_wgs84(
    latitude_deg: npt.ArrayLike,
    longitude_deg: npt.ArrayLike,
    origin_latitude_deg: float,
    origin_longitude_deg: float,
) -> FloatArray:
    """Project points of the sea surface onto the tangent plane of the origin.

    Depth is the same in both frames and is left to the caller. Distances shrink by
    ``d^3 / (6 R^2)``: 4 mm at 10 km, 0.5 m at 50 km.

    Args:
        latitude_deg: Geodetic latitude, any shape.
        longitude_deg: Longitude, same shape.
        origin_latitude_deg: Geodetic latitude of the frame's origin.
        origin_longitude_deg: Longitude of the frame's origin.

    Returns:
        North and east, m, shape ``(..., 2)``.
    """
    point = _earth_centred(latitude_deg, longitude_deg)
    origin = _earth_centred(origin_latitude_deg, origin_longitude_deg)
    axes = _tangent_axes(origin_latitude_deg, origin_longitude_deg)
    return (point - origin) @ axes[:2].T


def wgs84_from_ned(
    north_east_m: npt.ArrayLike, origin_latitude_deg: float, origin_longitude_deg: float
) -> FloatArray:
    """Find the point of the sea surface that ``ned_from_wgs84`` projects to north, east.

    Args:
        north_east_m: North and east, shape ``(..., 2)``, within 1,000 km of the origin.
        origin_latitude_deg: Geodetic latitude of the frame's origin.
        origin_longitude_deg: Longitude of the frame's origin.

    Returns:
        Geodetic latitude and longitude, deg, shape ``(..., 2)``.
    """
    axes = _tangent_axes(origin_latitude_deg, origin_longitude_deg)
    origin = _earth_centred(origin_latitude_deg, origin_longitude_deg)
    start = origin + np.asarray(north_east_m, dtype=np.float64) @ axes[:2]
    # the ellipsoid is a sphere after stretching z; then the way down is a root of a quadratic
    stretch = np.array([1.0, 1.0, 1.0 / (1.0 - WGS84_FLATTENING)])
    a, d = start * stretch, axes[2] * stretch
    quadratic, linear = d @ d, a @ d
    constant = np.sum(a * a, axis=-1) - WGS84_EQUATOR_M**2
    down = constant / (-linear + np.sqrt(linear**2 - quadratic * constant))
    x, y, z = np.moveaxis(start + down[..., None] * axes[2], -1, 0)
    latitude = np.arctan2(z, _AXIS_RATIO_SQUARED * np.hypot(x, y))
    return np.degrees(np.stack([latitude, np.arctan2(y, x)], axis=-1))


def _earth_centred(latitude_deg: npt.ArrayLike, longitude_deg: npt.ArrayLike) -> FloatArray:
    """Return earth-centred coordinates of points of the surface, m, shape ``(..., 3)``."""
    latitude = np.radians(np.asarray(latitude_deg, dtype=np.float64))
    longitude = np.radians(np.asarray(longitude_deg, dtype=np.float64))
    s, c = np.sin(latitude), np.cos(latitude)
    normal = WGS84_EQUATOR_M / np.sqrt(1.0 - (1.0 - _AXIS_RATIO_SQUARED) * s * s)
    return np.stack(
        [
            normal * c * np.cos(longitude),
            normal * c * np.sin(longitude),
            normal * _AXIS_RATIO_SQUARED * s,
        ],
        axis=-1,
    )


def _tangent_axes(latitude_deg: float, longitude_deg: float) -> FloatArray:
    """Return north, east and down as rows of earth-centred unit vectors, shape ``(3, 3)``."""
    s, c = math.sin(math.radians(latitude_deg)), math.cos(math.radians(latitude_deg))
    sl, cl = math.sin(math.radians(longitude_deg)), math.cos(math.radians(longitude_deg))
    return np.array([[-s * cl, -s * sl, c], [-sl, cl, 0.0], [-c * cl, -c * sl, -s]])
