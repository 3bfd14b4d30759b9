"""Reads the current of one water from a CF NetCDF file of an ocean model.

Source:
    NetCDF Climate and Forecast (CF) Metadata Conventions 1.11.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.current.told import ToldGrid
from autonomy.frames import wgs84_from_ned
from autonomy.site import Box

VALUES_MAX = 4_000_000
"""Places, depths and times about the water that are kept at most."""
_AXIS_MAX = 100_000
_FASTEST_M_S = 10.0
_DEEPEST_M = 12_000.0
_SPEEDS = {"m": 1.0, "meter": 1.0, "metre": 1.0, "meters": 1.0, "metres": 1.0, "cm": 0.01}
_NAMES = {
    "eastward": ("uo", "u", "water_u", "u_east", "vozocrtx"),
    "northward": ("vo", "v", "water_v", "v_north", "vomecrty"),
}
_CALENDARS = ("standard", "gregorian", "proleptic_gregorian")
Tick = Callable[[float], None]
"""Told how far the reading is, 0 .. 1; raises to end it."""


class OceanFileError(ValueError):
    """The file is refused.

    Args:
        place: Name of the variable; "" for the whole file.
        reason: What is wrong with it.
        is_elsewhere: Whether it is about another place than the water.
    """

    def __init__(self, place: str, reason: str, *, is_elsewhere: bool = False) -> None:
        super().__init__(f"{place}: {reason}" if place else reason)
        self.place, self.reason = place, reason
        self.is_elsewhere = is_elsewhere


@dataclass(frozen=True, slots=True)
class OceanReading:
    """What was read."""

    grid: ToldGrid
    source: str
    """Title or institution as the file tells, "" where it does not."""
    made_at: datetime | None
    """When the model ran, as the file tells."""
    unknown_share: float
    """Share of the values of which the file says nothing, such as those on land."""
    warnings: tuple[str, ...]


def read_ocean_file(
    path: Path, origin: tuple[float, float], box: Box, tick: Tick = lambda _: None
) -> OceanReading:
    """Read the part of a file that is about a water.

    Args:
        path: The file.
        origin: Latitude and longitude of the water's frame, degrees.
        box: The water in its frame.
        tick: See ``Tick``.

    Raises:
        OceanFileError: With the variable's name.
    """
    import netCDF4

    try:
        if not path.stat().st_size:
            raise OceanFileError("", "the file is empty")
        with netCDF4.Dataset(path) as data:
            return _reading(data, origin, box, tick)
    except (OSError, RuntimeError, KeyError, IndexError, AttributeError) as error:
        raise OceanFileError(
            "", f"no NetCDF file that can be read: {getattr(error, 'strerror', None) or error}"
        ) from error


def _reading(
    data: Any,  # noqa: ANN401 - netCDF4 has no types
    origin: tuple[float, float],
    box: Box,
    tick: Tick,
) -> OceanReading:
    east, north = (_velocity(data, direction) for direction in ("eastward", "northward"))
    if east.dimensions != north.dimensions or east.shape != north.shape:
        raise OceanFileError(north.name, f"has not the dimensions of {east.name}")
    roles = _roles(data, east)
    notes: list[str] = []
    time_s = _times(data.variables[east.dimensions[roles["time"]]])
    latitude, rows = _places(data, east, roles["latitude"], 0.0)
    longitude, columns = _places(data, east, roles["longitude"], origin[1])
    low, high = _bounds(origin, box)
    near = _near(latitude, low[0], high[0], "latitude")
    latitude, rows = latitude[near], rows[near]
    near = _near(longitude, low[1], high[1], "longitude")
    longitude, columns = longitude[near], columns[near]
    depth, levels = np.array([0.0, _DEEPEST_M]), np.zeros(2, np.intp)
    if "depth" in roles:
        depth, levels = _depths(data.variables[east.dimensions[roles["depth"]]], box.depth_max_m)
    else:
        notes.append("The file has no depths; what it tells is taken to hold at every depth.")
    count = len(time_s) * len(depth) * len(latitude) * len(longitude)
    if count > VALUES_MAX:
        text = f"has {count:,} values about the water, more than {VALUES_MAX:,}"
        raise OceanFileError(east.name, f"{text}; leave out times, depths or places")
    wanted = {"depth": levels, "latitude": rows, "longitude": columns}
    velocity = np.empty(
        (len(time_s), len(depth), len(latitude), len(longitude), 2), dtype=np.float32
    )
    for axis, variable in enumerate((north, east)):
        scale = _scale(variable)
        for number in range(len(time_s)):
            tick((number / len(time_s) + axis) / 2.0)
            velocity[number, ..., axis] = scale * _layer(variable, roles, wanted, number)
    known = np.isfinite(velocity).all(axis=-1)
    if not known.any():
        raise OceanFileError(east.name, "knows no current in this water; is it all land there?")
    for axis, variable in enumerate((north, east)):
        fastest = float(np.nanmax(np.abs(velocity[..., axis])))
        if fastest > _FASTEST_M_S:
            text = f"has {fastest:g} m/s, more than {_FASTEST_M_S:g}: a wrong unit or fill value?"
            raise OceanFileError(variable.name, text)
    grid = ToldGrid(latitude, longitude, depth, time_s, velocity)
    unknown = 1.0 - float(known.mean())
    return OceanReading(grid, _source(data), _made_at(data), unknown, tuple(notes))


def _velocity(data: Any, direction: str) -> Any:  # noqa: ANN401 - netCDF4 has no types
    """Return the variable of a velocity, by its standard name or else by a usual name."""
    variables = [one for one in data.variables.values() if one.dtype != str]
    said = f"{direction}_sea_water_velocity"
    found = [one for one in variables if getattr(one, "standard_name", "") == said]
    if not found:
        found = [one for one in variables if said in getattr(one, "standard_name", "")]
    if not found:
        found = [
            one
            for one in variables
            if one.name.lower() in _NAMES[direction] and not getattr(one, "standard_name", "")
        ]
    if not found:
        raise OceanFileError("", f"the file has no {said}")
    if len(found) > 1:
        names = ", ".join(one.name for one in found)
        raise OceanFileError(found[0].name, f"is one of several of {said} ({names}); leave one")
    _scale(found[0])
    return found[0]


def _scale(variable: Any) -> float:  # noqa: ANN401
    """Return what turns a velocity into m/s."""
    unit = str(getattr(variable, "units", ""))
    match = re.fullmatch(r"([a-z]+)\s*(?:/\s*|[ .]?)(s|sec|second|seconds)(\^?-1)?", unit.strip())
    is_rate = match is not None and ("/" in unit) != (match[3] is not None)
    if match is None or not is_rate or match[1] not in _SPEEDS:
        text = f"is in {unit!r}" if unit else "has no units"
        raise OceanFileError(variable.name, f"{text}; understood are m/s and cm/s")
    return _SPEEDS[match[1]]


def _roles(data: Any, velocity: Any) -> dict[str, int]:  # noqa: ANN401
    """Return which dimension of a velocity is what."""
    roles: dict[str, int] = {}
    for place, name in enumerate(velocity.dimensions):
        axis = data.variables.get(name)
        if axis is None or axis.ndim != 1:
            if velocity.shape[place] == 1:
                continue
            text = "has no coordinate along it; only grids along latitudes and longitudes are read"
            raise OceanFileError(name, text)
        if not 0 < velocity.shape[place] <= _AXIS_MAX:
            raise OceanFileError(name, f"has {velocity.shape[place]} values, not 1 to {_AXIS_MAX}")
        role = _role(axis)
        if role is None and velocity.shape[place] == 1:
            continue
        if role is None or role in roles:
            raise OceanFileError(name, "is no latitude, longitude, depth in m, or time")
        roles[role] = place
    for role in ("time", "latitude", "longitude"):
        if role not in roles:
            raise OceanFileError(velocity.name, f"has no {role}")
    return roles


def _role(axis: Any) -> str | None:  # noqa: ANN401
    unit, said = str(getattr(axis, "units", "")), str(getattr(axis, "standard_name", ""))
    if " since " in unit or said == "time":
        return "time"
    for role, letter in (("latitude", "north"), ("longitude", "east")):
        if re.fullmatch(rf"degrees?_?{letter}|degrees?_?{letter[0].upper()}", unit):
            return role
        if said == role or axis.name.lower() in (role, role[:3]):
            return role
    is_vertical = getattr(axis, "positive", "") or said in ("depth", "height", "altitude")
    if is_vertical or axis.name.lower() in ("depth", "lev", "level", "z"):
        return "depth"
    return None


def _numbers(axis: Any) -> FloatArray:  # noqa: ANN401
    found = np.ma.filled(np.ma.asarray(axis[:]).astype(np.float64), np.nan)
    if not np.isfinite(found).all():
        raise OceanFileError(axis.name, "has values that are no numbers")
    return found


def _times(axis: Any) -> FloatArray:  # noqa: ANN401
    import netCDF4

    calendar = str(getattr(axis, "calendar", "standard")).lower()
    if calendar not in _CALENDARS:
        text = f"counts in the calendar {calendar!r}; understood are {', '.join(_CALENDARS)}"
        raise OceanFileError(axis.name, text)
    unit = str(getattr(axis, "units", ""))
    try:
        dates: Any = netCDF4.num2date(
            _numbers(axis),
            unit,
            calendar,
            only_use_cftime_datetimes=False,
            only_use_python_datetimes=True,
        )
        found = np.array([one.replace(tzinfo=UTC).timestamp() for one in dates])
    except (ValueError, OverflowError, TypeError) as error:
        if isinstance(error, OceanFileError):
            raise
        raise OceanFileError(axis.name, f"has no times in {unit!r}: {error}") from error
    if len(found) < 2 or not (np.diff(found) > 0.0).all():
        raise OceanFileError(axis.name, "needs two times or more that ascend")
    return found


def _places(
    data: Any,  # noqa: ANN401
    velocity: Any,  # noqa: ANN401
    place: int,
    middle_deg: float,
) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """Return ascending coordinates, and where in the file each of them is."""
    axis = data.variables[velocity.dimensions[place]]
    degrees = _numbers(axis)
    if _role(axis) == "longitude":
        degrees = (degrees - middle_deg + 180.0) % 360.0 - 180.0 + middle_deg
    elif np.abs(degrees).max() > 90.0:
        raise OceanFileError(axis.name, "has latitudes beyond 90 degrees")
    found, rows = np.unique(degrees, return_index=True)
    if len(found) < 2:
        raise OceanFileError(axis.name, "needs two values or more")
    return found, rows


def _depths(axis: Any, deepest_m: float) -> tuple[FloatArray, npt.NDArray[np.intp]]:  # noqa: ANN401
    """Return the levels from the surface to just below a water's floor, and where they are."""
    unit = str(getattr(axis, "units", ""))
    if unit not in ("m", "meter", "meters", "metre", "metres"):
        text = f"is in {unit!r}" if unit else "has no units"
        raise OceanFileError(axis.name, f"{text}; only depths in m are understood")
    depth = _numbers(axis)
    if str(getattr(axis, "positive", "down")).lower() == "up" or depth.max() <= 0.0:
        depth = -depth
    if depth.min() < -1.0 or depth.max() > _DEEPEST_M:
        raise OceanFileError(axis.name, f"has depths that are not 0 to {_DEEPEST_M:,.0f} m")
    found, rows = np.unique(np.maximum(depth, 0.0), return_index=True)
    kept = int(np.searchsorted(found, deepest_m)) + 1
    return found[:kept], rows[:kept]


