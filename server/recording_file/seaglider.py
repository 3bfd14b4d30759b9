"""Reads dives of a Seaglider: NetCDF files of its base station, one a dive."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from server.recording_file.flag_text import flags_of
from server.recording_file.netcdf import epoch_seconds, is_number, numbers, opened, text_of
from server.recording_file.raw import (
    COLUMNS_MAX,
    Column,
    Fixes,
    RawRecording,
    Role,
    UnreadableError,
)

_TIMES: Final = ("time", "ctd_time")
_ROLES: Final[Mapping[str, tuple[Role, str, str]]] = MappingProxyType(
    {
        "latitude": ("latitude", "", "deg"),
        "longitude": ("longitude", "", "deg"),
        "ctd_depth": ("depth", "", "m"),
        "depth": ("depth", "", "m"),
        "temperature": ("variable", "temperature", "degC"),
        "salinity": ("variable", "salinity", "1"),
        "conductivity": ("variable", "conductivity", "S/m"),
        "ctd_pressure": ("variable", "pressure", "dbar"),
        "eng_pitchAng": ("flight", "pitch_rad", "deg"),
        "eng_rollAng": ("flight", "roll_rad", "deg"),
        "eng_head": ("flight", "heading_rad", "deg"),
    }
)
"""Role, channel, and the unit where the file says none. ``eng_depth`` counts centimetres and is
none of them."""
_DENSITIES: Final = ("sigma_t", "sigma_theta", "density", "density_insitu")
"""They say g/m^3 and hold kg/m3."""
_QC: Final = MappingProxyType({0: 0, 1: 1, 2: 2, 3: 3, 4: 4, 5: 2, 6: -127, 8: 2, 9: -127})
"""The base station's flags in those of OG1: 5 changed, 6 unsampled, 8 interpolated, 9 missing."""
_INTERPOLATED: Final = 8


def is_seaglider(file: Any) -> bool:  # noqa: ANN401 - netCDF4 has no types
    """Tell whether an open file is a dive of a Seaglider."""
    return "sg_data_point" in file.dimensions or "log_gps_time" in file.variables


def read_dive(path: Path, name: str) -> RawRecording:
    """Read one dive.

    Raises:
        UnreadableError: If it cannot be read or has no time.
    """
    with opened(path, name) as file:
        time_name = next((one for one in _TIMES if one in file.variables), None)
        if time_name is None:
            raise UnreadableError(f"{name} has no variable time, nor ctd_time.")
        dimension = file.variables[time_name].dimensions
        times = epoch_seconds(file.variables[time_name], name)
        notes: list[str] = []
        columns = {"time": Column("time", times, "s", role="time")}
        depth = "depth" if "depth" in file.variables else "ctd_depth"
        for key, variable in file.variables.items():
            is_row = variable.dimensions == dimension and is_number(variable)
            if not is_row or key in (*_TIMES, *_DENSITIES):
                continue
            role, target, unit = _ROLES.get(key, ("ignore", "", ""))
            if role == "depth" and key != depth:
                role = "ignore"
            columns[key] = Column(
                key,
                numbers(variable),
                text_of(variable, "units") or unit,
                flags=_flags(file, key, notes),
                standard_name=text_of(variable, "standard_name"),
                role=role,
                target=target,
            )
            if len(columns) > COLUMNS_MAX:
                raise UnreadableError(f"{name} has more than {COLUMNS_MAX} columns.")
        if any(one in file.variables for one in _DENSITIES):
            notes.append("Densities are not imported: their unit in these files is wrong.")
        if "heading_rad" in {column.target for column in columns.values()}:
            notes.append("Headings are those of the compass: magnetic, not true.")
        return RawRecording(
            "seaglider",
            (name,),
            _without_unsampled(columns),
            np.arange(len(times)),
            np.zeros(len(times), dtype=np.int64),
            is_scattered=True,
            fixes=_fixes(file, name),
            scalars={
                key: str(file.getncattr(key))
                for key in ("dive_number", "glider", "platform_id")
                if key in file.ncattrs()
            },
            notes=tuple(notes),
        )


def _flags(file: Any, key: str, notes: list[str]) -> Any:  # noqa: ANN401 - as above
    variable = file.variables.get(f"{key}_qc")
    if variable is None or variable.dimensions != file.variables[key].dimensions:
        return None
    cells = np.ma.filled(np.ma.asarray(variable[:]), b" ")
    count = int((cells == b"%d" % _INTERPOLATED).sum())
    if count and key in _ROLES:
        notes.append(f"{count} values of {key} are interpolated and count as probably good.")
    return flags_of(variable, _QC)


def _without_unsampled(columns: dict[str, Column]) -> dict[str, Column]:
    """Leave out densities' like: columns without any number tell nothing."""
    return {
        key: column
        for key, column in columns.items()
        if column.role != "ignore" or np.isfinite(column.values).any()
    }


def _fixes(file: Any, name: str) -> Fixes | None:  # noqa: ANN401 - as above
    found = [file.variables.get(f"log_gps_{one}") for one in ("time", "lat", "lon")]
    if any(one is None for one in found):
        return None
    time, latitude, longitude = found
    return Fixes(epoch_seconds(time, name), numbers(latitude), numbers(longitude))
