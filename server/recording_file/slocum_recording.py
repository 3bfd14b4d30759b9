"""Puts flight and science files of a Slocum together as one recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from server.recording_file.mapping import DDMM
from server.recording_file.raw import Column, RawRecording, Role, Tell, UnreadableError
from server.recording_file.slocum import Cycles, read_slocum

Side = Literal["flight", "science"]
_FLIGHT_LETTERS, _SCIENCE_LETTERS = "dsm", "etn"
"""First letters of the endings: dbd, sbd and mbd; ebd, tbd and nbd."""
_NO_FIX: Final = 9000.0


@dataclass(frozen=True, slots=True)
class _Product:
    """A column, and the sensors that may tell it, the best first."""

    name: str
    side: Side
    sensors: tuple[str, ...]
    role: Role
    target: str = ""
    unit: str = ""
    """The unit to believe, "" for that of the sensor list."""


_PRODUCTS: Final = (
    _Product("fix latitude", "flight", ("m_gps_lat",), "fix_latitude", unit=DDMM),
    _Product("fix longitude", "flight", ("m_gps_lon",), "fix_longitude", unit=DDMM),
    _Product("latitude", "flight", ("m_lat",), "latitude", unit=DDMM),
    _Product("longitude", "flight", ("m_lon",), "longitude", unit=DDMM),
    _Product("depth", "flight", ("m_depth",), "depth", unit="m"),
    _Product("pitch", "flight", ("m_pitch",), "flight", "pitch_rad", "rad"),
    _Product("roll", "flight", ("m_roll",), "flight", "roll_rad", "rad"),
    _Product("heading", "flight", ("m_heading",), "flight", "heading_rad", "rad"),
    _Product("mass position", "flight", ("m_battpos",), "flight", "mass_position_m", "in"),
    _Product("oil volume", "flight", ("m_de_oil_vol", "m_ballast_pumped"), "ignore", unit="cc"),
    _Product("battery", "flight", ("m_battery",), "ignore", unit="V"),
    _Product("pressure", "science", ("sci_water_pressure",), "pressure", unit="bar"),
    _Product("temperature", "science", ("sci_water_temp",), "variable", "temperature", "degC"),
    _Product("conductivity", "science", ("sci_water_cond",), "variable", "conductivity", "S/m"),
    _Product(
        "chlorophyll",
        "science",
        ("sci_flntu_chlor_units", "sci_flbbcd_chlor_units"),
        "variable",
        "chlorophyll",
        "ug/L",
    ),
)
_TIME: Final[Mapping[Side, tuple[str, ...]]] = {
    "flight": ("m_present_time",),
    "science": ("sci_m_present_time", "m_present_time"),
}
_CTD: Final = ("temperature", "conductivity", "pressure")


def side_of(name: str) -> Side | None:
    """Return which computer wrote a file, by the ending of its name."""
    letter = Path(name).suffix.lower()[1:2]
    if letter and letter in _FLIGHT_LETTERS:
        return "flight"
    return "science" if letter and letter in _SCIENCE_LETTERS else None


def read_pair(
    files: Sequence[tuple[str, Path]], caches: Mapping[str, Path], tell: Tell
) -> RawRecording:
    """Read flight and science files, whose names pair them, as one recording.

    Cycles of which no column tells anything are no rows.

    Raises:
        UnreadableError: As ``read_slocum``; and if no file says the time.
    """
    parts: list[tuple[int, Side, FloatArray, dict[str, FloatArray]]] = []
    notes: list[str] = _lonely(files)
    unread: list[int] = []
    for number, (name, path) in enumerate(files):
        side = side_of(name)
        if side is None:
            raise UnreadableError(f"{name}: the ending says neither flight nor science.")
        wanted = [one for product in _PRODUCTS for one in product.sensors] + [*_TIME[side]]
        cycles = read_slocum(path, name, caches, wanted)
        unread.append(cycles.sensors - len(cycles.values))
        parts.append((number, side, *_products(cycles, side, name)))
        tell((number + 1) / len(files))
    present = {key for *_, columns in parts for key in columns}
    if "heading" in present:
        notes.append("Headings are those of the compass: magnetic, not true.")
    notes.append(f"{sum(unread):,} sensors of the files have no known meaning and are not read.")
    return _joined([name for name, _ in files], parts, present, notes)


def _lonely(files: Sequence[tuple[str, Path]]) -> list[str]:
    """Name each file whose other half is not there."""
    stems: dict[str, set[str | None]] = {}
    for name, _ in files:
        stems.setdefault(Path(name).stem, set()).add(side_of(name))
    return [
        f"{stem}: the {'science' if sides == {'flight'} else 'flight'} file is not among the files;"
        f" what it would tell is missing."
        for stem, sides in sorted(stems.items())
        if len(sides) == 1
    ]


def _products(cycles: Cycles, side: Side, name: str) -> tuple[FloatArray, dict[str, FloatArray]]:
    time_name = next((one for one in _TIME[side] if one in cycles.values), None)
    if time_name is None:
        raise UnreadableError(f"{name} has no {_TIME[side][0]}, which tells the time.")
    columns: dict[str, FloatArray] = {}
    for product in _PRODUCTS:
        told = [cycles.values[one] for one in product.sensors if one in cycles.values]
        if product.side == side and told:
            columns[product.name] = told[0].copy()
    for key in ("fix latitude", "fix longitude"):
        if key in columns:
            columns[key][np.abs(columns[key]) > _limit(key)] = np.nan
    if all(key in columns for key in _CTD):
        is_opening = np.all([columns[key] == 0.0 for key in _CTD], axis=0)
        for key in _CTD:
            columns[key][is_opening] = np.nan
    return cycles.values[time_name], columns


def _limit(key: str) -> float:
    """Beyond it a number of degrees and minutes says that there is no fix."""
    return _NO_FIX if key == "fix latitude" else 2.0 * _NO_FIX


def _joined(
    names: Sequence[str],
    parts: Sequence[tuple[int, Side, FloatArray, dict[str, FloatArray]]],
    present: set[str],
    notes: list[str],
) -> RawRecording:
    times, numbers, places = [], [], []
    series: dict[str, list[FloatArray]] = {key: [] for key in present}
    for number, _, time_s, columns in parts:
        told: BoolArray = np.zeros(len(time_s), dtype=np.bool_)
        for column in columns.values():
            told |= np.isfinite(column)
        times.append(time_s[told])
        numbers.append(np.full(int(told.sum()), number))
        places.append(np.flatnonzero(told) + 1)
        for key in present:
            column = columns.get(key, np.full(len(time_s), np.nan))
            series[key].append(column[told])
    columns = {"time": Column("time", np.concatenate(times), "s", role="time")}
    for product in _PRODUCTS:
        if product.name in present:
            columns[product.name] = Column(
                product.name,
                np.concatenate(series[product.name]),
                product.unit,
                role=product.role,
                target=product.target,
            )
    return RawRecording(
        "slocum",
        tuple(names),
        columns,
        np.concatenate(places),
        np.concatenate(numbers),
        is_scattered=True,
        notes=tuple(notes),
    )
