"""Reads text tables with any columns: separator, decimal comma, header and comments are found."""

import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import IO, Final

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from server.recording_file.guess import guessed, name_and_unit
from server.recording_file.raw import (
    COLUMNS_MAX,
    ROWS_MAX,
    Column,
    FileFault,
    RawRecording,
    Tell,
    UnreadableError,
)

BLOCK_ROWS: Final = 50_000
"""So many rows are held as texts at once; the first of these blocks says which columns have words.
"""
CELLS_MAX: Final = 200_000_000
"""Numbers of all columns together: 1.6 GB of memory."""
TEXTS_MAX: Final = 20_000_000
"""Cells in words of all columns together, at some 80 bytes."""
FAULTS_MAX: Final = 1_000_000
"""A file with more rows that cannot be read is no table of the form that its header says."""
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
    """Read a table, block by block.

    A line whose number of cells is not that of the header is a fault of that line, and so is a
    cell that is no number in a column of numbers. Which columns have words, its first block says.

    Raises:
        UnreadableError: If there is no header, no row, or there are too many.
    """
    with path.open("rb") as file:
        size = max(1, path.stat().st_size)
        lines = _lines(file, tell, size)
        dialect, (_, header_line), first = _begin(lines, name)
        header = dialect.cells(header_line)
        _check_header(header, name)
        table = _Table(name, header, dialect)
        for number, line in chain(first, lines):
            table.take(number, dialect.cells(line))
    return table.recording()


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


class _Table:
    """The rows of one file, kept as numbers as soon as a block of them is complete."""

    def __init__(self, name: str, header: Sequence[str], dialect: Dialect) -> None:
        self._name = name
        self._header = header
        self._dialect = dialect
        self._numbers: list[int] = []
        self._rows: list[list[str]] = []
        self._is_text: list[bool] = []
        """Of each column, once the first block is complete."""
        self._values: list[list[FloatArray]] = [[] for _ in header]
        self._texts: list[list[str]] = [[] for _ in header]
        self._places: list[IntArray] = []
        self._faults: list[FileFault] = []
        self._count = 0

    def take(self, number: int, cells: list[str]) -> None:
        """Take a line's cells."""
        if len(cells) != len(self._header):
            reason = f"the row has {len(cells)} cells, the header {len(self._header)}"
            self._fault(number, reason)
            return
        self._numbers.append(number)
        self._rows.append(cells)
        if len(self._rows) >= BLOCK_ROWS:
            self._end_block()

    def _fault(self, number: int, reason: str) -> None:
        self._faults.append(FileFault(f"line {number}", reason))
        if len(self._faults) > FAULTS_MAX:
            raise UnreadableError(
                f"{self._name} has more than {FAULTS_MAX:,} rows that cannot be read, the first "
                f"is {self._faults[0].place}: {self._faults[0].reason}."
            )

    def _end_block(self) -> None:
        rows, numbers = self._rows, np.array(self._numbers, dtype=np.int64)
        self._rows, self._numbers = [], []
        columns = [_numbers([row[place] for row in rows], self._dialect) for place in self._width]
        if not self._is_text:
            self._is_text = [len(wrong) > 0.5 * len(rows) for _, wrong in columns]
        is_right = np.ones(len(rows), dtype=np.bool_)
        for place, (_, wrong) in enumerate(columns):
            for index in () if self._is_text[place] else wrong:
                if is_right[index]:
                    title, _ = name_and_unit(self._header[place])
                    cell = rows[index][place][:40]
                    self._fault(int(numbers[index]), f"{title} is not a number: {cell!r}")
                is_right[index] = False
        right = np.flatnonzero(is_right).tolist()
        for place, (values, _) in enumerate(columns):
            if self._is_text[place]:
                self._texts[place] += [rows[index][place] for index in right]
            else:
                self._values[place].append(values[is_right])
        self._places.append(numbers[is_right])
        self._count += len(right)
        self._check_size()

    @property
    def _width(self) -> range:
        return range(len(self._header))

    def _check_size(self) -> None:
        texts = sum(self._is_text)
        for count, limit, what in (
            (self._count, ROWS_MAX, "rows"),
            (self._count * (len(self._header) - texts), CELLS_MAX, "numbers"),
            (self._count * texts, TEXTS_MAX, "cells with words"),
        ):
            if count > limit:
                raise UnreadableError(
                    f"{self._name} has more than {limit:,} {what}; cut it into parts."
                )

    def recording(self) -> RawRecording:
        """Return what was taken.

        Raises:
            UnreadableError: If there is no row, or there are too many.
        """
        if self._rows:
            self._end_block()
        if not self._count and not self._faults:
            raise UnreadableError(f"{self._name} has a header, but no row.")
        columns: dict[str, Column] = {}
        for place, title in enumerate(self._header):
            guess = guessed(*name_and_unit(title))
            key = title or f"column {place + 1}"
            is_text = bool(self._is_text) and self._is_text[place]
            columns[key] = Column(
                key,
                np.concatenate([np.empty(0), *self._values[place]]),
                guess.unit,
                tuple(self._texts[place]) if is_text else None,
                role=guess.role,
                target=guess.target,
            )
            self._values[place], self._texts[place] = [], []
        self._faults.sort(key=lambda fault: int(fault.place.split()[1]))
        return RawRecording(
            "csv",
            (self._name,),
            columns,
            np.concatenate([np.empty(0, dtype=np.int64), *self._places]),
            np.zeros(self._count, dtype=np.int64),
            faults=tuple(self._faults),
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
