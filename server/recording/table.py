"""Reads a recorded deployment from CSV, strictly: every row is right, or named with its line."""

import math
from bisect import bisect_left
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import IO

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.channel import Channel, ChannelCatalogue
from robot_link.messages import STATE
from robot_link.report_field import ReportField

POSITION_COLUMNS = ("time", "latitude", "longitude", "depth")
FLIGHT_COLUMNS: Mapping[str, ReportField] = MappingProxyType(
    {channel.display_key: channel for channel in STATE.channels if channel.recorded is not None}
)
"""How the vehicle flew, by the name in a file's header, which says the unit that gliders' logs
usually have. Roll is positive to starboard, pitch nose up, net buoyancy heavy, mass position
forward. A row with a ``position_std_m`` has a position fix of that standard deviation; an empty
cell of any of them says that this row does not tell. With all of them a recording can be held
against a model."""
DERIVED_COLUMN = "derived_"
"""Begins the name of a column that was computed of others; it is not read, but computed again."""
DEPTH_MAX_M = 11_000.0
TIME_MIN_S = 0.0
TIME_MAX_S = 4_102_444_800.0
"""The beginning of the year 2100: what lies beyond is a wrong unit."""
COMMENT = "#"
_LINE_LENGTH_MAX = 100_000
ROWS_MAX = 2_000_000
"""A day of 23 rows a second; they are held in memory, at about a kilobyte each."""
_TELL_BYTES = 1 << 18
"""So much of a file is read between two words on how far it is."""


def ascending(times: Sequence[float]) -> list[int]:
    """Return the indices of the longest strictly ascending part of ``times``.

    One row with a time far ahead is left out alone, instead of all the rows that follow it. Of
    rows with the same time the first is kept.
    """
    ends: list[float] = []
    """Smallest last time of an ascending part of each length."""
    last: list[int] = []
    before: list[int] = []
    for index, time in enumerate(times):
        length = bisect_left(ends, time)
        before.append(last[length - 1] if length else -1)
        if length == len(ends):
            ends.append(time)
            last.append(index)
        elif time < ends[length]:
            ends[length] = time
            last[length] = index
    kept: list[int] = []
    index = last[-1] if last else -1
    while index >= 0:
        kept.append(index)
        index = before[index]
    return kept[::-1]


class Policy(StrEnum):
    """What to do with a file that has broken rows."""

    SKIP = "skip"
    """Leave the broken rows out and import the others."""
    REFUSE = "refuse"
    """Import nothing."""


@dataclass(frozen=True, slots=True)
class RowFault:
    """A row that cannot be used."""

    line: int
    """Line of the file, counted from 1."""
    reason: str


@dataclass(frozen=True, slots=True)
class Recording:
    """The rows of a file that are right, in order of time."""

    time_s: FloatArray
    """Seconds from the epoch, shape ``(n,)``, ascending strictly."""
    latitude_deg: FloatArray
    longitude_deg: FloatArray
    depth_m: FloatArray
    """Positive down."""
    values: dict[str, FloatArray]
    """By variable, in its unit; each of shape ``(n,)``."""
    flight: dict[str, FloatArray]
    """By channel, SI; each of shape ``(n,)``, NaN where a row does not tell."""
    skipped: tuple[RowFault, ...]


class RecordingError(Exception):
    """The file was refused as a whole; ``faults`` names the rows that are to blame."""

    def __init__(self, sentence: str, faults: tuple[RowFault, ...] = ()) -> None:
        super().__init__(sentence)
        self.faults = faults


Progress = Callable[[float], None]
"""Told the share of the file that is read, 0 .. 1; what it raises ends the reading."""


def read_recording(
    file: IO[bytes],
    size: int,
    policy: Policy,
    channels: ChannelCatalogue,
    on_progress: Progress | None = None,
) -> Recording:
    """Read a file with the columns ``time, latitude, longitude, depth``, and what was measured.

    Times are Unix seconds, UTC; depth is in metres, positive down; variables are in the units of
    the catalogue of channels, and ``FLIGHT_COLUMNS`` tell how the vehicle flew. A cell that is
    empty (of the flight it may be), not a number or out of its range, a time that does not ascend,
    and a row that repeats another are faults of their row.
    Empty lines, and lines that begin with ``#``, mean nothing.

    Args:
        file: The file, at its beginning.
        size: Its length in bytes, for the progress.
        policy: What to do with faults.
        channels: What can be measured.
        on_progress: Told how much of the file is read.

    Raises:
        RecordingError: If the header does not fit, no row is right, or there are faults and the
            policy is to refuse.
    """
    lines = (
        (number, line)
        for number, line in enumerate(_lines(file, size, on_progress or _ignore), start=1)
        if line.strip() and not line.startswith(COMMENT)
    )
    measured = _measured(_cells(next(lines, (1, ""))[1]), channels)
    columns = (*POSITION_COLUMNS, *measured)
    found: list[tuple[int, Row]] = []
    faults: list[RowFault] = []
    for number, line in lines:
        if len(found) + len(faults) >= ROWS_MAX:
            raise RecordingError(f"The file has more than {ROWS_MAX:,} rows; cut it into parts.")
        try:
            found.append((number, _checked(columns, _cells(line), channels)))
        except ValueError as error:
            faults.append(RowFault(number, str(error)))
    rows, misplaced = _in_order(found)
    faults = sorted([*faults, *misplaced], key=lambda fault: fault.line)
    if faults and policy is Policy.REFUSE:
        raise RecordingError(
            f"{_rows(len(faults))} broken, the first in line {faults[0].line}: "
            f"{faults[0].reason}. Nothing was imported.",
            tuple(faults),
        )
    if not rows:
        raise RecordingError("The file has no row that can be used.", tuple(faults))
    return _recording(rows, measured, tuple(faults))


