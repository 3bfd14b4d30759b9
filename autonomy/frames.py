"""Frames and angles: NED inside the project, ENU in a 3D view, WGS84 on a map.

The local frame of a site is north, east, down (NED) with its origin at the surface; down is depth.
North and east of a place are those of the geodesic that leads there from the origin, so the frame
is good for waters of 100 km; a heading in it is counted from the frame's north, which is true north
at the origin alone (``convergence_rad``).
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
_SECOND_ECCENTRICITY_SQUARED = 1.0 / (1.0 - WGS84_FLATTENING) ** 2 - 1.0
_DIRECT_STEPS, _INVERSE_STEPS = 5, 8
"""Each makes the error about 300 times smaller."""
_NEAR_M = 30.0
"""Way of a robot for which its latitude and longitude are told linearly."""
_TINY = 1e-300
_SAME_NORTH_M = 50.0
"""Within so much of way true north turns by less than 0.001 deg outside of polar waters."""


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
    """Place points of the sea surface in the frame of an origin, by geodesics of the ellipsoid.

    North and east are the length of the geodesic from the origin times cosine and sine of its
    azimuth there. Depth is the same in both frames and is left to the caller. Distances from the
    origin are exact; between two points ``d`` away from it they grow by up to ``d^2 / (6 R^2)``,
    1e-5 at 50 km.

    Args:
        latitude_deg: Geodetic latitude, any shape.
        longitude_deg: Longitude, same shape, on either side of the antimeridian.
        origin_latitude_deg: Geodetic latitude of the frame's origin.
        origin_longitude_deg: Longitude of the frame's origin.

    Returns:
        North and east, m, shape ``(..., 2)``; to 1 mm within 1,000 km of the origin, useless near
        its antipode.

    Source:
        Vincenty, Survey Review 23 (176), 1975, Eqs. 13 to 19.
    """
    sin1, cos1 = _reduced(origin_latitude_deg)
    sin2, cos2 = _reduced(latitude_deg)
    difference = np.asarray(longitude_deg, dtype=np.float64) - origin_longitude_deg
    apart = np.radians((difference + 180.0) % 360.0 - 180.0)
    turn = apart  # lambda, of the auxiliary sphere
    step = 0
    while True:
        sin_turn, cos_turn = np.sin(turn), np.cos(turn)
        across, along = cos2 * sin_turn, cos1 * sin2 - sin1 * cos2 * cos_turn
        sin_arc = np.hypot(across, along)
        cos_arc = sin1 * sin2 + cos1 * cos2 * cos_turn
        arc = np.arctan2(sin_arc, cos_arc)
        sin_equator = cos1 * across / np.maximum(sin_arc, _TINY)  # Eq. 17
        cos_squared = 1.0 - sin_equator**2
        middle = cos_arc - 2.0 * sin1 * sin2 / np.maximum(cos_squared, _TINY)  # Eq. 18
        middle = np.clip(middle, -1.0, 1.0)  # on the equator it does not matter
        if step == _INVERSE_STEPS:
            break
        step += 1
        turn = apart + _excess(sin_equator, cos_squared, arc, sin_arc, cos_arc, middle)
    size, lag = _length(cos_squared, sin_arc, cos_arc, middle)
    share = size * (arc - lag) / np.maximum(sin_arc, _TINY)  # Eq. 19
    return np.stack([share * along, share * across], axis=-1)


def wgs84_from_ned(
    north_east_m: npt.ArrayLike, origin_latitude_deg: float, origin_longitude_deg: float
) -> FloatArray:
    """Find the point of the sea surface that ``ned_from_wgs84`` places at north, east.

    Args:
        north_east_m: North and east, shape ``(..., 2)``, within 1,000 km of the origin.
        origin_latitude_deg: Geodetic latitude of the frame's origin.
        origin_longitude_deg: Longitude of the frame's origin.

    Returns:
        Geodetic latitude and longitude in ``[-180, 180)``, deg, shape ``(..., 2)``.
    """
    latitude, apart, _ = _ends(north_east_m, origin_latitude_deg)
    longitude = (origin_longitude_deg + np.degrees(apart) + 180.0) % 360.0 - 180.0
    return np.stack([np.degrees(latitude), longitude], axis=-1)


def convergence_rad(north_east_m: npt.ArrayLike, origin_latitude_deg: float) -> FloatArray:
    """Return what a heading from the frame's north lacks to one from true north, at places.

    Meridians converge: 50 km east of an origin at 43 deg north, true north lies 0.42 deg to the
    left of the frame's. Directions keep their angles there to 0.001 deg.

    Args:
        north_east_m: North and east of the places, shape ``(..., 2)``, m.
        origin_latitude_deg: Geodetic latitude of the frame's origin.
    """
    return _ends(north_east_m, origin_latitude_deg)[2]


class LocalGeodetic:
    """Tells latitude and longitude of one robot that is asked for many times a second.

    Within 30 m of a place that was converted, what it is away from there is converted linearly:
    up to 80 deg of latitude that is at most 1 mm off.
    """

    def __init__(self) -> None:
        self._here: tuple[float, float] | None = None
        self._origin_deg = (0.0, 0.0)
        self._at: list[float] = []
        self._by_north: list[float] = []
        self._by_east: list[float] = []

    def at(
        self, north_m: float, east_m: float, origin_latitude_deg: float, origin_longitude_deg: float
    ) -> tuple[float, float]:
        """Return latitude and longitude of a place, deg; ``wgs84_from_ned`` says what is given."""
        origin_deg = (origin_latitude_deg, origin_longitude_deg)
        near = self._here is not None and self._origin_deg == origin_deg
        if self._here is None or not near or math.dist(self._here, (north_m, east_m)) > _NEAR_M:
            self._here, self._origin_deg = (north_m, east_m), origin_deg
            places = np.array([[0.0, 0.0], [_NEAR_M, 0.0], [0.0, _NEAR_M]]) + self._here
            found = wgs84_from_ned(places, *origin_deg)
            per_m = ((found[1:] - found[0] + 180.0) % 360.0 - 180.0) / _NEAR_M
            self._at, self._by_north, self._by_east = [found[0].tolist(), *per_m.tolist()]
        north, east = north_m - self._here[0], east_m - self._here[1]
        latitude, longitude = (
            at + north * by_north + east * by_east
            for at, by_north, by_east in zip(self._at, self._by_north, self._by_east, strict=True)
        )
        return latitude, (longitude + 180.0) % 360.0 - 180.0


class TrueNorth:
    """Turns headings between a frame's north and true north where one robot is.

    A robot asks ten times a second, and the answer is worked out again after ``_SAME_NORTH_M``.

    Args:
        origin_latitude_deg: Geodetic latitude of the frame's origin.
    """

    def __init__(self, origin_latitude_deg: float) -> None:
        self._latitude_deg = origin_latitude_deg
        self._place = (math.nan, math.nan)
        self._convergence_rad = 0.0

    def convergence_rad(self, north_m: float, east_m: float) -> float:
        """Return what is added to a heading from the frame's north to have the true one."""
        if not math.dist(self._place, (north_m, east_m)) < _SAME_NORTH_M:
            self._place = (north_m, east_m)
            self._convergence_rad = float(convergence_rad(self._place, self._latitude_deg))
        return self._convergence_rad


