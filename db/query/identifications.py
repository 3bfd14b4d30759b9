"""Searches for the parameters of vehicles: how far they are, and the point to go on from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select, update
from sqlalchemy.orm import Session, defer

from db.fault import StoreError, UnknownIdError
from db.identity import key_of, public_id
from db.query.robots import robot_key
from db.study_tables import Identification
from db.tables import Robot

_HAS_CHECKPOINT = Identification.checkpoint.is_not(None)


class AcceptedAlreadyError(StoreError):
    """A vehicle was made of this search already."""


@dataclass(frozen=True, slots=True)
class IdentificationRecord:
    """One search for a vehicle's parameters in a recording."""

    id: str
    robot: str
    deployment: str
    job: str | None
    state: str
    """``running``, ``done``, ``failed``, ``cancelled`` or ``interrupted``."""
    vehicle: str
    """Key of the vehicle that it began from."""
    vehicle_document: Mapping[str, Any]
    config: Mapping[str, Any]
    data_start_at: datetime
    data_end_at: datetime
    progress: float
    message: str
    convergence: Sequence[Mapping[str, Any]]
    """Best cost by iteration, as far as it came."""
    has_checkpoint: bool
    """Whether the search can go on from where it was."""
    result: Mapping[str, Any] | None
    """What came of it; also ``None`` in a list, where nobody reads it."""
    accepted_vehicle: str | None
    created_at: datetime
    created_by: str
    ended_at: datetime | None


def add_identification(
    session: Session,
    robot: str,
    deployment: str,
    *,
    vehicle: str,
    vehicle_document: Mapping[str, Any],
    config: Mapping[str, Any],
    data_start_at: datetime,
    data_end_at: datetime,
    at: datetime,
    by: str,
) -> IdentificationRecord:
    """Add a search that is about to run.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = Identification(
        robot_key=robot_key(session, robot),
        deployment_key=key_of("deployment", deployment),
        state="running",
        vehicle=vehicle,
        vehicle_document=dict(vehicle_document),
        config=dict(config),
        data_start_at=data_start_at,
        data_end_at=data_end_at,
        progress=0.0,
        message="",
        convergence=[],
        created_at=at,
        created_by=by,
    )
    session.add(row)
    session.flush()
    return _record(row, robot, has_checkpoint=False)


def reopen_identification(session: Session, identification: str) -> bool:
    """Note that a search goes on; tell whether it had ended without a result.

    Raises:
        UnknownIdError: If there is no such search.
    """
    row = _row(session, identification)
    if row.state in {"running", "done"}:
        return False
    row.state, row.message, row.ended_at = "running", "", None
    return True


def set_identification_job(session: Session, identification: str, job: str) -> None:
    """Note which job runs a search.

    Raises:
        UnknownIdError: If there is no such search.
    """
    _row(session, identification).job_key = key_of("job", job)


def keep_checkpoint(
    session: Session,
    identification: str,
    *,
    checkpoint: Mapping[str, Any],
    convergence: Sequence[Mapping[str, Any]],
    progress: float,
    message: str,
) -> None:
    """Keep how far a search is and what it needs to go on from there.

    Raises:
        UnknownIdError: If there is no such search.
    """
    changed = session.scalar(
        update(Identification)
        .where(Identification.key == key_of("identification", identification))
        .values(
            checkpoint=dict(checkpoint),
            convergence=[dict(point) for point in convergence],
            progress=progress,
            message=message,
        )
        .returning(Identification.key)
    )
    if changed is None:
        raise UnknownIdError("identification", identification)


def drop_checkpoint(session: Session, identification: str) -> None:
    """Forget how far a search is, so that it begins anew when it is resumed.

    Raises:
        UnknownIdError: If there is no such search.
    """
    row = _row(session, identification)
    row.checkpoint, row.progress, row.convergence = None, 0.0, []


def end_identification(
    session: Session,
    identification: str,
    state: str,
    *,
    at: datetime,
    message: str,
    convergence: Sequence[Mapping[str, Any]],
    result: Mapping[str, Any] | None = None,
) -> None:
    """Note how a search ended; one that has ended stays as it is.

    One with a result needs its checkpoint no more.

    Raises:
        UnknownIdError: If there is no such search.
    """
    row = _row(session, identification)
    if row.state != "running":
        return
    row.state, row.message, row.ended_at = state, message, at
    row.convergence = [dict(point) for point in convergence]
    if result is not None:
        row.result, row.checkpoint, row.progress = dict(result), None, 1.0


def interrupt_identifications(session: Session, at: datetime, message: str) -> list[str]:
    """Mark the searches that a station left behind when it stopped; return their ids."""
    keys = session.scalars(
        select(Identification.key).where(Identification.state == "running")
    ).all()
    session.execute(
        update(Identification)
        .where(Identification.key.in_(keys))
        .values(state="interrupted", message=message, ended_at=at)
    )
    return [public_id("identification", key) for key in keys]


def accept_identification(session: Session, identification: str, vehicle: str) -> None:
    """Note the vehicle that was made of a search.

    Raises:
        UnknownIdError: If there is no such search.
        AcceptedAlreadyError: If a vehicle was made of it before.
    """
    row = _row(session, identification)
    if row.accepted_vehicle is not None:
        raise AcceptedAlreadyError(
            f"{identification} was accepted already, as {row.accepted_vehicle}."
        )
    row.accepted_vehicle = vehicle


def get_identification(session: Session, identification: str) -> IdentificationRecord:
    """Return one search with its result.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    found = session.execute(
        select(Identification, _HAS_CHECKPOINT, Robot.id)
        .join(Robot, Identification.robot_key == Robot.key)
        .where(Identification.key == key_of("identification", identification))
        .options(defer(Identification.checkpoint, raiseload=True))
    ).one_or_none()
    if found is None:
        raise UnknownIdError("identification", identification)
    row, has_checkpoint, robot = found
    return _record(row, robot, has_checkpoint=has_checkpoint)


