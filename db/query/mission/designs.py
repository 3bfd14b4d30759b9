"""Designs of missions: every change a step that can be undone, and versions that stay."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from db.design_tables import DesignRow, DesignStepRow, DesignVersionRow
from db.fault import StoreError, UnknownIdError
from db.identity import key_of, public_id
from db.query.change import row_of
from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import Robot

STEPS_KEPT = 50
"""Changes that can be undone."""


class DesignChangedError(StoreError):
    """Somebody changed the design meanwhile; ``revision`` is the newest."""

    def __init__(self, design: "DesignRecord") -> None:
        super().__init__(f"{design.id} was changed by {design.changed_by} meanwhile.")
        self.design = design


class NoSuchStepError(StoreError):
    """There is nothing to undo, or to do again."""


@dataclass(frozen=True, slots=True)
class DesignRecord:
    """A design with its working document."""

    id: str
    robot: str
    name: str
    water: str | None
    """Id of the water that it is drawn in, as the robot's was when it was made."""
    revision: int
    """Grows by one with each change, undoing included."""
    document: Mapping[str, Any]
    what: str
    """What the last change was, for a person."""
    changed_at: datetime
    changed_by: str
    created_at: datetime
    created_by: str
    is_archived: bool
    undo: tuple[str, ...]
    """What can be undone, the newest first."""
    redo: tuple[str, ...]
    """What can be done again, the next first."""


@dataclass(frozen=True, slots=True)
class DesignVersion:
    """A saved version."""

    number: int
    comment: str
    document: Mapping[str, Any]
    saved_at: datetime
    saved_by: str
    plan: str | None
    """Plan that was made of it last."""


def add_design(
    session: Session,
    robot: str,
    name: str,
    document: Mapping[str, Any],
    *,
    water: str | None,
    what: str,
    at: datetime,
    by: str,
) -> DesignRecord:
    """Add a design with its first step.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = DesignRow(
        robot_key=robot_key(session, robot),
        name=name,
        water=water,
        revision=1,
        cursor=1,
        is_archived=False,
        created_at=at,
        created_by=by,
        changed_at=at,
        changed_by=by,
    )
    session.add(row)
    session.flush()
    _add_step(session, row, document, what, at, by)
    return _record(session, row)


def get_design(session: Session, design: str) -> DesignRecord:
    """Return one design.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(session, row_of(session, DesignRow, "design", design))


def list_designs(session: Session, robot: str, *, archived: bool = False) -> list[DesignRecord]:
    """Return the designs of a robot, those that were changed last first.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    rows = session.scalars(
        select(DesignRow)
        .where(DesignRow.robot_key == robot_key(session, robot))
        .where(DesignRow.is_archived == archived)
        .order_by(DesignRow.changed_at.desc(), DesignRow.key.desc())
    )
    return [_record(session, row) for row in rows]


def count_versions(session: Session, robot: str) -> dict[str, int]:
    """Return how many versions each design of a robot has; those without one are left out.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    counted = session.execute(
        select(DesignVersionRow.design_key, func.count())
        .join(DesignRow, DesignRow.key == DesignVersionRow.design_key)
        .where(DesignRow.robot_key == robot_key(session, robot))
        .group_by(DesignVersionRow.design_key)
    )
    return {public_id("design", key): count for key, count in counted}


def change_document(
    session: Session,
    design: str,
    document: Mapping[str, Any],
    what: str,
    *,
    revision: int,
    at: datetime,
    by: str,
) -> DesignRecord:
    """Put a step on top; what was undone before can no longer be done again.

    Raises:
        UnknownIdError: If there is none of this id.
        DesignChangedError: If its revision is another; nothing is changed.
    """
    row = _at_revision(session, design, revision)
    _forget(session, row.key, DesignStepRow.number > row.cursor)
    row.cursor += 1
    _forget(session, row.key, DesignStepRow.number < row.cursor - STEPS_KEPT)
    _add_step(session, row, document, what, at, by)
    return _touched(session, row, at, by)


def move_cursor(
    session: Session, design: str, step: int, *, revision: int, at: datetime, by: str
) -> DesignRecord:
    """Undo (``step`` -1) or do again (1) one change.

    Raises:
        UnknownIdError: If there is none of this id.
        DesignChangedError: If its revision is another; nothing is changed.
        NoSuchStepError: If there is nothing to undo or to do again.
    """
    row = _at_revision(session, design, revision)
    if session.get(DesignStepRow, (row.key, row.cursor + step)) is None:
        raise NoSuchStepError("nothing to undo" if step < 0 else "nothing to do again")
    row.cursor += step
    return _touched(session, row, at, by)


