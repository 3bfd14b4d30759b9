"""Templates from which designs of missions begin."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.design_tables import DesignTemplateRow
from db.identity import public_id
from db.query.change import row_of
from db.record import same


@dataclass(frozen=True, slots=True)
class TemplateRecord:
    """A document with parameters."""

    id: str
    name: str
    document: Mapping[str, Any]
    parameters: Sequence[Mapping[str, Any]]
    created_at: datetime
    created_by: str


def add_template(
    session: Session,
    name: str,
    document: Mapping[str, Any],
    parameters: Sequence[Mapping[str, Any]],
    *,
    at: datetime,
    by: str,
) -> TemplateRecord:
    """Add a template."""
    row = DesignTemplateRow(
        name=name,
        document=dict(document),
        parameters=[dict(one) for one in parameters],
        created_at=at,
        created_by=by,
        is_archived=False,
    )
    session.add(row)
    session.flush()
    return _record(row)


def get_template(session: Session, template: str) -> TemplateRecord:
    """Return one template, an archived one too.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(row_of(session, DesignTemplateRow, "template", template))


def list_templates(session: Session) -> list[TemplateRecord]:
    """Return the templates that are in use, the newest first."""
    rows = session.scalars(
        select(DesignTemplateRow)
        .where(~DesignTemplateRow.is_archived)
        .order_by(DesignTemplateRow.key.desc())
    )
    return [_record(row) for row in rows]


def archive_template(session: Session, template: str) -> TemplateRecord:
    """Put a template away.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row = row_of(session, DesignTemplateRow, "template", template)
    row.is_archived = True
    return _record(row)


def _record(row: DesignTemplateRow) -> TemplateRecord:
    return same(TemplateRecord, row, id=public_id("template", row.key))
