"""Reads text tables with any columns: separator, decimal comma, header and comments are found."""

import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import IO, Final

import numpy as np

from autonomy.arrays import FloatArray
from server.recording_file.guess import guessed, name_and_unit
from server.recording_file.raw import (
    COLUMNS_MAX,
    Column,
    FileFault,
    RawRecording,
    Tell,
    UnreadableError,
)

ROWS_MAX: Final = 2_000_000
"""Of texts, which are held in memory until their columns are known."""
_COMMENT: Final = "#"
_LOOK_LINES: Final = 200
_LINE_LENGTH_MAX: Final = 100_000
_TELL_ROWS: Final = 20_000
Line = tuple[int, str]
"""Its number, counted from 1, and its text."""
_MISSING: Final = frozenset(("", "nan", "na", "n/a", "null", "none", "-"))


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a table is written."""

    separator: str
    has_decimal_comma: bool

    def cells(self, line: str) -> list[str]:
        """Split a line; quotes around a cell mean nothing."""
        return [cell.strip().strip('"').strip() for cell in line.split(self.separator)]

    def number(self, cell: str) -> float:
        """Return the number in a cell, NaN for an empty one.

        Raises:
            ValueError: If it is none.
        """
        if cell.lower() in _MISSING:
            return math.nan
        return float(cell.replace(",", ".") if self.has_decimal_comma else cell)


def read_csv(path: Path, name: str, tell: Tell) -> RawRecording:
    """Read a table.

    A line whose number of cells is not that of the header is a fault of that line, and so is a
    cell that is no number in a column of numbers.

    Raises:
        UnreadableError: If there is no header, no row, or there are too many.
    """
    with path.open("rb") as file:
        size = max(1, path.stat().st_size)
        lines = _lines(file, tell, size)
        dialect, (_, header_line), first = _begin(lines, name)
        header = dialect.cells(header_line)
        _check_header(header, name)
        numbers: list[int] = []
        rows: list[list[str]] = []
        faults: list[FileFault] = []
        for number, line in chain(first, lines):
            cells = dialect.cells(line)
            if len(cells) != len(header):
                reason = f"the row has {len(cells)} cells, the header {len(header)}"
                faults.append(FileFault(f"line {number}", reason))
                continue
            numbers.append(number)
            rows.append(cells)
            if len(rows) > ROWS_MAX:
                raise UnreadableError(f"{name} has more than {ROWS_MAX:,} rows; cut it into parts.")
    if not rows and not faults:
        raise UnreadableError(f"{name} has a header, but no row.")
    return _recording(name, header, dialect, np.array(numbers, dtype=np.int64), rows, faults)


def _lines(file: IO[bytes], tell: Tell, size: int) -> Generator[Line]:
    done = 0
    for number, line in enumerate(iter(lambda: file.readline(_LINE_LENGTH_MAX), b""), start=1):
        done += len(line)
        if number % _TELL_ROWS == 0:
            tell(min(1.0, done / size))
        text = line.decode("utf-8", errors="replace").removeprefix("\ufeff").rstrip("\r\n")
        if text.strip() and not text.lstrip().startswith(_COMMENT):
            yield number, text


def _begin(lines: Iterator[Line], name: str) -> tuple[Dialect, Line, list[Line]]:
    """Look at the first lines: return the dialect, the header, and the rows that were read."""
    look: list[Line] = []
    for pair in lines:
        look.append(pair)
        if len(look) >= _LOOK_LINES:
            break
    if not look:
        raise UnreadableError(f"{name} is empty: it has no line with text.")
    if any("\x00" in text for _, text in look):
        raise UnreadableError(f"{name} is no text, and no format that can be read here.")
    dialect = _dialect([text for _, text in look])
    for index, (_, text) in enumerate(look):
        cells = [cell for cell in dialect.cells(text) if cell]
        words = sum(not _is_number(cell, dialect) for cell in cells)
        if len(cells) > 1 and words > len(cells) / 2 and not _is_data(cells):
            return dialect, look[index], look[index + 1 :]
    raise UnreadableError(
        f"{name} has no header: no line among its first {len(look)} names columns."
    )


def _dialect(look: Sequence[str]) -> Dialect:
    """Choose the separator that cuts most lines into the same number of cells."""

    def worth(separator: str) -> tuple[int, int]:
        counts = [line.count(separator) for line in look]
        usual = max(set(counts), key=counts.count)
        return (counts.count(usual) if usual else 0, usual)

    separator = max(("\t", ";", ","), key=worth)
    has_decimal_comma = separator != "," and any(
        _is_comma_number(cell) for line in look for cell in line.split(separator)
    )
    return Dialect(separator, has_decimal_comma)


def _is_comma_number(cell: str) -> bool:
    whole, comma, part = cell.strip().strip('"').partition(",")
    return bool(comma) and whole.lstrip("+-").isdigit() and part.isdigit()


def _is_number(cell: str, dialect: Dialect) -> bool:
    try:
        dialect.number(cell)
    except ValueError:
        return False
    return True


def _is_data(cells: Sequence[str]) -> bool:
    """Tell a row of times in words from a header: its first cell begins with a digit."""
    return cells[0][:1].isdigit()


def _check_header(header: Sequence[str], name: str) -> None:
    if len(header) > COLUMNS_MAX:
        raise UnreadableError(f"{name} has {len(header)} columns; at most {COLUMNS_MAX} are read.")
    twice = [one for one in header if header.count(one) > 1]
    if twice:
        raise UnreadableError(f"{name} names the column {twice[0]!r} twice in its header.")


def _recording(
    name: str,
    header: Sequence[str],
    dialect: Dialect,
    numbers: np.ndarray,
    rows: list[list[str]],
    faults: list[FileFault],
) -> RawRecording:
    columns: dict[str, Column] = {}
    is_right = np.ones(len(rows), dtype=np.bool_)
    for place, title in enumerate(header):
        cells = [row[place] for row in rows]
        plain_name, unit = name_and_unit(title)
        guess = guessed(plain_name, unit)
        values, wrong = _numbers(cells, dialect)
        key = title or f"column {place + 1}"
        is_text = bool(wrong) and len(wrong) > 0.5 * len(cells)
        for index in () if is_text else wrong:
            if is_right[index]:
                reason = f"{plain_name} is not a number: {cells[index][:40]!r}"
                faults.append(FileFault(f"line {numbers[index]}", reason))
            is_right[index] = False
        columns[key] = Column(
            key,
            np.empty(0) if is_text else values,
            guess.unit,
            tuple(cells) if is_text else None,
            role=guess.role,
            target=guess.target,
        )
    faults.sort(key=lambda fault: int(fault.place.split()[1]))
    return RawRecording(
        "csv",
        (name,),
        {key: _part(column, is_right) for key, column in columns.items()},
        numbers[is_right],
        np.zeros(int(is_right.sum()), dtype=np.int64),
        faults=tuple(faults),
    )


def _part(column: Column, chosen: np.ndarray) -> Column:
    if column.texts is not None:
        texts = tuple(cell for cell, is_in in zip(column.texts, chosen, strict=True) if is_in)
        return Column(
            column.name, column.values, column.unit, texts, role=column.role, target=column.target
        )
    return Column(
        column.name,
        column.values[chosen],
        column.unit,
        role=column.role,
        target=column.target,
    )


def _numbers(cells: list[str], dialect: Dialect) -> tuple[FloatArray, list[int]]:
    """Return the numbers of a column, and the rows whose cell is none."""
    if not dialect.has_decimal_comma:
        try:
            return np.array(cells, dtype=np.float64), []
        except ValueError:
            pass
    values, wrong = np.full(len(cells), np.nan), list[int]()
    for index, cell in enumerate(cells):
        try:
            values[index] = dialect.number(cell)
        except ValueError:
            wrong.append(index)
    return values, wrong
