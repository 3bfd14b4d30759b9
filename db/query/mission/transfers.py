"""Attempts to bring a plan on board."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.claim import note_made
from db.identity import key_of, public_id
from db.query.change import row_and_robot, row_of, set_fields
from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import Robot, Transfer

_CHANGEABLE = frozenset({"state", "level", "items_sent", "carrier", "ended_at", "reason"})


@dataclass(frozen=True, slots=True)
class TransferRecord:
    """One attempt to bring a plan on board."""

    id: str
    robot: str
    plan: str
    state: str
    """``waiting, sending, kept`` (waits on board), ``on_board, running, failed``..."""
    level: str
    """The proved level: ``created`` (nothing left the station), ``queued, radio, applied``."""
    items: int
    items_sent: int
    bytes: int
    start: bool
    """Whether the plan is to be started as soon as it is on board."""
    started_at: datetime
    ended_at: datetime | None
    reason: str
    route: str
    """What was asked for: ``auto, radio, satellite``."""
    carrier: str
    """What carries it now; empty before the first byte."""
    is_forced: bool
    """Whether a person wants it sent although the robot was not heard for long."""


def add_transfer(
    session: Session,
    plan: str,
    robot: str,
    *,
    items: int,
    size: int,
    start: bool,
    at: datetime,
    route: str = "auto",
    is_forced: bool = False,
) -> str:
    """Add a transfer that is still waiting and return its id.

    Raises:
        UnknownIdError: If there is no such robot or plan.
    """
    row = Transfer(
        robot_key=robot_key(session, robot),
        plan_key=key_of("plan", plan),
        state="waiting",
        level="created",
        items=items,
        items_sent=0,
        bytes=size,
        start=start,
        route=route,
        carrier="",
        is_forced=is_forced,
        started_at=at,
        reason="",
    )
    session.add(row)
    session.flush()
    transfer = public_id("transfer", row.key)
    note_made(session, transfer)
    return transfer


def change_transfer(session: Session, transfer: str, **changes: Any) -> TransferRecord:  # noqa: ANN401 - the fields differ in type
    """Change ``state, level, items_sent, carrier, ended_at`` or ``reason``.

    Raises:
        UnknownIdError: If there is no such transfer.
    """
    row = row_of(session, Transfer, "transfer", transfer)
    set_fields(row, "a transfer", changes, _CHANGEABLE)
    session.flush()
    return get_transfer(session, transfer)


def get_transfer(session: Session, transfer: str) -> TransferRecord:
    """Return one transfer.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(*row_and_robot(session, Transfer, "transfer", transfer))


def newest_transfer(session: Session, plan: str) -> str | None:
    """Return the newest transfer of a plan, ``None`` if it was never sent."""
    key = session.scalars(
        select(Transfer.key)
        .where(Transfer.plan_key == key_of("plan", plan))
        .order_by(Transfer.key.desc())
        .limit(1)
    ).one_or_none()
    return None if key is None else public_id("transfer", key)


def open_transfers(session: Session) -> list[TransferRecord]:
    """Return the transfers that have not ended, the oldest first."""
    statement = (
        select(Transfer, Robot.id)
        .join(Robot, Transfer.robot_key == Robot.key)
        .where(Transfer.ended_at.is_(None))
        .order_by(Transfer.key)
    )
    return [_record(row, name) for row, name in session.execute(statement)]


def _record(row: Transfer, robot: str) -> TransferRecord:
    return same(
        TransferRecord,
        row,
        id=public_id("transfer", row.key),
        robot=robot,
        plan=public_id("plan", row.plan_key),
    )
