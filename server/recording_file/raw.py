"""What every reader of recordings makes: columns with names and units as the file has them.

Whatever follows (mapping, checks, duplicates, keeping) knows this form alone.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np

from autonomy.arrays import FloatArray, IntArray

ROWS_MAX: Final = 10_000_000
COLUMNS_MAX: Final = 500
FlagArray = np.ndarray[tuple[int], np.dtype[np.int8]]
Format = Literal["csv", "seaglider", "og1", "slocum"]
Role = Literal[
    "time",
    "date",
    "clock",
    "latitude",
    "longitude",
    "depth",
    "pressure",
    "altitude",
    "fix_latitude",
    "fix_longitude",
    "variable",
    "flight",
    "other",
    "ignore",
]
"""What a column tells. ``other`` is kept with its own name and unit, as no channel. ``date``
and ``clock`` are the two halves of a time; ``altitude`` is a height above the water, up positive;
``fix_*`` are places of a satellite receiver alone."""
Tell = Callable[[float], None]
"""Told the share of the work that is done, 0 .. 1; what it raises ends the work."""


class UnreadableError(Exception):
    """A file that is refused as a whole; the sentence says which, where and why."""


@dataclass(frozen=True, slots=True)
class FileFault:
    """A row, or a variable, that cannot be used."""

    place: str
    """Such as ``line 12``, ``record 3`` or ``variable temperature``."""
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One series of a file, a value for each row."""

    name: str
    values: FloatArray
    """Shape ``(n,)``, NaN where there is none; empty for a column of texts."""
    unit: str = ""
    """As the file says, "" where it does not."""
    texts: tuple[str, ...] | None = None
    """Cells that are no numbers, such as times in words."""
    flags: FlagArray | None = None
    """Quality as the file says, in the flags of OG1, shape ``(n,)``; -127 where it is silent."""
    standard_name: str = ""
    role: Role = "ignore"
    """What a reader that knows its format takes it for."""
    target: str = ""
    """Key of the channel that a ``variable`` or ``flight`` column would become."""

    def shown(self, row: int) -> str:
        """Return a cell as a person reads it."""
        if self.texts is not None:
            return self.texts[row]
        value = float(self.values[row])
        return "" if np.isnan(value) else f"{value:.10g}"


@dataclass(frozen=True, slots=True, eq=False)
class Fixes:
    """Places of a satellite receiver that are no rows of the file, shape ``(n,)`` each."""

    time_s: FloatArray
    latitude_deg: FloatArray
    longitude_deg: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class RawRecording:
    """The rows of one or more files as they were written."""

    format: Format
    files: tuple[str, ...]
    columns: Mapping[str, Column]
    """By their names, in the order of the file."""
    row: IntArray
    """Where each row stands in its file: the line or the index of the record, shape ``(n,)``."""
    file: IntArray
    """Which of ``files`` it stands in, shape ``(n,)``."""
    is_scattered: bool = False
    """Whether rows come of several clocks: places may then be told by other rows than values."""
    fixes: Fixes | None = None
    scalars: Mapping[str, str] = field(default_factory=dict[str, str])
    """What the file says about all rows."""
    faults: tuple[FileFault, ...] = ()
    """Rows that could not be read at all; they are none of ``row``."""
    notes: tuple[str, ...] = ()
    """Sentences that the operator should know."""
    is_simulated: bool = False

    def __len__(self) -> int:
        return len(self.row)

    def place(self, index: int) -> str:
        """Return where a row stands, in words."""
        word = "line" if self.format == "csv" else "record"
        where = f"{word} {int(self.row[index])}"
        if len(self.files) == 1:
            return where
        return f"{where} of {self.files[int(self.file[index])]}"
