"""``QGC WPL 110``: a mission as lines of twelve columns, the first of them home."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot_link.mavlink.wire import grace
from server.plan_file.item import FileItem
from server.plan_file.place import Placement, add_mark
from server.plan_file.proposal import Findings
from server.water.proposal import ReadingError

HEAD = "QGC WPL 110"
LINES_MAX = 10_000
_COLUMNS = 12


@dataclass(frozen=True, slots=True)
class WplFile:
    """What a file holds."""

    home: FileItem | None
    items: Sequence[FileItem]
    notes: Sequence[str] = ()


def read_wpl(text: str) -> WplFile:
    """Read a file's lines.

    Raises:
        ReadingError: With the line at fault.
    """
    lines = text.splitlines()
    head = lines[0].split() if lines else []
    if head[:2] != ["QGC", "WPL"]:
        raise ReadingError(("line 1", f"must be {HEAD!r}"))
    if head != HEAD.split():
        raise ReadingError(("line 1", f"{' '.join(head)[:40]!r} is not taken, {HEAD!r} is"))
    rows: list[tuple[int, FileItem]] = []
    for number, line in enumerate(lines[1:], start=2):
        if line.strip() and not line.lstrip().startswith("#"):
            rows.append(_row(number, line))
            if len(rows) > LINES_MAX:
                raise ReadingError((f"line {number}", f"{LINES_MAX:,} items are the most taken"))
    indices = [index for index, _ in rows]
    notes: list[str] = []
    if any(b <= a for a, b in itertools.pairwise(indices)):
        notes.append("The numbers of the items do not ascend; they are taken as they stand.")
    if not indices or indices[0] != 0:
        notes.append("The file names no home in a line 0.")
        return WplFile(None, [item for _, item in rows], notes)
    return WplFile(rows[0][1], [item for _, item in rows[1:]], notes)


def _row(number: int, line: str) -> tuple[int, FileItem]:
    words = line.split()
    if len(words) != _COLUMNS:
        reason = f"has {len(words)} columns; {_COLUMNS} are needed"
        raise ReadingError((f"line {number}", reason))
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise ReadingError((f"line {number}", f"{error}")) from error
    whole = (values[0], values[2], values[3])
    if not all(math.isfinite(value) and value == int(value) for value in whole):
        raise ReadingError((f"line {number}", "number, frame and command must be whole numbers"))
    index, frame, command = (int(value) for value in whole)
    item = FileItem(
        f"item {index}",
        command,
        frame,
        (values[4], values[5], values[6], values[7]),
        values[8],
        values[9],
        values[10],
        values[11] != 0.0,
    )
    return index, item


def add_home(home: FileItem | None, placement: Placement, findings: Findings) -> None:
    """Note home as a mark: it is not flown."""
    if home is None or home.frame == grace.MAV_FRAME_LOCAL_NED:
        return
    if (home.x, home.y) == (0.0, 0.0) or not math.isfinite(home.x + home.y):
        findings.notes.append("Line 0, home, is not set.")
        return
    findings.notes.append("Line 0 is home and is not flown.")
    altitude = f"altitude {home.z:.2f} m" if home.z else ""
    add_mark(findings, placement, "line 0", "home", (home.x, home.y), "Home", altitude)
