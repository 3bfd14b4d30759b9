"""The log book as files for other programs."""

import csv
import io
import json
from collections.abc import Generator, Iterable, Iterator
from dataclasses import replace
from typing import Any, Final

from sqlalchemy.orm import Session

from db.query.log_book.entries import LogFilter, LogVersion
from db.query.log_book.told import GROUP_OF, ToldFilter
from server.logbook.log_book import LogItem, log_part

_PAGE: Final = 500
_COLUMNS: Final = (
    "at", "group", "id", "robot", "deployment", "by", "text", "tags", "attachments", "corrects",
    "page", "version", "is_struck", "written_at", "sha256",
)  # fmt: skip
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")


def items_of(session: Session, entries: LogFilter | None, told: ToldFilter) -> Generator[LogItem]:
    """Return every line that is asked for, the last moments first."""
    while True:
        part = log_part(session, entries, told, _PAGE)
        yield from part.items
        if not part.has_more:
            return
        place = part.items[-1].place
        entries = None if entries is None else replace(entries, before=place)
        told = replace(told, before=place)


def json_blocks(session: Session, entries: LogFilter | None, told: ToldFilter) -> Iterator[str]:
    """Return a JSON list with an object for each line."""
    yield "["
    for number, item in enumerate(items_of(session, entries, told)):
        yield f"{',' if number else ''}\n{json.dumps(_row(item), ensure_ascii=False)}"
    yield "\n]\n"


def csv_blocks(session: Session, entries: LogFilter | None, told: ToldFilter) -> Iterator[str]:
    """Return CSV with a line for each; no cell is one that a spreadsheet takes for a formula."""
    yield csv_line(_COLUMNS)
    for item in items_of(session, entries, told):
        row = _row(item)
        yield csv_line([cell(row.get(column)) for column in _COLUMNS])


def _row(item: LogItem) -> dict[str, Any]:
    if item.event is not None:
        event = item.event
        return {
            "at": event.at.isoformat(),
            "group": GROUP_OF[event.kind],
            "id": f"event-{event.cursor}",
            "robot": event.robot,
            "by": event.by,
            "text": event.text,
        }
    entry = item.entry
    if entry is None:
        return {}
    return {
        "at": entry.newest.at.isoformat(),
        "group": "entries",
        "id": entry.id,
        "by": entry.written_by,
        "corrects": entry.corrects,
        "page": entry.page,
        **_said(entry.newest),
    }


def _said(version: LogVersion) -> dict[str, Any]:
    return {
        "robot": version.robot,
        "deployment": version.deployment,
        "text": version.text,
        "tags": list(version.tags),
        "attachments": [one.sha256 for one in version.attachments],
        "version": version.number,
        "is_struck": version.is_struck,
        "written_at": version.written_at.isoformat(),
        "sha256": version.sha256,
    }


def cell(value: object) -> str:
    """Return a value as a cell that no spreadsheet takes for a formula."""
    if value is None:
        return ""
    if isinstance(value, list):
        return " ".join(str(one) for one in value)
    text = str(value)
    return f"'{text}" if text.startswith(_FORMULA) else text


def csv_line(cells: Iterable[str]) -> str:
    """Return a line of CSV with its end."""
    file = io.StringIO()
    csv.writer(file, lineterminator="\n").writerow(cells)
    return file.getvalue()