Row = tuple[float, ...]


def _recording(
    rows: list[Row], measured: tuple[str, ...], skipped: tuple[RowFault, ...]
) -> Recording:
    """Turn rows into columns; those after the position are named by ``measured``."""
    time_s, latitude_deg, longitude_deg, depth_m, *others = np.array(rows, dtype=np.float64).T
    named = dict(zip(measured, others, strict=True))
    return Recording(
        time_s=time_s,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        depth_m=depth_m,
        values={
            name: column
            for name, column in named.items()
            if name not in FLIGHT_COLUMNS and not name.startswith(DERIVED_COLUMN)
        },
        flight={
            FLIGHT_COLUMNS[name].key: column * FLIGHT_COLUMNS[name].display_factor
            for name, column in named.items()
            if name in FLIGHT_COLUMNS
        },
        skipped=skipped,
    )


def _checked(columns: tuple[str, ...], cells: list[str], channels: ChannelCatalogue) -> Row:
    if len(cells) != len(columns):
        raise ValueError(f"the row has {len(cells)} cells, the header {len(columns)}")
    named = zip(columns, cells, strict=True)
    return tuple(_number(column, cell, channels.get(column)) for column, cell in named)


def _in_order(rows: list[tuple[int, Row]]) -> tuple[list[Row], list[RowFault]]:
    """Leave out the fewest rows so that time ascends, and say why each is left out."""
    kept = ascending([row[0] for _, row in rows])
    faults: list[RowFault] = []
    following = 0
    for index, (line, row) in enumerate(rows):
        if following < len(kept) and kept[following] == index:
            following += 1
            continue
        earlier = rows[kept[following - 1]] if following else None
        later = rows[kept[following]] if following < len(kept) else None
        faults.append(RowFault(line, _misplaced(row, earlier, later)))
    return [rows[index][1] for index in kept], faults


def _misplaced(row: Row, earlier: tuple[int, Row] | None, later: tuple[int, Row] | None) -> str:
    """Say why a row is left out, from the rows before and after it that are not."""
    if earlier is not None and row[0] <= earlier[1][0]:
        line, before = earlier
        if row == before:
            return f"the row repeats line {line}"
        if row[0] == before[0]:
            return f"the time is that of line {line}"
        return f"the time goes back behind line {line}"
    if later is None:
        raise ValueError("a row that time allows was left out")
    return f"the time is ahead of line {later[0]}, which follows"


def _number(column: str, cell: str, channel: Channel | None) -> float:
    if column.startswith(DERIVED_COLUMN):
        return math.nan
    if not cell:
        if column in FLIGHT_COLUMNS:
            return math.nan
        raise ValueError(f"{column} is empty")
    try:
        value = float(cell)
    except ValueError:
        raise ValueError(f"{column} is not a number: {cell[:40]!r}") from None
    if not math.isfinite(value):
        raise ValueError(f"{column} is not finite: {cell[:40]!r}")
    low, high = _RANGES.get(column, (-math.inf, math.inf))
    if not low <= value <= high:
        raise ValueError(f"{column} is {value:g}, outside {low:g} .. {high:g}")
    if channel is None:
        return value
    if fault := channel.fault(value):
        raise ValueError(fault)
    if channel.scale == "log" and channel.low >= 0.0 and value <= 0.0:
        raise ValueError(f"{column} is {value:g}, but must exceed 0")
    return value


_RANGES = {
    "time": (TIME_MIN_S, TIME_MAX_S),
    "latitude": (-90.0, 90.0),
    "longitude": (-180.0, 180.0),
    "depth": (0.0, DEPTH_MAX_M),
    **{
        name: (channel.recorded.low, channel.recorded.high)
        for name, channel in FLIGHT_COLUMNS.items()
        if channel.recorded is not None
    },
}


def _measured(header: list[str], channels: ChannelCatalogue) -> tuple[str, ...]:
    if tuple(header[:4]) != POSITION_COLUMNS:
        raise RecordingError(
            f"The header must name the columns {','.join(POSITION_COLUMNS)} and then the "
            f"variables; it is {','.join(header)[:200]!r}."
        )
    measured = tuple(header[4:])
    unknown = [
        name
        for name in measured
        if not (name in channels or name in FLIGHT_COLUMNS or name.startswith(DERIVED_COLUMN))
    ]
    if unknown or not measured:
        known = ", ".join(f"{v.key} ({v.unit})" for v in channels.values())
        what = f"The variable {unknown[0]!r} is unknown" if unknown else "There is no variable"
        flight = ", ".join(FLIGHT_COLUMNS)
        raise RecordingError(f"{what}; after the position may come {known}, and {flight}.")
    if len(set(measured)) != len(measured):
        raise RecordingError("A variable appears twice in the header.")
    return measured


def _cells(line: str) -> list[str]:
    """Split a line; cells are names and numbers, so quotes around one mean nothing."""
    return [cell.strip().strip('"').strip() for cell in line.split(",")]


def _lines(file: IO[bytes], size: int, on_progress: Progress) -> Generator[str]:
    """Decode the file line by line; bytes that are not UTF-8 break their cell, not the file."""
    done, told = 0, 0
    while line := file.readline(_LINE_LENGTH_MAX):
        text = line.decode("utf-8", errors="replace")
        yield text.removeprefix("\ufeff") if done == 0 else text
        done += len(line)
        if done - told >= min(_TELL_BYTES, size / 100):
            told = done
            on_progress(done / max(size, done))


def _rows(count: int) -> str:
    return "1 row is" if count == 1 else f"{count} rows are"


def _ignore(share: float) -> None:
    del share
