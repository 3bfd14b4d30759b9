"""Studies: what was asked, how far it is, the point to go on from, and what came of it.

The public id of a study is its kind with a number that counts that kind alone: ``whatif-3``. Its
documents are those of its kind; no query looks into them.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import func, select, update
from sqlalchemy.orm import Session, undefer

from db.fault import UnknownIdError
from db.identity import key_of, public_id
from db.query.fleet.robots import robot_key
from db.record import same
from db.study_tables import Study
from db.tables import Robot

Document = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class StudyRecord:
    """One study of any kind."""

    id: str
    robot: str
    job: str | None
    state: str
    """``running``, ``done``, ``failed``, ``cancelled`` or ``interrupted``."""
    message: str
    asked: Document
    news: Document
    """How far it is, as its kind tells it."""
    use: Document | None
    """What people made of it."""
    has_checkpoint: bool
    """Whether it can go on from where it was."""
    result: Document | None
    """What came of it; also ``None`` in a list, where nobody reads it."""
    created_at: datetime
    created_by: str
    ended_at: datetime | None


def add_study(
    session: Session,
    kind: str,
    robot: str,
    *,
    asked: Document,
    at: datetime,
    by: str,
    result: Document | None = None,
    arrays: bytes | None = None,
) -> StudyRecord:
    """Add a study that is about to run, or with a result one that is done.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    newest = session.scalar(select(func.max(Study.number)).where(Study.kind == kind))
    row = Study(
        kind=kind,
        number=(newest or 0) + 1,
        robot_key=robot_key(session, robot),
        state="running" if result is None else "done",
        message="",
        asked=dict(asked),
        news={},
        result=None if result is None else dict(result),
        arrays=arrays,
        created_at=at,
        created_by=by,
        ended_at=None if result is None else at,
    )
    session.add(row)
    session.flush()
    return _record(row, robot, result)


def replace_study(
    session: Session,
    kind: str,
    robot: str,
    *,
    asked: Document,
    at: datetime,
    by: str,
    result: Document,
    arrays: bytes,
) -> None:
    """Add a study that is done in the place of those that were asked the same.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = select(Study).where(
        Study.kind == kind, Study.robot_key == robot_key(session, robot)
    )
    for row in session.scalars(statement):
        if row.asked == asked:
            session.delete(row)
    add_study(session, kind, robot, asked=asked, at=at, by=by, result=result, arrays=arrays)


def set_job(session: Session, kind: str, study: str, job: str) -> None:
    """Note which job works on a study.

    Raises:
        UnknownIdError: If there is no such study.
    """
    _row(session, kind, study).job_key = key_of("job", job)


def reopen_study(session: Session, kind: str, study: str) -> bool:
    """Note that a study goes on; tell whether it had ended without a result.

    Raises:
        UnknownIdError: If there is no such study.
    """
    row = _row(session, kind, study)
    if row.state in {"running", "done"}:
        return False
    row.state, row.message, row.ended_at = "running", "", None
    return True


def keep_checkpoint(
    session: Session,
    kind: str,
    study: str,
    *,
    checkpoint: Document | None,
    news: Document,
    message: str,
) -> None:
    """Keep how far a study is and what it needs to go on from there; none, if it begins anew.

    Raises:
        UnknownIdError: If there is no such study.
    """
    row = _row(session, kind, study)
    row.checkpoint = None if checkpoint is None else dict(checkpoint)
    row.news, row.message = dict(news), message


def end_study(
    session: Session,
    kind: str,
    study: str,
    state: str,
    *,
    at: datetime,
    message: str,
    news: Document | None = None,
    result: Document | None = None,
) -> None:
    """Note how a study ended; one that has ended stays as it is.

    One with a result needs its checkpoint no more.

    Raises:
        UnknownIdError: If there is no such study.
    """
    row = _row(session, kind, study)
    if row.state != "running":
        return
    row.state, row.message, row.ended_at = state, message, at
    row.news = row.news if news is None else dict(news)
    if result is not None:
        row.result, row.checkpoint = dict(result), None


def interrupt_studies(session: Session, kind: str, at: datetime, message: str) -> None:
    """Mark the studies that a station left behind when it stopped in the middle of them."""
    session.execute(
        update(Study)
        .where(Study.kind == kind, Study.state == "running")
        .values(state="interrupted", message=message, ended_at=at)
    )


def use_study(session: Session, kind: str, study: str, use: Document | None) -> None:
    """Note what people make of a study, in the place of what they made of it before.

    Raises:
        UnknownIdError: If there is no such study.
    """
    _row(session, kind, study).use = None if use is None else dict(use)


def use_only_study(
    session: Session, kind: str, robot: str, study: str | None, use: Document | None
) -> None:
    """Make something of one study of a robot instead of any other of its kind, or of none.

    Raises:
        UnknownIdError: If there is no such robot, or no such study of it.
    """
    key = robot_key(session, robot)
    session.execute(
        update(Study)
        .where(Study.kind == kind, Study.robot_key == key, Study.use.is_not(None))
        .values(use=None)
    )
    if study is None:
        return
    row = _row(session, kind, study)
    if row.robot_key != key:
        raise UnknownIdError(kind, study)
    row.use = None if use is None else dict(use)


def get_study(session: Session, kind: str, study: str) -> StudyRecord:
    """Return one study with its result.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row = _row(session, kind, study)
    robot = session.scalars(select(Robot.id).where(Robot.key == row.robot_key)).one()
    return _record(row, robot, row.result)