def rename_design(
    session: Session,
    design: str,
    *,
    name: str | None = None,
    is_archived: bool | None = None,
    at: datetime,
    by: str,
) -> DesignRecord:
    """Name a design otherwise, put it away, or bring it back.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row = row_of(session, DesignRow, "design", design)
    if name is not None:
        row.name = name
    if is_archived is not None:
        row.is_archived = is_archived
    return _touched(session, row, at, by)


def save_version(
    session: Session, design: str, comment: str, *, revision: int, at: datetime, by: str
) -> DesignVersion:
    """Save the working document as a version.

    Raises:
        UnknownIdError: If there is none of this id.
        DesignChangedError: If its revision is another; nothing is changed.
    """
    row = _at_revision(session, design, revision)
    newest = session.scalar(
        select(func.max(DesignVersionRow.number)).where(DesignVersionRow.design_key == row.key)
    )
    version = DesignVersionRow(
        design_key=row.key,
        number=(newest or 0) + 1,
        comment=comment,
        document=dict(_step(session, row).document),
        saved_at=at,
        saved_by=by,
    )
    session.add(version)
    session.flush()
    return _version(version)


def list_versions(session: Session, design: str) -> list[DesignVersion]:
    """Return the versions of a design, the newest first.

    Raises:
        UnknownIdError: If there is no such design.
    """
    rows = session.scalars(
        select(DesignVersionRow)
        .where(DesignVersionRow.design_key == key_of("design", design))
        .order_by(DesignVersionRow.number.desc())
    )
    return [_version(row) for row in rows]


def get_version(session: Session, design: str, number: int) -> DesignVersion:
    """Return one version of a design.

    Raises:
        UnknownIdError: If there is none of this number.
    """
    row = session.get(DesignVersionRow, (key_of("design", design), number))
    if row is None:
        raise UnknownIdError("version", f"{number} of {design}")
    return _version(row)


def note_plan(session: Session, design: str, number: int, plan: str) -> None:
    """Note the plan that was made of a version.

    Raises:
        UnknownIdError: If there is none of this number.
    """
    row = session.get(DesignVersionRow, (key_of("design", design), number))
    if row is None:
        raise UnknownIdError("version", f"{number} of {design}")
    row.plan_key = key_of("plan", plan)


def _at_revision(session: Session, design: str, revision: int) -> DesignRow:
    row = row_of(session, DesignRow, "design", design)
    if row.revision != revision:
        raise DesignChangedError(_record(session, row))
    return row


def _touched(session: Session, row: DesignRow, at: datetime, by: str) -> DesignRecord:
    row.revision += 1
    row.changed_at, row.changed_by = at, by
    session.flush()
    return _record(session, row)


def _add_step(
    session: Session,
    row: DesignRow,
    document: Mapping[str, Any],
    what: str,
    at: datetime,
    by: str,
) -> None:
    session.add(
        DesignStepRow(
            design_key=row.key,
            number=row.cursor,
            what=what,
            document=dict(document),
            changed_at=at,
            changed_by=by,
        )
    )
    session.flush()


def _forget(session: Session, key: int, which: Any) -> None:  # noqa: ANN401 - an SQL condition
    session.execute(delete(DesignStepRow).where(DesignStepRow.design_key == key).where(which))


def _step(session: Session, row: DesignRow) -> DesignStepRow:
    return session.get_one(DesignStepRow, (row.key, row.cursor))


def _record(session: Session, row: DesignRow) -> DesignRecord:
    titles: Sequence[tuple[int, str]] = [
        (number, what)
        for number, what in session.execute(
            select(DesignStepRow.number, DesignStepRow.what)
            .where(DesignStepRow.design_key == row.key)
            .order_by(DesignStepRow.number)
        )
    ]
    step = _step(session, row)
    first = titles[0][0]
    return same(
        DesignRecord,
        row,
        id=public_id("design", row.key),
        robot=session.get_one(Robot, row.robot_key).id,
        document=step.document,
        what=step.what,
        undo=tuple(what for number, what in reversed(titles) if first < number <= row.cursor),
        redo=tuple(what for number, what in titles if number > row.cursor),
    )


def _version(row: DesignVersionRow) -> DesignVersion:
    plan = None if row.plan_key is None else public_id("plan", row.plan_key)
    return same(DesignVersion, row, plan=plan)
