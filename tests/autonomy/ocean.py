"""Draws CF NetCDF files of ocean models."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from autonomy.arrays import FloatArray
from autonomy.site import LAKE

ORIGIN = (LAKE.origin_latitude_deg, LAKE.origin_longitude_deg)
EPOCH_S = 1_790_000_000.0
HOURS = (0.0, 6.0, 12.0, 18.0, 24.0)
DEPTHS = (0.5, 5.0, 10.0, 20.0, 40.0)


def rate(
    latitude: FloatArray, longitude: FloatArray, depth: FloatArray, hours: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the drawn northward and eastward velocity, linear in each coordinate, m/s."""
    north = 0.1 + 2.0 * (latitude - ORIGIN[0]) - 0.002 * depth
    east = -0.05 + 1.0 * (longitude - ORIGIN[1]) + 0.004 * hours
    return north, east


def ocean(
    path: Path,
    *,
    units: str = "m s-1",
    scale: float = 1.0,
    is_packed: bool = False,
    is_up: bool = False,
    is_360: bool = False,
    is_turned: bool = False,
    calendar: str = "standard",
    dims: Sequence[str] = ("time", "depth", "latitude", "longitude"),
    names: tuple[str, str] = ("eastward_sea_water_velocity", "northward_sea_water_velocity"),
    start_s: float = EPOCH_S,
    field: Callable[..., tuple[Any, Any]] = rate,
    origin: tuple[float, float] = ORIGIN,
    land: Callable[..., Any] | None = None,
) -> Path:
    """Write a file about the lake, 5 x 5 places every 0.01 degrees."""
    offsets = np.arange(-2, 3) * 0.01
    axes = {
        "time": np.array(HOURS),
        "depth": np.array(DEPTHS),
        "latitude": origin[0] + offsets,
        "longitude": origin[1] + offsets,
    }
    mesh = np.meshgrid(*axes.values(), indexing="ij")
    north, east = (
        np.broadcast_to(one, mesh[0].shape) for one in field(*mesh[2:], mesh[1], mesh[0])
    )
    if land is not None:
        hidden = np.broadcast_to(land(*mesh[2:]), mesh[0].shape)
        north, east = (np.ma.array(one, mask=hidden) for one in (north, east))
    data: Any
    with netCDF4.Dataset(path, "w") as data:
        data.title = "Bay model"
        data.date_created = "2026-09-21T10:00:00Z"
        for name in dims:
            values = axes[name]
            if name == "longitude" and is_360:
                values = values % 360.0
            if name == "depth" and is_up:
                values = -values
            if name == "latitude" and is_turned:
                values = values[::-1]
            data.createDimension(name, len(values))
            axis = data.createVariable(name, "f8", (name,))
            axis[:] = values
        if "time" in dims:
            data["time"].calendar = calendar
            data["time"].units = f"hours since {np.datetime64(int(start_s), 's')}".replace("T", " ")
        if "depth" in dims:
            data["depth"].setncatts({"units": "m", "positive": "up" if is_up else "down"})
        data["latitude"].units, data["longitude"].units = "degrees_north", "degrees_east"
        for short, said, values in zip(("uo", "vo"), names, (east, north), strict=True):
            if not said:
                continue
            packing = {"fill_value": -32767} if is_packed else {"fill_value": 9.96921e36}
            one = data.createVariable(short, "i2" if is_packed else "f4", dims, **packing)
            one.setncatts({"standard_name": said, "units": units})
            if is_packed:
                one.setncatts({"scale_factor": 1e-4 * scale, "add_offset": 0.2 * scale})
            one[:] = scale * laid_out(values, list(axes), dims, is_turned)
    return path


def laid_out(
    values: FloatArray, names: Sequence[str], dims: Sequence[str], is_turned: bool
) -> FloatArray:
    """Return an array in the order of a variable's dimensions, without those that it lacks."""
    pieces = tuple(slice(None) if name in dims else 0 for name in names)
    left = [name for name in names if name in dims]
    turned = values[pieces].transpose([left.index(name) for name in dims])
    return np.flip(turned, axis=dims.index("latitude")) if is_turned else turned
