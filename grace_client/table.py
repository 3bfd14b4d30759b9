"""Answers as tables and grids: pandas and xarray, with units where these keep them."""

from collections.abc import Sequence
from datetime import datetime

import numpy as np
import pandas as pd
import xarray as xr

from grace_client.generated import models as m

_POSITION_UNITS = {"north_m": "m", "east_m": "m", "depth_m": "m", "std_m": "m"}


def samples(told: m.SamplesView) -> pd.DataFrame:
    """Return a channel's history: index ``measured_at`` (UTC), column of the channel's name.

    ``attrs["units"]`` has the unit of each column; positions, flags and fidelity are columns where
    the station told them.
    """
    columns: dict[str, object] = {told.channel: told.value}
    for name in ("received_at", "flag", *_POSITION_UNITS, "fidelity", "smoothed"):
        values = getattr(told, name)
        if values is not None:
            columns[name] = values
    frame = pd.DataFrame(columns, index=_times(told.measured_at))
    units = {name: unit for name, unit in _POSITION_UNITS.items() if name in columns}
    frame.attrs = {
        "robot": told.robot,
        "units": {told.channel: told.unit, **units},
        "is_decimated": told.decimated,
        "is_derived": told.is_derived,
    }
    return frame


def track(told: m.TrackView) -> pd.DataFrame:
    """Return where a robot believed to be: index ``measured_at`` (UTC)."""
    names = ("north_m", "east_m", "depth_m", "std_m", "fidelity", "adrift")
    places = ("latitude_deg", "longitude_deg")
    columns = {name: getattr(told, name) for name in (*names, *places)}
    frame = pd.DataFrame(columns, index=_times(told.measured_at))
    frame["std_m"] = frame["std_m"].astype(float)
    degrees = dict.fromkeys(places, "degree")
    frame.attrs = {
        "robot": told.robot,
        "units": {**_POSITION_UNITS, **degrees},
        "is_decimated": told.decimated,
    }
    return frame


def field_map(told: m.FieldMapView) -> xr.Dataset:
    """Return a map: variables ``mean`` and ``std`` over ``north``, ``east`` and ``depth``, m.

    ``NaN`` where there is no water. Of a variable whose scale is ``log`` they are those of its
    natural logarithm, as their ``units`` say.
    """
    axes = told.axes
    coordinates = {
        "north": ("north", np.asarray(axes.x_m), {"units": "m", "long_name": "north"}),
        "east": ("east", np.asarray(axes.y_m), {"units": "m", "long_name": "east"}),
        "depth": (
            "depth",
            np.asarray(axes.z_m),
            {"units": "m", "positive": "down", "long_name": "depth"},
        ),
    }
    dimensions = ("north", "east", "depth")

    def grid(values: list[float | None]) -> np.ndarray:
        return np.asarray(values, dtype=float).reshape(told.shape)

    found = xr.Dataset(
        {
            "mean": (
                dimensions,
                grid(told.mean),
                {"units": told.value_unit, "long_name": told.title},
            ),
            "std": (
                dimensions,
                grid(told.std),
                {
                    "units": told.value_unit,
                    "long_name": f"standard deviation of {told.title}",
                },
            ),
        },
        coords=coordinates,
    )
    found.attrs = {
        "robot": told.robot,
        "variable": told.variable,
        "scale": told.scale,
        "model": told.model,
        "origin_latitude_deg": told.origin_latitude_deg,
        "origin_longitude_deg": told.origin_longitude_deg,
        "simulation": int(told.simulation),
    }
    return found


def _times(measured_at: Sequence[datetime]) -> pd.DatetimeIndex:
    return pd.DatetimeIndex(pd.to_datetime(list(measured_at), utc=True), name="measured_at")