def _ends(
    north_east_m: npt.ArrayLike, origin_latitude_deg: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where geodesics from the origin end: latitude, longitude from its own, and turn, rad.

    The turn is the azimuth at the end less that at the beginning.

    Source:
        Vincenty, Survey Review 23 (176), 1975, Eqs. 1 to 11.
    """
    north, east = np.moveaxis(np.asarray(north_east_m, dtype=np.float64), -1, 0)
    azimuth, distance = np.arctan2(east, north), np.hypot(north, east)
    sin_azimuth, cos_azimuth = np.sin(azimuth), np.cos(azimuth)
    sin1, cos1 = _reduced(origin_latitude_deg)
    first_arc = np.arctan2(sin1, cos1 * cos_azimuth)  # sigma_1, Eq. 1
    sin_equator = cos1 * sin_azimuth  # Eq. 2
    cos_squared = 1.0 - sin_equator**2
    size = _length(cos_squared, 0.0, 1.0, 1.0)[0]
    arc = distance / size
    for _ in range(_DIRECT_STEPS):
        middle = np.cos(2.0 * first_arc + arc)  # Eq. 5
        sin_arc, cos_arc = np.sin(arc), np.cos(arc)
        arc = distance / size + _length(cos_squared, sin_arc, cos_arc, middle)[1]  # Eqs. 6, 7
    sin_arc, cos_arc = np.sin(arc), np.cos(arc)
    middle = np.cos(2.0 * first_arc + arc)
    along = cos1 * cos_arc * cos_azimuth - sin1 * sin_arc
    latitude = np.arctan2(
        sin1 * cos_arc + cos1 * sin_arc * cos_azimuth,
        (1.0 - WGS84_FLATTENING) * np.hypot(sin_equator, along),
    )  # Eq. 8
    turn = np.arctan2(sin_arc * sin_azimuth, cos1 * cos_arc - sin1 * sin_arc * cos_azimuth)  # Eq. 9
    apart = turn - _excess(sin_equator, cos_squared, arc, sin_arc, cos_arc, middle)
    return latitude, apart, wrap_angle(np.arctan2(sin_equator, along) - azimuth)


def _reduced(latitude_deg: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return sine and cosine of the reduced latitude."""
    latitude = np.radians(np.asarray(latitude_deg, dtype=np.float64))
    y, x = (1.0 - WGS84_FLATTENING) * np.sin(latitude), np.cos(latitude)
    radius = np.hypot(x, y)
    return y / radius, x / radius


def _length(
    cos_squared: FloatArray, sin_arc: npt.ArrayLike, cos_arc: npt.ArrayLike, middle: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return metres a radian of arc, ``b A``, and the arc's correction (Eqs. 3, 4 and 6)."""
    u = cos_squared * _SECOND_ECCENTRICITY_SQUARED
    a = 1.0 + u / 16384.0 * (4096.0 + u * (-768.0 + u * (320.0 - 175.0 * u)))
    b = u / 1024.0 * (256.0 + u * (-128.0 + u * (74.0 - 47.0 * u)))
    sine, cosine, c = np.asarray(sin_arc), np.asarray(cos_arc), np.asarray(middle)
    last = b / 6.0 * c * (-3.0 + 4.0 * sine**2) * (-3.0 + 4.0 * c**2)
    lag = b * sine * (c + b / 4.0 * (cosine * (-1.0 + 2.0 * c**2) - last))
    return WGS84_EQUATOR_M * (1.0 - WGS84_FLATTENING) * a, lag


def _excess(
    sin_equator: FloatArray,
    cos_squared: FloatArray,
    arc: FloatArray,
    sin_arc: FloatArray,
    cos_arc: FloatArray,
    middle: FloatArray,
) -> FloatArray:
    """Return by how much longitude on the auxiliary sphere exceeds the true one (Eqs. 10, 11)."""
    f = WGS84_FLATTENING
    c = f / 16.0 * cos_squared * (4.0 + f * (4.0 - 3.0 * cos_squared))
    inner = middle + c * cos_arc * (-1.0 + 2.0 * middle**2)
    return (1.0 - c) * f * sin_equator * (arc + c * sin_arc * inner)
