"""Rows of some series as CSV, all of them."""

from collections.abc import Generator
from typing import Final

import numpy as np
from sqlalchemy.orm import Session

from autonomy.quality.flag import OG1_FILL
from server.analysis.column import Table, read_table
from server.analysis.question import Question
from server.delivery.package.row_table import column_name, number_cells
from server.recording.table import COMMENT

_BLOCK_ROWS: Final = 8192
_DIRECTIONS: Final = {1: "down", -1: "up", 0: ""}


def csv_blocks(session: Session, question: Question, *, is_simulated: bool) -> Generator[str]:
    """Yield the rows that a question is about, with units in the names of the columns."""
    if is_simulated:
        yield f"{COMMENT} SIMULATION: this robot does not exist\n"
    units = ", ".join(f"{one.key} {one.unit}" for one in question.series)
    deployment = question.wanted.deployment
    yield (
        f"{COMMENT} {deployment.robot}, {deployment.id}: time UTC, depth m (positive down),"
        f" {units}; qc: flag of OG1.0, 0 no control, 1 good, 2 probably good, 3 suspect, 4 bad\n"
    )
    names = ["time_utc", "dive", "leg", "direction", "depth_m"]
    for one in question.series:
        names += [column_name(one.key, one.unit), f"{one.key}_qc"]
    yield ",".join(names) + "\n"
    table = read_table(session, question, lambda: False)
    for begin in range(0, len(table), _BLOCK_ROWS):
        yield _lines(table, question, slice(begin, begin + _BLOCK_ROWS))


def _lines(table: Table, question: Question, rows: slice) -> str:
    at = np.datetime_as_string(table.at_us[rows].view("datetime64[us]"))
    columns = [
        [f"{one}Z" for one in at.tolist()],
        [str(one) if one else "" for one in table.dive[rows].tolist()],
        [str(one) if one else "" for one in table.leg[rows].tolist()],
        [_DIRECTIONS[one] for one in table.direction[rows].tolist()],
        number_cells(table.depth_m[rows]),
    ]
    for one in question.series:
        columns.append(number_cells(table.values[one.key][rows]))
        flags = table.flags[one.key][rows].tolist()
        columns.append(["" if flag == OG1_FILL else str(flag) for flag in flags])
    return "\n".join(map(",".join, zip(*columns, strict=True))) + "\n"
