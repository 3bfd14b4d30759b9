"""Long work that was asked for, as the database keeps it."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from db.claim import note_made
from db.identity import key_of, public_id
from db.query.change import row_of
from db.record import same
from db.tables import Job

OPEN_STATES = ("queued", "running")


@dataclass(frozen=True, slots=True)
class JobRecord:
    """One piece of long work."""

    id: str
    kind: str
    state: str
    """``queued, running, done, failed, cancelled``."""
    progress: float
    """0 .. 1."""
    message: str
    result: Mapping[str, Any] | None
    created_at: datetime
    created_by: str
    ended_at: datetime | None
    robot: str | None = None
    """Whose; ``None`` of what is about the station."""
    about: str | None = None
    """Id of what it works for, where that is kept beside it."""


def add_job(
    session: Session,
    kind: str,
    *,
    at: datetime,
    by: str,
    robot: str | None = None,
    about: str | None = None,
) -> JobRecord:
    """Add a queued job."""
    row = Job(
        kind=kind,
        state="queued",
        progress=0.0,
        message="",
        result=None,
        created_at=at,
        created_by=by,
        robot=robot,
        about=about,
    )
    session.add(row)
    session.flush()
    record = _record(row)
    note_made(session, record.id)
    return record


def save_job(session: Session, job: JobRecord) -> None:
    """Write state, progress, message, result and end of a job.

    Raises:
        UnknownIdError: If there is no such job.
    """
    row = row_of(session, Job, "job", job.id)
    row.state = job.state
    row.progress = job.progress
    row.message = job.message
    row.result = None if job.result is None else dict(job.result)
    row.ended_at = job.ended_at


def get_job(session: Session, job: str) -> JobRecord:
    """Return one job.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row = row_of(session, Job, "job", job)
    return _record(row)


def newest_job(session: Session, kind: str, robot: str) -> JobRecord | None:
    """Return the newest job of a kind that a robot has and that is done, ``None`` without any."""
    statement = select(Job).where(Job.kind == kind, Job.robot == robot, Job.state == "done")
    row = session.scalars(statement.order_by(Job.key.desc()).limit(1)).one_or_none()
    return None if row is None else _record(row)


def list_jobs(
    session: Session,
    *,
    robots: Collection[str] | None = None,
    before: str | None = None,
    limit: int = 100,
) -> list[JobRecord]:
    """Return jobs, the newest first; ``before`` continues a list after its last id.

    Where ``robots`` are given, only jobs of theirs.
    """
    statement = select(Job).order_by(Job.key.desc()).limit(limit)
    if robots is not None:
        statement = statement.where(Job.robot.in_(robots))
    if before is not None:
        statement = statement.where(Job.key < key_of("job", before))
    return [_record(row) for row in session.scalars(statement)]


def fail_open_jobs(session: Session, at: datetime, message: str) -> None:
    """Close the jobs that a station left behind when it stopped in the middle of them."""
    session.execute(
        update(Job)
        .where(Job.state.in_(OPEN_STATES))
        .values(state="failed", message=message, ended_at=at)
    )


def _record(row: Job) -> JobRecord:
    return same(JobRecord, row, id=public_id("job", row.key))
