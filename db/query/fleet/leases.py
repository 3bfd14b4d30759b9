"""Who is in charge of each robot."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.lease_tables import LeaseRow
from db.query.change import set_fields
from db.query.fleet.robots import robot_key
from db.record import same, values
from db.tables import Robot


@dataclass(frozen=True, slots=True)
class LeaseRecord:
    """The lease of one robot."""

    robot: str
    state: str = "free"
    """``free``, ``held`` or ``requested``."""
    holder: str | None = None
    holder_kind: str | None = None
    """``person``, ``script`` or ``station``: another ground station."""
    holder_token: str | None = None
    """Id of a script's bearer token."""
    holder_system: int | None = None
    """MAVLink system id of another ground station."""
    since: datetime | None = None
    reason: str = ""
    requested_by: str | None = None
    requested_system: int | None = None
    """Where another ground station asks."""
    requested_at: datetime | None = None
    request_note: str = ""
    script: str | None = None
    """Name of the script that may act under the lease of a person."""
    script_token: str | None = None
    """Id of its bearer token."""


def get_lease(session: Session, robot: str) -> LeaseRecord:
    """Return the lease of a robot; it is free where nobody ever had it.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = _row(session, robot)
    return LeaseRecord(robot) if row is None else _record(row, robot)


def list_leases(session: Session) -> list[LeaseRecord]:
    """Return every lease that was ever held."""
    rows = session.execute(
        select(LeaseRow, Robot.id).join(Robot, LeaseRow.robot_key == Robot.key).order_by(Robot.key)
    )
    return [_record(row, robot) for row, robot in rows]


def put_lease(session: Session, lease: LeaseRecord) -> None:
    """Keep a lease in the place of the one that its robot had.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    changes = values(lease, but=("robot",))
    row = _row(session, lease.robot)
    if row is None:
        session.add(LeaseRow(robot_key=robot_key(session, lease.robot), **changes))
    else:
        set_fields(row, "a lease", changes, changes.keys())
    session.flush()


def _row(session: Session, robot: str) -> LeaseRow | None:
    key = robot_key(session, robot)
    return session.scalar(select(LeaseRow).where(LeaseRow.robot_key == key))


def _record(row: LeaseRow, robot: str) -> LeaseRecord:
    return same(LeaseRecord, row, robot=robot)
