"""What columns of foreign files most probably mean, by a closed table of their names."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from server.recording_file.raw import Role
from server.recording_file.unit import is_known

_BRACKETS: Final = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\])]*)[\])]\s*$")
_WORD: Final = re.compile(r"[^a-z0-9]+")


@dataclass(frozen=True, slots=True)
class Guess:
    """What a column is taken for until the operator says otherwise."""

    role: Role
    target: str = ""
    """Key of a channel or of a state's channel."""
    unit: str = ""
    """What such columns usually have, for a file that says none."""


def _table() -> dict[str, Guess]:
    rows: tuple[tuple[Guess, str], ...] = (
        (Guess("time"), "time timestamp datetime date_time utc time_utc unix_time epoch unixtime"
         " gps_time sample_time measured_at"),
        (Guess("date"), "date day"),
        (Guess("clock"), "clock time_of_day hour hhmmss"),
        (Guess("latitude", unit="deg"), "latitude lat lat_deg y_deg gps_lat"),
        (Guess("longitude", unit="deg"), "longitude lon long lng lon_deg x_deg gps_lon"),
        (Guess("depth", unit="m"), "depth depth_m dep z_down water_depth_of_sensor ctd_depth"),
        (Guess("pressure", unit="dbar"), "pressure pres press p sea_pressure ctd_pressure prdm"),
        (Guess("altitude", unit="m"), "altitude alt height z elevation"),
        (Guess("variable", "temperature", "degC"), "temperature temp water_temperature t wtemp"
         " sea_water_temperature ctd_temperature t090c sci_water_temp temp_c"),
        (Guess("variable", "salinity", "1"), "salinity psal sal practical_salinity sal00"
         " sea_water_practical_salinity"),
        (Guess("variable", "conductivity", "mS/cm"), "conductivity cndc cond c0ms"),
        (Guess("variable", "chlorophyll", "ug/L"), "chlorophyll chla chl chl_a chlorophyll_a"
         " fluorescence fleco chlor fchl"),
        (Guess("variable", "dissolved_oxygen", "mg/L"), "dissolved_oxygen oxygen do odo"
         " oxygen_mass"),
        (Guess("variable", "oxygen_saturation", "%"), "oxygen_saturation oxysat do_sat odo_sat"),
        (Guess("variable", "turbidity", "1"), "turbidity turb ntu"),
        (Guess("variable", "cdom", "1e-9"), "cdom fdom"),
        (Guess("variable", "backscatter", "m-1"), "backscatter bbp bbp700 rbbp700 bb"),
        (Guess("variable", "blue_green_algae", "ug/L"), "blue_green_algae phycocyanin bga"),
        (Guess("variable", "ph", "1"), "ph"),
        (Guess("variable", "nitrate", "umol/L"), "nitrate no3"),
        (Guess("variable", "par", "umol m-2 s-1"), "par"),
        (Guess("variable", "blue_light", "counts"), "blue_light blue_light_counts"),
        (Guess("variable", "sound_level", "dB"), "sound_level spl"),
        (Guess("variable", "water_depth", "m"), "water_depth bottom_depth"),
        (Guess("flight", "pitch_rad", "deg"), "pitch pitch_deg"),
        (Guess("flight", "roll_rad", "deg"), "roll roll_deg"),
        (Guess("flight", "heading_rad", "deg"), "heading head heading_deg yaw"),
        (Guess("flight", "net_buoyancy_kg", "g"), "net_buoyancy_g"),
        (Guess("flight", "mass_position_m", "mm"), "mass_position_mm"),
        (Guess("flight", "tail_rad", "deg"), "tail_deg"),
        (Guess("flight", "position_std_m", "m"), "position_std_m"),
    )  # fmt: skip
    return {name: guess for guess, names in rows for name in names.split()}


NAMES: Final[Mapping[str, Guess]] = MappingProxyType(_table())


def name_and_unit(header: str) -> tuple[str, str]:
    """Split a header such as ``Temp (degC)``, ``depth [m]`` or ``speed_cm`` in name and unit."""
    text = header.strip()
    if found := _BRACKETS.match(text):
        return found["name"].strip(), found["unit"].strip()
    name, _, last = text.rpartition("_")
    if name and is_known(last) and plain(text) not in NAMES:
        return name, last
    return text, ""


def plain(name: str) -> str:
    """Return a name in lower case, with one underscore for whatever is neither letter nor digit."""
    return _WORD.sub("_", name.lower()).strip("_")


def guessed(name: str, unit: str) -> Guess:
    """Return what a column is taken for; one without a row in the table is left out."""
    found = NAMES.get(plain(name))
    if found is None:
        return Guess("ignore", unit=unit)
    return Guess(found.role, found.target, unit or found.unit)
