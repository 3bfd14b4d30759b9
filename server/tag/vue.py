"""Detections as the program VUE writes and reads them: CSV with ten columns.

Columns are found by their names, in any order, and others are passed over. Every row is right, or
named with its line: a file is imported whole or not at all.
"""

import codecs
import csv
import io
import math
import re
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import IO

from robot_link.tag.check import is_tag
from server.base.text import shown

TIME, RECEIVER, TRANSMITTER = "Date and Time (UTC)", "Receiver", "Transmitter"
NAME, SERIAL, SENSOR, UNIT = (
    "Transmitter Name",
    "Transmitter Serial",
    "Sensor Value",
    "Sensor Unit",
)
STATION, LATITUDE, LONGITUDE = "Station Name", "Latitude", "Longitude"
COLUMNS = (TIME, RECEIVER, TRANSMITTER, NAME, SERIAL, SENSOR, UNIT, STATION, LATITUDE, LONGITUDE)
_NEEDED = (TIME, RECEIVER, TRANSMITTER)
ROWS_MAX = 2_000_000
FAULTS_MAX = 100
"""So many broken rows are named; their number is always told."""
_TEXT_MAX = 80
_LINE_MAX = 10_000
_TELL_ROWS = 5_000
_EARLIEST = datetime(1990, 1, 1, tzinfo=UTC)
_LATEST = datetime(2100, 1, 1, tzinfo=UTC)
_TIME = re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d(:\d\d(\.\d{1,6})?)?")


@dataclass(frozen=True, slots=True)
class RowFault:
    """A row that cannot be used."""

    line: int
    """Line of the file, counted from 1."""
    reason: str


class VueError(Exception):
    """The file was refused; the text is a sentence, ``faults`` names the first broken rows."""

    def __init__(self, sentence: str, faults: Iterable[RowFault] = ()) -> None:
        super().__init__(sentence)
        self.faults = list(faults)


@dataclass(frozen=True, slots=True)
class VueRow:
    """One row of an export."""

    line: int
    measured_at: datetime
    receiver: str
    tag: str
    tag_name: str | None
    tag_serial: str | None
    sensor: float | None
    sensor_unit: str | None
    station: str | None
    place_deg: tuple[float, float] | None
    """Latitude and longitude; None where the export does not know, or says 0, 0."""


def read_vue(file: IO[bytes], size: int, told: Callable[[float], None]) -> list[VueRow]:
    """Read an export.

    Args:
        file: Its bytes, UTF-8.
        size: How many they are.
        told: Called with the share that was read; may raise to stop.

    Raises:
        VueError: If it is none, or a row is broken.
    """
    lines = _lines(file)
    reader = csv.reader(lines, strict=True)
    rows: list[VueRow] = []
    faults: list[RowFault] = []
    broken = 0
    try:
        places = _places(next(reader, []))
        for cells in reader:
            if not cells:
                continue
            if len(rows) + broken >= ROWS_MAX:
                raise VueError(f"The file has more than {ROWS_MAX:,} rows.")
            try:
                rows.append(_row(reader.line_num, cells, places))
            except ValueError as error:
                broken += 1
                if len(faults) < FAULTS_MAX:
                    faults.append(RowFault(reader.line_num, str(error)))
            if (len(rows) + broken) % _TELL_ROWS == 0:
                told(file.tell() / max(1, size))
    except csv.Error as error:
        fault = RowFault(reader.line_num, f"this is no CSV: {error}")
        raise VueError(f"Line {reader.line_num}: this is no CSV.", [fault]) from error
    except UnicodeDecodeError as error:
        raise VueError("The file is not text in UTF-8.") from error
    if broken:
        first = faults[0]
        raise VueError(
            f"{broken:,} of {len(rows) + broken:,} rows cannot be used, the first in line "
            f"{first.line}: {first.reason}. Nothing was imported.",
            faults,
        )
    if not rows:
        raise VueError("The file has no detections.")
    return rows


def header(more: Iterable[str] = ()) -> str:
    """Return the first line of an export, with further columns behind the ten."""
    return _line([*COLUMNS, *more])


