"""Tables of what crosses satellite gateways, and of ranges between robots.

A row of the outbox and of a satellite message exists before its first byte leaves; a message from
a robot is a row before its gateway is answered. So a station that is killed at any moment finds
here what it had begun, and sends the same bytes again.
"""

from datetime import datetime

from sqlalchemy import BigInteger, ForeignKey, Index, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, Base, Document, Key


class OutboxRow(Base):
    """One thing that a robot is told by satellite: a plan or an order."""

    __tablename__ = "outbox"
    __table_args__ = (
        UniqueConstraint("transfer_key"),
        UniqueConstraint("command_key", "imei"),
        Index(None, "robot_key", "key"),
        Index(None, "ended_at"),
        APPENDED_ONLY,
    )

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    kind: Mapped[str]
    transfer_key: Mapped[int | None] = mapped_column(ForeignKey("transfer.key"))
    command_key: Mapped[int | None] = mapped_column(ForeignKey("command.key"))
    carrier: Mapped[str]
    imei: Mapped[str]
    state: Mapped[str]
    level: Mapped[str]
    counter: Mapped[int] = mapped_column(BigInteger)
    document: Mapped[Document]
    created_at: Mapped[datetime]
    expires_at: Mapped[datetime]
    ended_at: Mapped[datetime | None]
    reason: Mapped[str]


class SatelliteMessageRow(Base):
    """One message for a robot, as it was or will be handed to a gateway, byte for byte."""

    __tablename__ = "satellite_message"
    __table_args__ = (
        Index(None, "robot_key", "created_at"),
        Index(None, "outbox_key", "key"),
        Index(None, "state"),
        APPENDED_ONLY,
    )

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    outbox_key: Mapped[int] = mapped_column(ForeignKey("outbox.key"))
    part: Mapped[int]
    carrier: Mapped[str]
    imei: Mapped[str]
    data: Mapped[bytes]
    credits: Mapped[int]
    flush: Mapped[bool]
    priority: Mapped[int]
    state: Mapped[str]
    attempts: Mapped[int]
    message_id: Mapped[str]
    mtmsn: Mapped[int | None]
    created_at: Mapped[datetime]
    retry_at: Mapped[datetime | None]
    queued_at: Mapped[datetime | None]
    radio_at: Mapped[datetime | None]
    text: Mapped[str]


class InboxRow(Base):
    """One message from a robot as a gateway delivered it; what comes twice is counted only."""

    __tablename__ = "inbox"
    __table_args__ = (
        UniqueConstraint("imei", "momsn", "session_at", "sha256"),
        Index(None, "robot_key", "key"),
        Index(None, "handled_at"),
        APPENDED_ONLY,
    )

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int | None] = mapped_column(ForeignKey("robot.key"))
    carrier: Mapped[str]
    imei: Mapped[str]
    momsn: Mapped[int]
    mtmsn: Mapped[int | None]
    session_at: Mapped[datetime]
    arrived_at: Mapped[datetime]
    session_status: Mapped[int]
    latitude_deg: Mapped[float | None]
    longitude_deg: Mapped[float | None]
    cep_km: Mapped[float | None]
    sha256: Mapped[str]
    data: Mapped[bytes]
    deliveries: Mapped[int]
    is_decoded: Mapped[bool]
    handled_at: Mapped[datetime | None]
    text: Mapped[str]


class RangeRow(Base):
    """One acoustic range between the robot's modem and a peer, good or not."""

    __tablename__ = "range_measurement"
    __table_args__ = (Index(None, "robot_key", "at"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    peer: Mapped[int]
    at: Mapped[datetime]
    travel_time_s: Mapped[float | None]
    range_m: Mapped[float | None]
    is_valid: Mapped[bool]
    reason: Mapped[str]
