"""Reads OG1.0 files, our own and those of others, which seldom keep to the format."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from server.recording_file.flag_text import flags_of, og1_table
from server.recording_file.netcdf import epoch_seconds, is_number, numbers, opened, text_of
from server.recording_file.raw import COLUMNS_MAX, Column, RawRecording, Role, UnreadableError

DIMENSION: Final = "n_measurements"
SIMULATION: Final = "SIMULATION"
_ALIASES: Final[Mapping[str, tuple[Role, str]]] = MappingProxyType(
    {
        "time": ("time", ""),
        "latitude": ("latitude", ""),
        "longitude": ("longitude", ""),
        "latitude_gps": ("fix_latitude", ""),
        "longitude_gps": ("fix_longitude", ""),
        "depth": ("depth", ""),
        "glider_depth": ("depth", ""),
        "depth_z": ("depth", ""),
        "pres": ("pressure", ""),
        "pressure": ("pressure", ""),
        "temp": ("variable", "temperature"),
        "psal": ("variable", "salinity"),
        "cndc": ("variable", "conductivity"),
        "chla": ("variable", "chlorophyll"),
        "oxygen_mass": ("variable", "dissolved_oxygen"),
        "oxysat": ("variable", "oxygen_saturation"),
        "cdom": ("variable", "cdom"),
        "rbbp700": ("variable", "backscatter"),
        "turb": ("variable", "turbidity"),
        "ph": ("variable", "ph"),
        "par": ("variable", "par"),
        "nitrate": ("variable", "nitrate"),
        "phycocyanin": ("variable", "blue_green_algae"),
        "blue_light_counts": ("variable", "blue_light"),
        "sound_level": ("variable", "sound_level"),
        "water_depth": ("variable", "water_depth"),
        "pitch": ("flight", "pitch_rad"),
        "roll": ("flight", "roll_rad"),
        "heading": ("flight", "heading_rad"),
        "net_buoyancy": ("flight", "net_buoyancy_kg"),
        "mass_position": ("flight", "mass_position_m"),
        "tail_angle": ("flight", "tail_rad"),
    }
)
"""Role and channel, by names in lower case."""
_SCALARS: Final = (
    "platform_model", "wmo_identifier", "platform_serial_number", "trajectory",
)  # fmt: skip


def is_og1(file: Any) -> bool:  # noqa: ANN401 - netCDF4 has no types
    """Tell whether an open file says that it is OG1, or has its rows."""
    says = "og-1" in text_of(file, "Conventions").lower()
    return says or any(one.lower() == DIMENSION for one in file.dimensions)


def read_og1(path: Path, name: str) -> RawRecording:
    """Read one file.

    Raises:
        UnreadableError: If it cannot be read or has no time.
    """
    with opened(path, name) as file:
        by_name = {key.lower(): variable for key, variable in file.variables.items()}
        time = by_name.get("time")
        if time is None or len(time.dimensions) != 1:
            raise UnreadableError(f"{name} has no variable TIME with a value for each row.")
        columns = {time.name: Column(time.name, epoch_seconds(time, name), "s", role="time")}
        for key, variable in by_name.items():
            if variable.dimensions != time.dimensions or variable is time:
                continue
            if not is_number(variable) or key.endswith("_qc"):
                continue
            columns[variable.name] = _column(variable, by_name)
            if len(columns) > COLUMNS_MAX:
                raise UnreadableError(f"{name} has more than {COLUMNS_MAX} columns.")
        rows = len(columns[time.name].values)
        scalars = {key: text_of(file, key) for key in file.ncattrs()}
        scalars |= {key: str(by_name[key][...]) for key in _SCALARS if _is_scalar(by_name, key)}
        return RawRecording(
            "og1",
            (name,),
            columns,
            np.arange(rows),
            np.zeros(rows, dtype=np.int64),
            is_scattered=True,
            scalars=scalars,
            notes=_notes(scalars),
            is_simulated=_is_simulated(scalars),
        )


def _column(variable: Any, by_name: Mapping[str, Any]) -> Column:  # noqa: ANN401 - as above
    role, target = _ALIASES.get(variable.name.lower(), ("ignore", ""))
    quality = by_name.get(f"{variable.name.lower()}_qc")
    flags = None
    if quality is not None and quality.dimensions == variable.dimensions:
        table = og1_table(quality)
        flags = flags_of(quality, table) if table else None
    return Column(
        variable.name,
        numbers(variable),
        text_of(variable, "units"),
        flags=flags,
        standard_name=text_of(variable, "standard_name"),
        role=role,
        target=target,
    )


def _is_scalar(by_name: Mapping[str, Any], key: str) -> bool:
    return key in by_name and by_name[key].dimensions == ()


def _is_simulated(scalars: Mapping[str, str]) -> bool:
    marked = ("id", "title", "trajectory", "platform_serial_number", "comment")
    says = scalars.get("is_simulated", "").lower() == "yes"
    return says or any(scalars.get(key, "").startswith(SIMULATION) for key in marked)


def _notes(scalars: Mapping[str, str]) -> tuple[str, ...]:
    if _is_simulated(scalars):
        return ("The file is marked SIMULATION: its robot does not exist.",)
    return ()
