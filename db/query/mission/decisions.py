"""Decisions: what each was made of and what came of it, and their contents by hash."""

import hashlib
import zlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, func, select
from sqlalchemy.orm import Session

from db.decision_tables import DecisionContentRow, DecisionRow
from db.identity import public_id
from db.query.change import row_and_robot
from db.query.fleet.robots import robot_key
from db.record import same, values
from db.tables import Robot

DECISION = "decision"
_HASHES_AT_ONCE = 500
"""Databases take a limited number of values in one statement."""


@dataclass(frozen=True, slots=True)
class NewDecision:
    """A decision that is to be kept."""

    kind: str
    robot: str
    about: str
    """Id of what came of it, such as a plan's; "" where nothing has one."""
    at: datetime
    state: str
    """``done``, ``cancelled``, ``failed``, or ``ended`` where nobody knows how far it came."""
    input_sha256: str
    map_sha256: str
    outcome_sha256: str | None
    """``None`` of one that ended."""
    document: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class DecisionRecord(NewDecision):
    """A decision as it was kept."""

    id: str


@dataclass(frozen=True, slots=True)
class DecisionRange:
    """Which decisions are wanted; those of all robots and times unless something is named."""

    robots: Collection[str] | None = None
    start: datetime | None = None
    end: datetime | None = None
    """The first moment that does not count any more."""


def missing_contents(session: Session, hashes: Collection[str]) -> set[str]:
    """Return which of some contents are not kept."""
    missing = set(hashes)
    asked = [bytes.fromhex(one) for one in hashes]
    for first in range(0, len(asked), _HASHES_AT_ONCE):
        statement = select(DecisionContentRow.sha256).where(
            DecisionContentRow.sha256.in_(asked[first : first + _HASHES_AT_ONCE])
        )
        missing -= {found.hex() for found in session.scalars(statement)}
    return missing


def add_decision(
    session: Session, decision: NewDecision, deflated: Mapping[str, bytes]
) -> DecisionRecord:
    """Keep a decision, and those of its contents that are not kept yet, by their SHA-256.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    for sha256 in missing_contents(session, deflated):
        row = DecisionContentRow(sha256=bytes.fromhex(sha256), deflated=deflated[sha256])
        session.add(row)
    row = DecisionRow(
        robot_key=robot_key(session, decision.robot),
        **values(decision, but=("robot", "document")),
        document=dict(decision.document),
    )
    session.add(row)
    session.flush()
    return _record(row, decision.robot)


def get_decision(session: Session, decision: str) -> DecisionRecord:
    """Return one decision.

    Raises:
        UnknownIdError: If there is none.
    """
    return _record(*row_and_robot(session, DecisionRow, DECISION, decision))


def list_decisions(
    session: Session, wanted: DecisionRange, *, newest: int | None = None
) -> list[DecisionRecord]:
    """Return decisions in the order in which they were made.

    Args:
        session: Reads them.
        wanted: Which.
        newest: At most so many, the newest.
    """
    statement = select(DecisionRow, Robot.id).where(*_limits(wanted))
    rows = session.execute(statement.order_by(DecisionRow.key.desc()).limit(newest)).all()
    return [_record(row, robot) for row, robot in reversed(rows)]


def count_decisions(session: Session, wanted: DecisionRange) -> int:
    """Return how many decisions there are."""
    statement = select(func.count()).select_from(DecisionRow).where(*_limits(wanted))
    return session.scalar(statement) or 0


def content_of(session: Session, sha256: str) -> bytes | None:
    """Return a content; ``None`` where it is not kept, or is not what its name says."""
    row = session.get(DecisionContentRow, bytes.fromhex(sha256))
    if row is None:
        return None
    try:
        content = zlib.decompress(row.deflated)
    except zlib.error:
        return None
    return content if hashlib.sha256(content).hexdigest() == sha256 else None


def _limits(wanted: DecisionRange) -> list[ColumnElement[bool]]:
    limits: list[ColumnElement[bool]] = [DecisionRow.robot_key == Robot.key]
    if wanted.robots is not None:
        limits.append(Robot.id.in_(wanted.robots))
    if wanted.start is not None:
        limits.append(DecisionRow.at >= wanted.start)
    if wanted.end is not None:
        limits.append(DecisionRow.at < wanted.end)
    return limits


def _record(row: DecisionRow, robot: str) -> DecisionRecord:
    return same(DecisionRecord, row, id=public_id(DECISION, row.key), robot=robot)
