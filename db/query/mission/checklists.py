"""Checklists: versions of templates, runs of robots through them, and what was ticked."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db.checklist_tables import ChecklistRunRow, ChecklistTemplateRow, ChecklistTickRow
from db.identity import key_of, public_id
from db.query.change import row_and_robot, row_of, set_fields
from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import Robot

_KIND = "checklist"
_CHANGEABLE = frozenset({"state", "settled_at", "settled_by", "ended_at", "reason", "found"})


@dataclass(frozen=True, slots=True)
class TemplateVersion:
    """A template as it was saved once."""

    template: str
    version: int
    document: Mapping[str, Any] | None
    """None from when it is as delivered again, or put away where it was not delivered."""
    saved_at: datetime
    saved_by: str


@dataclass(frozen=True, slots=True)
class ChecklistRun:
    """One run of a robot through a template."""

    id: str
    robot: str
    deployment: str | None
    template: str
    version: int
    document: Mapping[str, Any]
    state: str
    """``open, complete, overruled, expired``."""
    begun_at: datetime
    begun_by: str
    expires_at: datetime | None
    """None where it holds for the deployment."""
    ended_at: datetime | None
    settled_at: datetime | None
    """When it was completed or overruled."""
    settled_by: str
    reason: str
    found: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Tick:
    """An item that somebody ticked, or unticked."""

    item: str
    is_ticked: bool
    at: datetime
    by: str
    note: str


def add_template_version(
    session: Session, template: str, document: Mapping[str, Any] | None, *, at: datetime, by: str
) -> TemplateVersion:
    """Save a template once more; earlier versions stay as they are."""
    newest = session.scalar(
        select(func.max(ChecklistTemplateRow.version)).where(
            ChecklistTemplateRow.template == template
        )
    )
    row = ChecklistTemplateRow(
        template=template,
        version=(newest or 0) + 1,
        document=None if document is None else dict(document),
        saved_at=at,
        saved_by=by,
    )
    session.add(row)
    session.flush()
    return same(TemplateVersion, row)


def template_versions(session: Session, template: str) -> list[TemplateVersion]:
    """Return every version of a template, the newest first."""
    rows = session.scalars(
        select(ChecklistTemplateRow)
        .where(ChecklistTemplateRow.template == template)
        .order_by(ChecklistTemplateRow.version.desc())
    )
    return [same(TemplateVersion, row) for row in rows]


def newest_versions(session: Session) -> dict[str, TemplateVersion]:
    """Return the newest version of each template that was ever saved."""
    rows = session.scalars(select(ChecklistTemplateRow).order_by(ChecklistTemplateRow.key))
    return {row.template: same(TemplateVersion, row) for row in rows}


def add_run(
    session: Session,
    robot: str,
    template: str,
    version: int,
    document: Mapping[str, Any],
    *,
    deployment: str | None,
    at: datetime,
    by: str,
    expires_at: datetime | None,
) -> ChecklistRun:
    """Begin a run.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = ChecklistRunRow(
        robot_key=robot_key(session, robot),
        deployment_key=None if deployment is None else key_of("deployment", deployment),
        template=template,
        version=version,
        document=dict(document),
        state="open",
        begun_at=at,
        begun_by=by,
        expires_at=expires_at,
        settled_by="",
        reason="",
        found={},
    )
    session.add(row)
    session.flush()
    return _record(row, robot)


def change_run(session: Session, run: str, **changes: object) -> ChecklistRun:
    """Change ``state, settled_at, settled_by, ended_at, reason`` or ``found``.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row = row_of(session, ChecklistRunRow, _KIND, run)
    set_fields(row, "a checklist", changes, _CHANGEABLE)
    session.flush()
    return get_run(session, run)


def get_run(session: Session, run: str) -> ChecklistRun:
    """Return one.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(*row_and_robot(session, ChecklistRunRow, _KIND, run))


def standing_runs(session: Session, robot: str | None = None) -> list[ChecklistRun]:
    """Return the runs that have not ended, the oldest first."""
    statement = (
        select(ChecklistRunRow, Robot.id)
        .join(Robot, ChecklistRunRow.robot_key == Robot.key)
        .where(ChecklistRunRow.ended_at.is_(None))
        .order_by(ChecklistRunRow.key)
    )
    if robot is not None:
        statement = statement.where(Robot.id == robot)
    return [_record(row, name) for row, name in session.execute(statement)]


def newest_runs(
    session: Session, robot: str, before: str | None = None, limit: int = 20
) -> list[ChecklistRun]:
    """Return the runs of a robot, the newest first; ``before`` goes on after its last id."""
    statement = (
        select(ChecklistRunRow, Robot.id)
        .join(Robot, ChecklistRunRow.robot_key == Robot.key)
        .where(ChecklistRunRow.robot_key == robot_key(session, robot))
        .order_by(ChecklistRunRow.key.desc())
        .limit(limit)
    )
    if before is not None:
        statement = statement.where(ChecklistRunRow.key < key_of(_KIND, before))
    return [_record(row, name) for row, name in session.execute(statement)]


def join_deployment(session: Session, run: str, deployment: str) -> None:
    """Let a run that was begun in the workshop be of a deployment."""
    row, _ = row_and_robot(session, ChecklistRunRow, _KIND, run)
    row.deployment_key = key_of("deployment", deployment)
    session.flush()


def add_tick(session: Session, run: str, tick: Tick) -> None:
    """Add a tick; those before stay."""
    session.add(
        ChecklistTickRow(
            run_key=key_of(_KIND, run),
            item=tick.item,
            is_ticked=tick.is_ticked,
            at=tick.at,
            by=tick.by,
            note=tick.note,
        )
    )
    session.flush()


def ticks_of(session: Session, run: str) -> list[Tick]:
    """Return what was ticked and unticked in a run, the earliest first."""
    rows = session.scalars(
        select(ChecklistTickRow)
        .where(ChecklistTickRow.run_key == key_of(_KIND, run))
        .order_by(ChecklistTickRow.key)
    )
    return [same(Tick, row) for row in rows]


def _record(row: ChecklistRunRow, robot: str) -> ChecklistRun:
    deployment = row.deployment_key
    return same(
        ChecklistRun,
        row,
        id=public_id(_KIND, row.key),
        robot=robot,
        deployment=None if deployment is None else public_id("deployment", deployment),
    )