def _bounds(origin: tuple[float, float], box: Box) -> tuple[FloatArray, FloatArray]:
    """Return least and greatest latitude and longitude of a water, near its origin's longitude."""
    north = np.linspace(box.x_min_m, box.x_max_m, 9)
    east = np.linspace(box.y_min_m, box.y_max_m, 9)
    mesh = np.stack(np.meshgrid(north, east, indexing="ij"), axis=-1).reshape(-1, 2)
    places = wgs84_from_ned(mesh, *origin)
    places[:, 1] = (places[:, 1] - origin[1] + 180.0) % 360.0 - 180.0 + origin[1]
    return places.min(axis=0), places.max(axis=0)


def _near(axis: FloatArray, low: float, high: float, name: str) -> slice:
    """Return the part of an axis that covers an interval."""
    if high < axis[0] or low > axis[-1]:
        text = f"the file has {axis[0]:.2f} to {axis[-1]:.2f}, the water {low:.2f} to {high:.2f}"
        raise OceanFileError(name, text, is_elsewhere=True)
    first = max(int(np.searchsorted(axis, low, side="right")) - 1, 0)
    last = min(int(np.searchsorted(axis, high, side="left")), len(axis) - 1)
    first, last = (first - 1, last) if first == last == len(axis) - 1 else (first, last)
    return slice(first, max(last, first + 1) + 1)


