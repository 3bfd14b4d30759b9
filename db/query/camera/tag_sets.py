"""The fixed tags of the tank and the tags of robots, with their history."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.camera_tables import TagSetRow
from db.fault import StoreError

Document = Mapping[str, Any]


class TagsChangedError(StoreError):
    """Somebody changed the tags meanwhile."""


@dataclass(frozen=True, slots=True)
class TagSetRecord:
    """All tags, as they were from some moment on."""

    key: int
    """Grows with each change."""
    layout: Document
    bundles: tuple[Document, ...]
    at: datetime
    by: str


def add_tag_set(
    session: Session,
    layout: Document,
    bundles: tuple[Document, ...],
    *,
    at: datetime,
    by: str,
    follows: int | None = None,
) -> TagSetRecord:
    """Keep tags as they are from now on.

    Args:
        session: Transaction.
        layout: Fixed tags, ``{"tags": [...]}``.
        bundles: Of each robot, ``{"robot": ..., "tags": [...]}``.
        at: Now.
        by: Who says so.
        follows: Key of those that they were made from, 0 for none; None overwrites any.

    Raises:
        TagsChangedError: If others are in use.
    """
    newest = newest_tag_set(session)
    if follows is not None and follows != (0 if newest is None else newest.key):
        raise TagsChangedError("The tags were changed meanwhile.")
    row = TagSetRow(layout=dict(layout), bundles={"bundles": [*bundles]}, at=at, by=by)
    session.add(row)
    session.flush()
    return _record(row)


def newest_tag_set(session: Session) -> TagSetRecord | None:
    """Return the tags that are in use, None where nobody has told any."""
    row = session.scalar(select(TagSetRow).order_by(TagSetRow.key.desc()).limit(1))
    return None if row is None else _record(row)


def _record(row: TagSetRow) -> TagSetRecord:
    return TagSetRecord(row.key, row.layout, tuple(row.bundles["bundles"]), row.at, row.by)
