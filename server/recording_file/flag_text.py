"""Quality flags of foreign files in those of OG1, by what each file itself says of them."""

import re
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from server.recording_file.netcdf import text_of
from server.recording_file.raw import FlagArray

FILL: Final = -127
_WORDS: Final[tuple[tuple[str, int], ...]] = (
    ("not_evaluated", 0), ("unknown", 0), ("no_qc", 0), ("no_change", 0), ("no qc", 0),
    ("probably_good", 2), ("probably good", 2), ("probably_bad", 3), ("probably bad", 3),
    ("potentially", 3), ("suspect", 3), ("questionable", 3), ("high_interest", 3),
    ("missing", FILL), ("unsampled", FILL), ("interpolated", 2), ("estimated", 2),
    ("changed", 2), ("fail", 4), ("bad", 4), ("good", 1), ("pass", 1),
)  # fmt: skip
"""Meanings, the more particular first."""


def og1_table(variable: Any) -> Mapping[int, int]:  # noqa: ANN401 - netCDF4 has no types
    """Return what each flag of a variable is in OG1; empty where the file does not say."""
    values = getattr(variable, "flag_values", None)
    meanings = text_of(variable, "flag_meanings")
    if values is None or not meanings:
        return {}
    told = re.findall(r"-?\d+", values) if isinstance(values, str) else np.atleast_1d(values)
    numbers = [int(float(one)) for one in told]
    words = meanings.split(",") if "," in meanings else meanings.split()
    if len(words) != len(numbers):
        return {}
    return {
        number: next((flag for word, flag in _WORDS if word in one.strip().lower()), 0)
        for number, one in zip(numbers, words, strict=True)
    }


def flags_of(variable: Any, table: Mapping[int, int]) -> FlagArray:  # noqa: ANN401 - as above
    """Return the flags of a variable in OG1; what the table lacks is left without one."""
    raw = np.ma.asarray(variable[:])
    if raw.dtype.kind in "SU":
        cells = np.ma.filled(raw, b" " if raw.dtype.kind == "S" else " ").reshape(-1)
        numbers = np.array([_digit(cell) for cell in cells.tolist()], dtype=np.int64)
    else:
        filled = np.ma.filled(raw.astype(np.float64), np.nan).reshape(-1)
        numbers = np.where(np.isfinite(filled), filled, -1).astype(np.int64)
    found = np.full(len(numbers), FILL, dtype=np.int8)
    for number, flag in table.items():
        found[numbers == number] = flag
    return found


def _digit(cell: bytes | str) -> int:
    text = (cell.decode("ascii", "replace") if isinstance(cell, bytes) else cell).strip()
    return int(text) if text.isdigit() else -1
