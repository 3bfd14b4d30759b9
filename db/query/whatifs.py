"""Comparisons of controllers, and what came of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select, update
from sqlalchemy.orm import Session, defer

from db.fault import UnknownIdError
from db.identity import key_of, public_id
from db.query.robots import robot_key
from db.study_tables import WhatIf
from db.tables import Robot

Position = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class WhatIfRecord:
    """One comparison of controllers on a trajectory."""

    id: str
    robot: str
    job: str | None
    state: str
    """``running``, ``done``, ``failed``, ``cancelled`` or ``interrupted``."""
    title: str
    vehicle: str
    scenario: Mapping[str, Any]
    controllers: Sequence[Mapping[str, Any]]
    message: str
    result: Mapping[str, Any] | None
    """What came of it; also ``None`` in a list, where nobody reads it."""
    shown_from: Position | None
    """Place of its origin while the 3D view shows it, NED, m."""
    created_at: datetime
    created_by: str
    ended_at: datetime | None


def add_whatif(
    session: Session,
    robot: str,
    *,
    title: str,
    vehicle: str,
    scenario: Mapping[str, Any],
    controllers: Sequence[Mapping[str, Any]],
    at: datetime,
    by: str,
) -> WhatIfRecord:
    """Add a comparison that is about to run.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = WhatIf(
        robot_key=robot_key(session, robot),
        state="running",
        title=title,
        vehicle=vehicle,
        scenario=dict(scenario),
        controllers=[dict(controller) for controller in controllers],
        message="",
        created_at=at,
        created_by=by,
    )
    session.add(row)
    session.flush()
    return _record(row, robot)


def set_whatif_job(session: Session, whatif: str, job: str) -> None:
    """Note which job runs a comparison.

    Raises:
        UnknownIdError: If there is no such comparison.
    """
    _row(session, whatif).job_key = key_of("job", job)


def end_whatif(
    session: Session,
    whatif: str,
    state: str,
    *,
    at: datetime,
    message: str,
    result: Mapping[str, Any] | None = None,
) -> None:
    """Note how a comparison ended; one that has ended stays as it is.

    Raises:
        UnknownIdError: If there is no such comparison.
    """
    row = _row(session, whatif)
    if row.state != "running":
        return
    row.state, row.message, row.ended_at = state, message, at
    row.result = None if result is None else dict(result)


def interrupt_whatifs(session: Session, at: datetime, message: str) -> None:
    """Close the comparisons that a station left behind when it stopped in the middle of them."""
    session.execute(
        update(WhatIf)
        .where(WhatIf.state == "running")
        .values(state="interrupted", message=message, ended_at=at)
    )


def show_whatif(
    session: Session, robot: str, whatif: str | None, origin_ned: Position | None
) -> None:
    """Show one comparison of a robot in the 3D view instead of any other, or none.

    Raises:
        UnknownIdError: If there is no such robot, or no such comparison of it.
    """
    key = robot_key(session, robot)
    session.execute(
        update(WhatIf)
        .where(WhatIf.robot_key == key, WhatIf.shown_from.is_not(None))
        .values(shown_from=None)
    )
    if whatif is None or origin_ned is None:
        return
    row = _row(session, whatif)
    if row.robot_key != key:
        raise UnknownIdError("whatif", whatif)
    row.shown_from = {"origin_ned": list(origin_ned)}


def shown_whatifs(session: Session) -> list[WhatIfRecord]:
    """Return the comparisons that the 3D views show, with their results."""
    statement = (
        select(WhatIf, Robot.id)
        .join(Robot, WhatIf.robot_key == Robot.key)
        .where(WhatIf.shown_from.is_not(None))
    )
    return [_record(row, robot) for row, robot in session.execute(statement)]


def get_whatif(session: Session, whatif: str) -> WhatIfRecord:
    """Return one comparison with its result.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row = _row(session, whatif)
    robot = session.scalars(select(Robot.id).where(Robot.key == row.robot_key)).one()
    return _record(row, robot)


def list_whatifs(
    session: Session, robot: str, *, before: str | None = None, limit: int = 100
) -> list[WhatIfRecord]:
    """Return the comparisons of a robot without their results, the newest first.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(WhatIf)
        .where(WhatIf.robot_key == robot_key(session, robot))
        .options(defer(WhatIf.result, raiseload=True))
        .order_by(WhatIf.key.desc())
        .limit(limit)
    )
    if before is not None:
        statement = statement.where(WhatIf.key < key_of("whatif", before))
    return [_record(row, robot, with_result=False) for row in session.scalars(statement)]


def _row(session: Session, whatif: str) -> WhatIf:
    row = session.get(WhatIf, key_of("whatif", whatif))
    if row is None:
        raise UnknownIdError("whatif", whatif)
    return row


def _record(row: WhatIf, robot: str, *, with_result: bool = True) -> WhatIfRecord:
    origin = None if row.shown_from is None else row.shown_from["origin_ned"]
    return WhatIfRecord(
        id=public_id("whatif", row.key),
        robot=robot,
        job=None if row.job_key is None else public_id("job", row.job_key),
        state=row.state,
        title=row.title,
        vehicle=row.vehicle,
        scenario=row.scenario,
        controllers=row.controllers,
        message=row.message,
        result=row.result if with_result else None,
        shown_from=None if origin is None else (origin[0], origin[1], origin[2]),
        created_at=row.created_at,
        created_by=row.created_by,
        ended_at=row.ended_at,
    )