def _layer(
    variable: Any,  # noqa: ANN401
    roles: dict[str, int],
    wanted: dict[str, npt.NDArray[np.intp]],
    number: int,
) -> FloatArray:
    """Return one moment of a velocity: depths, latitudes, longitudes; NaN where it is unknown."""
    pieces: list[Any] = [0] * variable.ndim
    pieces[roles["time"]] = number
    order = [role for role in sorted(roles, key=roles.__getitem__) if role != "time"]
    for role in order:
        rows = wanted[role]
        pieces[roles[role]] = slice(int(rows.min()), int(rows.max()) + 1)
    raw: Any = variable[tuple(pieces)]
    values = np.ma.filled(np.ma.asarray(raw).astype(np.float64), np.nan)
    for axis, role in enumerate(order):
        values = values.take(wanted[role] - wanted[role].min(), axis=axis)
    names = [role for role in ("depth", "latitude", "longitude") if role in order]
    values = values.transpose([order.index(role) for role in names])
    return values if "depth" in order else values[None]


def _source(data: Any) -> str:  # noqa: ANN401
    words = [str(getattr(data, name, "")).strip() for name in ("title", "source", "institution")]
    return " ".join(next(filter(None, words), "").split())[:200]


def _made_at(data: Any) -> datetime | None:  # noqa: ANN401
    for name in ("forecast_reference_time", "date_created", "creation_date", "bulletin_date"):
        text = str(getattr(data, name, "")).strip()
        try:
            found = datetime.fromisoformat(text)
        except ValueError:
            continue
        return found if found.tzinfo is not None else found.replace(tzinfo=UTC)
    return None