def get_checkpoint(session: Session, identification: str) -> Mapping[str, Any] | None:
    """Return what a search needs to go on from where it was, ``None`` before the first.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _row(session, identification).checkpoint


def list_identifications(
    session: Session, robot: str, *, before: str | None = None, limit: int = 100
) -> list[IdentificationRecord]:
    """Return the searches of a robot without their results, the newest first.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(Identification, _HAS_CHECKPOINT)
        .where(Identification.robot_key == robot_key(session, robot))
        .options(
            defer(Identification.result, raiseload=True),
            defer(Identification.checkpoint, raiseload=True),
        )
        .order_by(Identification.key.desc())
        .limit(limit)
    )
    if before is not None:
        statement = statement.where(Identification.key < key_of("identification", before))
    return [
        _record(row, robot, has_checkpoint=has_checkpoint, with_result=False)
        for row, has_checkpoint in session.execute(statement)
    ]


def _row(session: Session, identification: str) -> Identification:
    row = session.get(Identification, key_of("identification", identification))
    if row is None:
        raise UnknownIdError("identification", identification)
    return row


def _record(
    row: Identification, robot: str, *, has_checkpoint: bool, with_result: bool = True
) -> IdentificationRecord:
    return IdentificationRecord(
        id=public_id("identification", row.key),
        robot=robot,
        deployment=public_id("deployment", row.deployment_key),
        job=None if row.job_key is None else public_id("job", row.job_key),
        state=row.state,
        vehicle=row.vehicle,
        vehicle_document=row.vehicle_document,
        config=row.config,
        data_start_at=row.data_start_at,
        data_end_at=row.data_end_at,
        progress=row.progress,
        message=row.message,
        convergence=row.convergence,
        has_checkpoint=has_checkpoint,
        result=row.result if with_result else None,
        accepted_vehicle=row.accepted_vehicle,
        created_at=row.created_at,
        created_by=row.created_by,
        ended_at=row.ended_at,
    )
