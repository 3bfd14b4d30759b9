"""Waypoints as CSV with units in the header: this project's own form, for spreadsheets.

========================================  =====================================================
column                                    holds
========================================  =====================================================
``name``                                  what operators call the waypoint
``north_m``, ``east_m``                   place in the water's frame
``latitude_deg``, ``longitude_deg``       place on the globe, in any of the three notations
``position_deg``                          both in one, latitude first
``depth_m`` or ``deep_m``                 where a glide turns; 0 is swum to
``altitude_m``                            the same, positive up
``shallow_m``                             where a climb turns
``motion``                                ``glide`` or ``swim``
``glide_angle_deg``                       below the horizon
``speed_m_s``                             vertical in a glide, along the way in a swim
``surfaces``                              ``yes``, ``no`` or nothing
========================================  =====================================================

Lines that begin with ``#`` are comments.
"""

import csv
import io
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from robot_link.mavlink.wire import grace
from robot_link.service.item_place import ItemRefusal, item_place
from server.plan_file.place import Placement, middle_of
from server.plan_file.position import angle_of, position_of
from server.plan_file.proposal import Findings, LatitudeLongitude, NorthEast, ReadChoices
from server.plan_file.stop import (
    FASTEST_M_S,
    SURFACE_M,
    Stop,
    asked_depth,
    reachable,
    taken_depth,
)
from server.water.proposal import ReadingError

COLUMNS: Final = (
    "name",
    "north_m",
    "east_m",
    "latitude_deg",
    "longitude_deg",
    "position_deg",
    "depth_m",
    "deep_m",
    "altitude_m",
    "shallow_m",
    "motion",
    "glide_angle_deg",
    "speed_m_s",
    "surfaces",
)
ROWS_MAX = 10_000
_UNITLESS = {name.rsplit("_", 1)[0] for name in COLUMNS if name.endswith(("_m", "_deg"))} | {
    "speed",
    "latitude",
    "longitude",
    "position",
    "lat",
    "lon",
    "angle",
}
_UNIT = re.compile(r"\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$")
_YES, _NO = ("yes", "true", "1", "y"), ("no", "false", "0", "n")
_HALF_TURN_DEG = 90.0


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table, by column; cells that say nothing are left out."""

    place: str
    cells: Mapping[str, str]


class _CellError(ValueError):
    """A cell cannot be taken."""

    def __init__(self, column: str, text: str, reason: str) -> None:
        super().__init__(reason)
        self.value = f"{column} {text[:40]!r}"


def read_table(text: str, findings: Findings) -> list[Row]:
    """Return the rows of a table.

    Raises:
        ReadingError: With the line at fault.
    """
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise ReadingError(("", "the file holds no line"))
    first, head = lines[0]
    delimiter = max(",;\t", key=head.count)
    names = _header(first, _cells(first, head, delimiter), findings)
    if len(lines) > ROWS_MAX + 1:
        raise ReadingError((f"line {lines[ROWS_MAX][0]}", f"{ROWS_MAX:,} rows are the most taken"))
    rows: list[Row] = []
    for number, line in lines[1:]:
        cells = _cells(number, line, delimiter)
        if len(cells) > len(names):
            reason = f"has {len(cells)} cells, the header {len(names)}"
            raise ReadingError((f"line {number}", reason))
        held = {name: cell for name, cell in zip(names, cells, strict=False) if name and cell}
        rows.append(Row(f"line {number}", held))
    return rows


def _cells(number: int, line: str, delimiter: str) -> list[str]:
    try:
        rows = list(csv.reader(io.StringIO(line), delimiter=delimiter, strict=True))
    except csv.Error as error:
        raise ReadingError((f"line {number}", f"no CSV: {error}")) from error
    return [cell.strip() for cell in rows[0]] if rows else []


def _header(number: int, cells: list[str], findings: Findings) -> list[str]:
    """Return the columns' names; "" of those that are not known."""
    names = [_column(cell) for cell in cells]
    place = f"line {number}"
    for name in names:
        if name in _UNITLESS:
            raise ReadingError((place, f"the column {name!r} names no unit, such as {name}_m"))
        if name in COLUMNS and names.count(name) > 1:
            raise ReadingError((place, f"the column {name!r} stands there twice"))
    unknown = [cell[:40] for cell, name in zip(cells, names, strict=True) if name not in COLUMNS]
    known = {name for name in names if name in COLUMNS}
    pairs = ({"north_m", "east_m"}, {"latitude_deg", "longitude_deg"}, {"position_deg"})
    if not any(pair <= known for pair in pairs):
        raise ReadingError(
            (
                place,
                "needs the columns north_m and east_m, or latitude_deg and longitude_deg, or"
                " position_deg",
            )
        )
    if unknown:
        findings.notes.append(f"Columns that are not known are left out: {', '.join(unknown)}.")
    return [name if name in COLUMNS else "" for name in names]


def _column(cell: str) -> str:
    """Return a column's name as ``name_unit``, also of ``Name (unit)``."""
    unit = _UNIT.search(cell)
    words = _UNIT.sub("", cell) + (f"_{unit[1]}" if unit else "")
    return re.sub(r"[\s/]+", "_", words.strip().lower())