def written(
    row: VueRow, more: Iterable[str] = (), sensor_format: Callable[[float], str] = "{:g}".format
) -> str:
    """Return one line of an export."""
    latitude, longitude = row.place_deg or (None, None)
    return _line(
        [
            f"{row.measured_at:%Y-%m-%d %H:%M:%S}",
            row.receiver,
            row.tag,
            row.tag_name or "",
            row.tag_serial or "",
            "" if row.sensor is None else sensor_format(row.sensor),
            row.sensor_unit or "",
            row.station or "",
            "" if latitude is None else f"{latitude:.7f}",
            "" if longitude is None else f"{longitude:.7f}",
            *more,
        ]
    )


def _line(cells: list[str]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\r\n").writerow(cells)
    return text.getvalue()


def _lines(file: IO[bytes]) -> Generator[str]:
    decoder = codecs.getincrementaldecoder("utf-8-sig")()
    for number, line in enumerate(iter(lambda: file.readline(_LINE_MAX + 1), b""), 1):
        if len(line) > _LINE_MAX:
            raise VueError(f"Line {number} is longer than {_LINE_MAX:,} bytes: this is no export.")
        if b"\0" in line:
            raise VueError(f"Line {number} holds a zero byte: this is no text.")
        yield decoder.decode(line)


def _places(names: list[str]) -> dict[str, int]:
    found = {name.strip().lower(): place for place, name in enumerate(names)}
    lacking = [name for name in _NEEDED if name.lower() not in found]
    if lacking:
        raise VueError(
            f"Line 1 lacks the column {lacking[0]!r}. An export of VUE has {', '.join(COLUMNS)}."
        )
    return {name: found[name.lower()] for name in COLUMNS if name.lower() in found}


def _row(line: int, cells: list[str], places: dict[str, int]) -> VueRow:
    """Read a row.

    Raises:
        ValueError: If it is broken; the sentence names the column.
    """
    texts = [*map(str.strip, cells), ""]
    if len(max(texts, key=len)) > _TEXT_MAX:
        raise ValueError(_too_long(texts, places))
    last = len(cells)

    def cell(name: str) -> str:
        return texts[min(places.get(name, last), last)]

    receiver, tag = cell(RECEIVER), cell(TRANSMITTER)
    if not receiver:
        raise ValueError(f"{RECEIVER} is empty")
    if not is_tag(tag):
        raise ValueError(f"{TRANSMITTER} {shown(tag)!r} is not like A69-1601-179")
    return VueRow(
        line=line,
        measured_at=_moment(cell(TIME)),
        receiver=receiver,
        tag=tag,
        tag_name=cell(NAME) or None,
        tag_serial=cell(SERIAL) or None,
        sensor=_number(SENSOR, cell(SENSOR), math.inf),
        sensor_unit=cell(UNIT) or None,
        station=cell(STATION) or None,
        place_deg=_place(cell(LATITUDE), cell(LONGITUDE)),
    )


def _too_long(texts: list[str], places: dict[str, int]) -> str:
    """Return the sentence on a cell that is too long."""
    found = (name for name, at in places.items() if len(texts[min(at, len(texts) - 1)]) > _TEXT_MAX)
    return f"{next(found, 'a further column')} is longer than {_TEXT_MAX} characters"


def _moment(text: str) -> datetime:
    try:
        at = datetime.fromisoformat(text).replace(tzinfo=UTC) if _TIME.fullmatch(text) else None
    except ValueError:
        at = None
    if at is None:
        raise ValueError(f"{TIME} {shown(text)!r} is not like 2026-07-01 09:30:17")
    if not _EARLIEST <= at <= _LATEST:
        raise ValueError(f"{TIME} {text} lies outside 1990 to 2100")
    return at


def _number(name: str, text: str, most: float) -> float | None:
    if not text:
        return None
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{name} {shown(text)!r} is no number")
    if abs(number) > most:
        raise ValueError(f"{name} {number:g} is beyond {most:g}")
    return number


def _place(latitude: str, longitude: str) -> tuple[float, float] | None:
    north, east = _number(LATITUDE, latitude, 90.0), _number(LONGITUDE, longitude, 180.0)
    if (north is None) != (east is None):
        raise ValueError(f"{LATITUDE} and {LONGITUDE} belong together")
    if north is None or east is None or (north == 0.0 and east == 0.0):
        return None
    return north, east