def get_checkpoint(session: Session, kind: str, study: str) -> Document | None:
    """Return what a study needs to go on from where it was, ``None`` before the first.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _row(session, kind, study).checkpoint


def get_arrays(session: Session, kind: str, study: str) -> bytes | None:
    """Return the arrays that a study left, packed by whoever made them.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _row(session, kind, study).arrays


def list_studies(
    session: Session, kind: str, robot: str, *, before: str | None = None, limit: int = 100
) -> list[StudyRecord]:
    """Return the studies of a robot without their results, the newest first.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(Study)
        .where(Study.robot_key == robot_key(session, robot), Study.kind == kind)
        .order_by(Study.number.desc())
        .limit(limit)
    )
    if before is not None:
        statement = statement.where(Study.number < key_of(kind, before))
    return [_record(row, robot, None) for row in session.scalars(statement)]


def newest_studies(
    session: Session, kind: str, robots: Collection[str], *, limit: int = 1000
) -> list[StudyRecord]:
    """Return the studies of some robots without their results, the newest first."""
    statement = (
        select(Study, Robot.id)
        .join(Robot, Study.robot_key == Robot.key)
        .where(Robot.id.in_(robots), Study.kind == kind)
        .order_by(Study.created_at.desc())
        .limit(limit)
    )
    return [_record(row, robot, None) for row, robot in session.execute(statement)]


def used_studies(session: Session, kind: str) -> list[StudyRecord]:
    """Return the studies that people make something of, with their results."""
    statement = (
        select(Study, Robot.id)
        .join(Robot, Study.robot_key == Robot.key)
        .where(Study.kind == kind, Study.use.is_not(None))
        .options(undefer(Study.result))
    )
    return [_record(row, robot, row.result) for row, robot in session.execute(statement)]


def _row(session: Session, kind: str, study: str) -> Study:
    number = key_of(kind, study)
    row = session.scalar(select(Study).where(Study.kind == kind, Study.number == number))
    if row is None:
        raise UnknownIdError(kind, study)
    return row


def _record(row: Study, robot: str, result: Document | None) -> StudyRecord:
    return same(
        StudyRecord,
        row,
        id=public_id(row.kind, row.number),
        robot=robot,
        job=None if row.job_key is None else public_id("job", row.job_key),
        result=result,
    )
