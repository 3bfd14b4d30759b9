"""Messages from robots as satellite gateways delivered them, each once."""

from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from hashlib import sha256

from sqlalchemy import BigInteger, func, select, type_coerce
from sqlalchemy.orm import Session

from db.identity import key_of, public_id
from db.link_tables import InboxRow
from db.query.fleet.robots import robot_key
from db.record import same, values
from db.tables import Robot
from robot_link.station.gateway.gateway import MobileOriginated


@dataclass(frozen=True, slots=True)
class InboxRecord:
    """One message from a robot."""

    id: str
    robot: str | None
    """``None`` for a modem that no robot of the station has."""
    message: MobileOriginated
    deliveries: int
    """How often the gateway delivered it."""
    is_decoded: bool
    text: str
    is_said_again: bool = False
    """Whether an earlier session brought the same bytes: every record of a robot has its number,
    so these are an old one, told again."""


def add_inbox(
    session: Session, message: MobileOriginated, robot: str | None
) -> tuple[InboxRecord, bool]:
    """Keep a message; tell whether it is new. One that came before is counted only."""
    digest = sha256(message.data).hexdigest()
    row = session.scalars(
        select(InboxRow).where(
            InboxRow.imei == message.imei,
            InboxRow.momsn == message.momsn,
            InboxRow.session_at == message.session_at,
            InboxRow.sha256 == digest,
        )
    ).one_or_none()
    if row is not None:
        row.deliveries += 1
        session.flush()
        return _record(row, robot), False
    said_again = bool(message.data) and session.scalar(
        select(InboxRow.key)
        .where(InboxRow.imei == message.imei, InboxRow.sha256 == digest)
        .limit(1)
    )
    row = InboxRow(
        robot_key=None if robot is None else robot_key(session, robot),
        sha256=digest,
        deliveries=1,
        is_decoded=False,
        text=message.fault,
        **values(message, but=["fault"]),
    )
    session.add(row)
    session.flush()
    return replace(_record(row, robot), is_said_again=bool(said_again)), True


def note_inbox(session: Session, inbox: str, *, is_decoded: bool, text: str) -> None:
    """Say what a message was found to say."""
    row = session.get_one(InboxRow, key_of("inbox", inbox))
    row.is_decoded, row.text = is_decoded, text


def settle_inbox(session: Session, inbox: str, at: datetime) -> None:
    """Say that everything that a message told is stored where it belongs."""
    session.get_one(InboxRow, key_of("inbox", inbox)).handled_at = at


def unsettled_inbox(session: Session) -> list[InboxRecord]:
    """Return the messages of known robots that the station had not finished with, in order."""
    statement = (
        select(InboxRow, Robot.id)
        .join(Robot, InboxRow.robot_key == Robot.key)
        .where(InboxRow.handled_at.is_(None))
        .order_by(InboxRow.key)
    )
    return [_record(row, robot) for row, robot in session.execute(statement)]


def inbox_of(session: Session, robot: str, limit: int) -> list[InboxRecord]:
    """Return the newest messages of a robot, the newest first."""
    statement = (
        select(InboxRow)
        .where(InboxRow.robot_key == robot_key(session, robot))
        .order_by(InboxRow.key.desc())
        .limit(limit)
    )
    return [_record(row, robot) for row in session.scalars(statement)]


def inbox_sizes(session: Session, robot: str, *, since: datetime) -> list[int]:
    """Return the bytes of each message of a robot whose session was at this moment or later."""
    statement = select(func.length(InboxRow.data)).where(
        InboxRow.robot_key == robot_key(session, robot), InboxRow.session_at >= since
    )
    return list(session.scalars(statement))


def newest_session(session: Session, imei: str, latest: timedelta) -> datetime | None:
    """Return when a modem last brought a word that its robot's key proves, ``None`` for never.

    Args:
        session: A reading session.
        imei: The modem.
        latest: A delivery that took longer names no session that can be true.
    """
    took_us = type_coerce(InboxRow.arrived_at, BigInteger) - type_coerce(
        InboxRow.session_at, BigInteger
    )
    return session.scalar(
        select(InboxRow.session_at)
        .where(
            InboxRow.imei == imei,
            InboxRow.is_decoded,
            func.length(InboxRow.data) > 0,
            took_us <= latest // timedelta(microseconds=1),
        )
        .order_by(InboxRow.session_at.desc())
        .limit(1)
    )


def _record(row: InboxRow, robot: str | None) -> InboxRecord:
    message = same(MobileOriginated, row)
    return same(InboxRecord, row, id=public_id("inbox", row.key), robot=robot, message=message)