def middle_of_rows(rows: list[Row]) -> LatitudeLongitude | None:
    """Return the middle of the places on the globe."""
    places: list[LatitudeLongitude] = []
    for row in rows:
        try:
            at = _globe(row.cells)
        except _CellError:
            continue
        if at is not None:
            places.append(at)
    return middle_of(places)


def stops_of(
    rows: list[Row], placement: Placement, choices: ReadChoices, findings: Findings
) -> list[Stop]:
    """Return the places to come to, and note the lines that are not taken."""
    stops: list[Stop] = []
    without: list[tuple[str, Stop]] = []
    for row in rows:
        try:
            stop = _stop(row, placement, choices, findings)
        except _CellError as error:
            findings.refuse(row.place, error.value, str(error))
            continue
        except ItemRefusal as refusal:
            findings.refuse(row.place, "", str(refusal))
            continue
        if stop is None:
            continue
        if stop.depth_m is None and stop.motion != "swim":
            without.append((row.place, stop))
        stops.append(stop)
    depth = asked_depth(findings, [place for place, _ in without], choices)
    for _, stop in without:
        stop.depth_m = depth
    return stops


def _stop(row: Row, placement: Placement, choices: ReadChoices, findings: Findings) -> Stop | None:
    cells = row.cells
    place = _place(cells, placement)
    if not reachable(placement, findings, row.place, place):
        return None
    stop = Stop(place, name=cells.get("name", ""))
    motion = cells.get("motion", "").lower()
    if motion not in ("", "glide", "swim"):
        raise _CellError("motion", motion, "is neither glide nor swim")
    if motion == "glide" or motion == "swim":
        stop.motion = motion
    column = next((name for name in ("deep_m", "depth_m", "altitude_m") if name in cells), None)
    if column is not None:
        sign = -1.0 if choices.turns_sign is not (column == "altitude_m") else 1.0
        value = f"{column} {cells[column]}"
        findings.says_depths = column != "altitude_m"
        depth = _number(cells, column) * sign
        stop.depth_m = taken_depth(findings, row.place, value, depth)
        if stop.depth_m is None:
            return None
        if motion == "glide" and stop.depth_m <= SURFACE_M:
            raise _CellError(column, cells[column], "is no depth to glide to")
    stop.shallow_m = _bounded(cells, "shallow_m", 0.0, 12_000.0)
    if stop.shallow_m is not None and stop.depth_m and stop.shallow_m >= stop.depth_m:
        raise _CellError("shallow_m", cells["shallow_m"], "is not above the deep turn")
    angle = _bounded(cells, "glide_angle_deg", 0.0, _HALF_TURN_DEG, is_open=True)
    stop.angle_rad = None if angle is None else math.radians(angle)
    stop.speed_m_s = _bounded(cells, "speed_m_s", 0.0, FASTEST_M_S)
    if stop.speed_m_s == 0.0:
        raise _CellError("speed_m_s", cells["speed_m_s"], "is no speed")
    stop.surfaces = _yes_or_no(cells)
    return stop


def _place(cells: Mapping[str, str], placement: Placement) -> NorthEast:
    at = _globe(cells)
    if at is not None:
        water, frame = placement.water, grace.MAV_FRAME_GLOBAL_RELATIVE_ALT
        return placement.shifted(item_place(frame, *at, water))
    for name in ("north_m", "east_m"):
        if name not in cells:
            raise _CellError(name, "", "the line has no place")
    return _number(cells, "north_m"), _number(cells, "east_m")


def _globe(cells: Mapping[str, str]) -> LatitudeLongitude | None:
    """Return the place on the globe, None where the line has none."""
    if "position_deg" in cells:
        found = position_of(cells["position_deg"])
        if found is None:
            raise _CellError("position_deg", cells["position_deg"], "is no position")
        return found
    if "latitude_deg" not in cells and "longitude_deg" not in cells:
        return None
    found_two: list[float] = []
    for name, letters in (("latitude_deg", "NS"), ("longitude_deg", "EW")):
        angle = angle_of(cells.get(name, ""), letters)
        if angle is None:
            raise _CellError(name, cells.get(name, ""), f"is no {name.removesuffix('_deg')}")
        found_two.append(angle)
    return found_two[0], found_two[1]


def _number(cells: Mapping[str, str], name: str) -> float:
    try:
        value = float(cells[name])
    except ValueError:
        reason = "is no number; a point, not a comma, stands before the decimals"
        raise _CellError(name, cells[name], reason) from None
    if not math.isfinite(value):
        raise _CellError(name, cells[name], "is no number")
    return value


def _bounded(
    cells: Mapping[str, str], name: str, least: float, most: float, *, is_open: bool = False
) -> float | None:
    if name not in cells:
        return None
    value = _number(cells, name)
    is_in = least < value < most if is_open else least <= value <= most
    if not is_in:
        raise _CellError(name, cells[name], f"is not between {least:g} and {most:g}")
    return value


def _yes_or_no(cells: Mapping[str, str]) -> bool | None:
    text = cells.get("surfaces", "").lower()
    if text in _YES:
        return True
    if text in _NO:
        return False
    if text:
        raise _CellError("surfaces", text, "is neither yes nor no")
    return None
