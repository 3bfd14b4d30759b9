"""Rows of a deployment as CSV: samples, states, fixes, and what each column means."""

import csv
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from db.query.measured.merged_rows import RowBlock
from robot_link.messages import RobotMode
from server.delivery.file_order import FileOrder
from server.delivery.judged import DEPTH, POSITION, Judged, Placed, places_of
from server.delivery.og1_state import STATE_VARIABLES, state_values

_MODES: Final = {int(mode): mode.name.lower() for mode in RobotMode}
_PLACE: Final = (
    ("time_utc", "", "moment of measurement, UTC, ISO 8601"),
    ("latitude_deg", "degree", "latitude, WGS84"),
    ("longitude_deg", "degree", "longitude, WGS84"),
    ("depth_m", "m", "depth below the surface, positive down"),
    ("position_std_m", "m", "standard deviation of the horizontal position, the larger axis"),
)
_QC: Final = (
    "quality flag of OG1.0: 0 no control, 1 good, 2 probably good, 3 probably bad, 4 bad;"
    " empty where there is no value"
)
Column = tuple[str, str, str]
"""Name, unit and meaning."""


@dataclass(frozen=True, slots=True)
class _Table:
    """One file: its columns, and where it is written."""

    columns: Sequence[Column]
    file: IO[str]


class RowTables:
    """Writes the tables side by side as the rows are read; close it by its ``with``."""

    def __init__(self, folder: Path, order: FileOrder, found: Judged) -> None:
        self._folder, self._order, self._found = folder, order, found
        self._open = ExitStack()
        folder.mkdir(parents=True)
        place_qc = [(f"{key}_qc", "", f"{key}: {_QC}") for key in (POSITION, DEPTH)]
        channels = [
            column
            for key, channel in order.channels.items()
            for column in (
                (column_name(key, channel.unit), channel.unit, channel.title),
                (f"{key}_qc", "", f"{channel.title}: {_QC}"),
            )
        ]
        states = [
            (f"{one.name.lower()}_{one.unit}", one.unit, f"{one.title}: {one.help}")
            for one in STATE_VARIABLES
        ]
        fix = ("has_fix", "", "1 where the position is a fix")
        mode = ("mode", "", "what the robot said that it does")
        self._flags = {
            key: found.og1(key, order.manual) for key in (POSITION, DEPTH, *order.channels)
        }
        self._samples = self._table("samples", [*_PLACE, *place_qc, *channels])
        self._states = self._table("states", [*_PLACE, *place_qc, fix, mode, *states])
        self._fixes = self._table("fixes", [*_PLACE, *place_qc])

    def __enter__(self) -> "RowTables":
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def take(self, offset: int, block: RowBlock) -> None:
        """Write rows from one on."""
        placed = places_of(block, self._order.wanted)
        is_sample = np.zeros(len(block), dtype=np.bool_)
        for values in block.value.values():
            is_sample |= np.isfinite(values)

        def place(chosen: BoolArray) -> list[list[str]]:
            return self._place(offset, block, placed, chosen)

        if is_sample.any():
            cells: list[list[str]] = []
            for key in self._order.channels:
                cells.append(number_cells(block.value[key][is_sample]))
                cells.append(self._cells_of_flags(key, offset, is_sample))
            _write(self._samples, [*place(is_sample), *cells])
        is_state = block.mode >= 0
        if is_state.any():
            wanted = self._order.wanted
            flown = [
                number_cells(state_values(block, one.key, wanted)[is_state])
                for one in STATE_VARIABLES
            ]
            fix = ["1" if one else "0" for one in block.has_fix[is_state].tolist()]
            mode = [_MODES.get(one, str(one)) for one in block.mode[is_state].tolist()]
            _write(self._states, [*place(is_state), fix, mode, *flown])
        if block.has_fix.any():
            _write(self._fixes, place(block.has_fix))

    def finish(self) -> list[str]:
        """Write what the columns mean; return the names of all tables."""
        with (self._folder / "columns.csv").open("w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(("file", "name", "unit", "meaning"))
            for name, table in self._tables().items():
                rows.writerows((f"{name}.csv", *column) for column in table.columns)
        return [*(f"{name}.csv" for name in self._tables()), "columns.csv"]

    def _tables(self) -> dict[str, _Table]:
        return {"samples": self._samples, "states": self._states, "fixes": self._fixes}

    def _table(self, name: str, columns: Sequence[Column]) -> _Table:
        path = self._folder / f"{name}.csv"
        file = self._open.enter_context(path.open("w", encoding="utf-8", newline=""))
        if self._order.is_simulated:
            file.write("# SIMULATION: this robot does not exist\n")
        file.write(f"# {self._order.identity}; see columns.csv\n")
        file.write(",".join(column for column, *_ in columns) + "\n")
        return _Table(columns, file)

    def _place(
        self, offset: int, block: RowBlock, placed: Placed, chosen: BoolArray
    ) -> list[list[str]]:
        at = np.datetime_as_string(block.measured_at_us[chosen].view("datetime64[us]"))
        return [
            [f"{one}Z" for one in at.tolist()],
            *(number_cells(placed.wgs84[chosen, number]) for number in range(3)),
            number_cells(block.position_std_m[chosen]),
            *(self._cells_of_flags(key, offset, chosen) for key in (POSITION, DEPTH)),
        ]

    def _cells_of_flags(self, key: str, offset: int, chosen: BoolArray) -> list[str]:
        flags = self._flags[key][offset : offset + len(chosen)][chosen]
        return ["" if one < 0 else str(one) for one in flags.tolist()]


def _write(table: _Table, columns: Sequence[list[str]]) -> None:
    table.file.write("\n".join(map(",".join, zip(*columns, strict=True))) + "\n")


def number_cells(values: FloatArray) -> list[str]:
    """Return numbers so that they read back as they are; nothing for what nobody told."""
    # a number that is not one differs from itself
    return [repr(one) if one == one else "" for one in values.tolist()]


def column_name(key: str, unit: str) -> str:
    """Return the name of a column, with its unit in letters that every program takes."""
    word = "".join(one if one.isalnum() else "_" for one in unit.replace("%", "percent")).strip("_")
    return f"{key}_{word}" if word and unit != "1" else key
