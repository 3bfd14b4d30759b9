"""Rows by their public ids, and setting some fields of one by name."""

from collections.abc import Collection, Mapping
from typing import Any, TypeVar, cast

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.fault import UnknownIdError
from db.identity import key_of
from db.tables import Base, Robot

_Row = TypeVar("_Row", bound=Base)


def row_of(session: Session, table: type[_Row], kind: str, identity: str) -> _Row:
    """Return the row of a public id.

    Raises:
        UnknownIdError: If there is none.
    """
    row = session.get(table, key_of(kind, identity))
    if row is None:
        raise UnknownIdError(kind, identity)
    return row


def row_and_robot(
    session: Session, table: type[_Row], kind: str, identity: str
) -> tuple[_Row, str]:
    """Return the row of a public id and the id of its robot, which its ``robot_key`` names.

    Raises:
        UnknownIdError: If there is none.
    """
    row = row_of(session, table, kind, identity)
    key = cast("Any", row).robot_key
    return row, session.scalars(select(Robot.id).where(Robot.key == key)).one()


def set_fields(
    row: Base, what: str, changes: Mapping[str, Any], changeable: Collection[str]
) -> None:
    """Set fields of a row.

    Args:
        row: The row.
        what: Name of its kind with an article, for the error.
        changes: New values by field.
        changeable: Fields that may be set.

    Raises:
        ValueError: If a field may not be set.
    """
    for field, value in changes.items():
        if field not in changeable:
            raise ValueError(f"{field} of {what} cannot be changed")
        setattr(row, field, value)
