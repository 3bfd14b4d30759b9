"""The tables of what robots said and were told, and what they share with the others.

Measurements are in ``sample_tables``, waters in ``water_tables``, vehicles and studies in
``study_tables``, maps in ``map_tables``, people in ``person_tables``, what crosses satellite
gateways in ``link_tables``, what robots say of targets in ``target_tables``, cameras and what they
found in ``camera_tables``.

Integer keys stay inside ``db``; what leaves carries a public id such as ``plan-14``
(``db.identity``). Times are aware UTC. JSON columns hold documents that no query looks into.
"""

from collections.abc import Mapping
from datetime import datetime
from types import MappingProxyType
from typing import Any

from sqlalchemy import (
    JSON,
    BigInteger,
    Double,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    UniqueConstraint,
    false,
)
from sqlalchemy.orm import DeclarativeBase, InstrumentedAttribute, Mapped, mapped_column
from sqlalchemy.sql.expression import true

from db.column import Utc
from robot_link.messages import STATE

Document = dict[str, Any]
"""A JSON object that the database keeps but does not read."""

Key = BigInteger().with_variant(Integer, "sqlite")
"""Counting key: SQLite counts by itself only in a column of type INTEGER."""

APPENDED_ONLY = {"sqlite_autoincrement": True}
"""A key is never given twice, even when the newest row was deleted."""

CLUSTERED = {"sqlite_with_rowid": False}
"""Rows lie in the order of their primary key, so a range of time is one sequential read."""


class Base(DeclarativeBase):
    """Parent of every table."""

    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "fk": "fk_%(table_name)s_%(column_0_N_name)s",
            "pk": "pk_%(table_name)s",
        }
    )
    type_annotation_map = {  # noqa: RUF012 - the form that SQLAlchemy asks for
        datetime: Utc,
        Document: JSON,
        list[str]: JSON,
        list[int]: JSON,
        list[float]: JSON,
        bytes: LargeBinary,
    }


class Robot(Base):
    """A robot that the station knows: real, simulated, or a recording."""

    __tablename__ = "robot"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    id: Mapped[str] = mapped_column(unique=True)
    name: Mapped[str]
    model: Mapped[str]
    kind: Mapped[str]
    system_id: Mapped[int | None] = mapped_column(unique=True)
    links: Mapped[list[str]]
    site: Mapped[Document]
    """A water of its own, as recordings and scripts have; empty beside a ``water_key``."""
    water_key: Mapped[int | None] = mapped_column(Key)
    created_at: Mapped[datetime]
    protocol: Mapped[str] = mapped_column(default="grace", server_default="grace")
    retired_at: Mapped[datetime | None]
    former_system_id: Mapped[int | None]
    """Of a retired robot, whose system id others may have."""


class StateRow(Base):
    """One state report; the columns that a recording cannot know are NULL in its rows.

    Every channel of a state has a column; those that are not named here are added below.
    """

    __tablename__ = "state_report"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    measured_at: Mapped[datetime] = mapped_column(primary_key=True)
    received_at: Mapped[datetime]
    north_m: Mapped[float | None]
    east_m: Mapped[float | None]
    depth_m: Mapped[float | None]
    position_std_m: Mapped[float]
    """Infinite where nobody knows it."""
    has_fix: Mapped[bool]
    is_by_cameras: Mapped[bool] = mapped_column(server_default=false())
    """Whether the newest of its fixes was told by somebody who sees the robot."""
    mode: Mapped[int | None]


for _key in STATE.keys:
    if _key not in StateRow.__table__.columns:
        setattr(StateRow, _key, mapped_column(Double, nullable=True))

STATE_CHANNELS: Mapping[str, InstrumentedAttribute[Any]] = MappingProxyType(
    {key: getattr(StateRow, key) for key in STATE.keys}
)
"""Columns of a state's channels."""


class RawFrameRow(Base):
    """Bytes of one packet as they crossed a link."""

    __tablename__ = "raw_frame"
    __table_args__ = (Index(None, "at"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int | None] = mapped_column(ForeignKey("robot.key"))
    at: Mapped[datetime]
    robot_at: Mapped[datetime | None]
    arrived_at: Mapped[datetime | None]
    carrier: Mapped[str]
    outgoing: Mapped[bool]
    data: Mapped[bytes]


class PlanReportRow(Base):
    """What a robot said of the plan that it holds."""

    __tablename__ = "plan_report"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    measured_at: Mapped[datetime] = mapped_column(primary_key=True)
    received_at: Mapped[datetime]
    sha256: Mapped[str | None]
    state: Mapped[int]
    leg: Mapped[int]
    legs: Mapped[int]
    energy_used: Mapped[float]
    reason: Mapped[str]


class PlanQueueRow(Base):
    """What a robot said of the plan that waits behind the one on board, and of the one before."""

    __tablename__ = "plan_queue"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    measured_at: Mapped[datetime] = mapped_column(primary_key=True)
    received_at: Mapped[datetime]
    sha256: Mapped[str | None]
    next_sha256: Mapped[str | None]
    next_starts: Mapped[bool]
    last_sha256: Mapped[str | None]
    last_done: Mapped[bool]


class Configuration(Base):
    """One version of one tunable model; rows are never changed."""

    __tablename__ = "configuration"
    __table_args__ = (Index(None, "kind", "robot_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    kind: Mapped[str]
    robot_key: Mapped[int | None] = mapped_column(ForeignKey("robot.key"))
    value: Mapped[Document]
    changed_at: Mapped[datetime]
    changed_by: Mapped[str]


class OwnChannel(Base):
    """A channel of the team's own, or what the station has otherwise of a delivered one."""

    __tablename__ = "own_channel"
    __table_args__ = CLUSTERED

    key: Mapped[str] = mapped_column(primary_key=True)
    document: Mapped[Document]
    is_own: Mapped[bool]
    retired_at: Mapped[datetime | None]
    changed_at: Mapped[datetime]
    changed_by: Mapped[str]


class Mission(Base):
    """What an operator asked of a robot; an adaptive survey owns its rounds."""

    __tablename__ = "mission"
    __table_args__ = (Index(None, "robot_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    kind: Mapped[str]
    state: Mapped[str] = mapped_column(index=True)
    automation: Mapped[bool]
    config: Mapped[Document]
    document: Mapped[Document]
    created_at: Mapped[datetime]
    created_by: Mapped[str]


class Plan(Base):
    """A trajectory with its life cycle; a row exists before the planner starts."""

    __tablename__ = "plan"
    __table_args__ = (
        Index(None, "robot_key", "key"),
        Index(None, "robot_key", "sha256"),
        Index(None, "mission_key"),
        APPENDED_ONLY,
    )

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    mission_key: Mapped[int | None] = mapped_column(ForeignKey("mission.key"))
    round: Mapped[int]
    kind: Mapped[str]
    state: Mapped[str] = mapped_column(index=True)
    sha256: Mapped[str | None]
    config: Mapped[Document]
    document: Mapped[Document]
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    draft_at: Mapped[datetime | None]
    sent_at: Mapped[datetime | None]
    waiting_at: Mapped[datetime | None]
    on_board_at: Mapped[datetime | None]
    running_at: Mapped[datetime | None]
    ended_at: Mapped[datetime | None]


class Transfer(Base):
    """One attempt to bring a plan on board."""

    __tablename__ = "transfer"
    __table_args__ = (Index(None, "robot_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    plan_key: Mapped[int] = mapped_column(ForeignKey("plan.key"))
    state: Mapped[str]
    level: Mapped[str]
    items: Mapped[int]
    items_sent: Mapped[int]
    bytes: Mapped[int]
    start: Mapped[bool]
    route: Mapped[str] = mapped_column(server_default="auto")
    carrier: Mapped[str] = mapped_column(server_default="")
    is_forced: Mapped[bool] = mapped_column(server_default=false())
    started_at: Mapped[datetime]
    ended_at: Mapped[datetime | None]
    reason: Mapped[str]


class Command(Base):
    """One command; the row exists before its first byte leaves."""

    __tablename__ = "command"
    __table_args__ = (Index(None, "robot_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    kind: Mapped[str]
    plan_sha256: Mapped[str | None]
    level: Mapped[str] = mapped_column(index=True)
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    expires_at: Mapped[datetime]


class CommandLevelRow(Base):
    """A level that a command was proved to have reached."""

    __tablename__ = "command_level"
    __table_args__ = (Index(None, "command_key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    command_key: Mapped[int] = mapped_column(ForeignKey("command.key"))
    level: Mapped[str]
    at: Mapped[datetime]
    carrier: Mapped[str]
    reason: Mapped[str]


class Event(Base):
    """Something that happened; the key is the cursor by which readers continue."""

    __tablename__ = "event"
    __table_args__ = (
        Index(None, "robot_key", "cursor"),
        Index(None, "robot_key", "at"),
        APPENDED_ONLY,
    )

    cursor: Mapped[int] = mapped_column(Key, primary_key=True)
    at: Mapped[datetime] = mapped_column(index=True)
    kind: Mapped[str]
    level: Mapped[str]
    robot_key: Mapped[int | None] = mapped_column(ForeignKey("robot.key"))
    text: Mapped[str]
    data: Mapped[Document]
    actor: Mapped[str | None] = mapped_column(index=True)
    """Who caused it; none where the station or a robot did."""
    actor_kind: Mapped[str | None]
    hash: Mapped[bytes] = mapped_column(LargeBinary(32))
    """Of the row and of the one before it (``db.query.station.event_chain``)."""


class EventHead(Base):
    """The end of the chain of events: one row."""

    __tablename__ = "event_head"

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    rows: Mapped[int]
    hash: Mapped[bytes] = mapped_column(LargeBinary(32))


class Alarm(Base):
    """An alarm and where it stands in its life cycle (ISA-18.2)."""

    __tablename__ = "alarm"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    cause: Mapped[str]
    robot_key: Mapped[int | None] = mapped_column(ForeignKey("robot.key"))
    level: Mapped[str]
    text: Mapped[str]
    state: Mapped[str] = mapped_column(index=True)
    raised_at: Mapped[datetime]
    acknowledged_at: Mapped[datetime | None]
    acknowledged_by: Mapped[str | None]
    cleared_at: Mapped[datetime | None]
    rule: Mapped[str | None] = mapped_column(index=True)
    action: Mapped[str]
    count: Mapped[int]
    first_raised_at: Mapped[datetime | None]
    note: Mapped[str]
    noted_by: Mapped[str | None]
    assigned_to: Mapped[str | None]
    assigned_by: Mapped[str | None]
    shelved_until: Mapped[datetime | None]
    shelved_by: Mapped[str | None]


class AlarmRuleVersion(Base):
    """What a rule of alarm was from a moment on; only ever added to."""

    __tablename__ = "alarm_rule_version"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    rule: Mapped[str] = mapped_column(index=True)
    document: Mapped[Document | None]
    """None: from then on as delivered, or gone where it was the team's own."""
    changed_at: Mapped[datetime]
    changed_by: Mapped[str]


class AlarmOutOfService(Base):
    """A rule of alarm that a person took out of service, for a robot or for all."""

    __tablename__ = "alarm_out_of_service"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    rule: Mapped[str]
    robot_key: Mapped[int | None] = mapped_column(ForeignKey("robot.key"))
    reason: Mapped[str]
    begun_at: Mapped[datetime]
    begun_by: Mapped[str]
    ended_at: Mapped[datetime | None] = mapped_column(index=True)
    ended_by: Mapped[str | None]


class Job(Base):
    """Long work that an operator asked for."""

    __tablename__ = "job"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    kind: Mapped[str]
    state: Mapped[str] = mapped_column(index=True)
    progress: Mapped[float]
    message: Mapped[str]
    result: Mapped[Document | None]
    robot: Mapped[str | None]
    """Id of the robot that it is about; none of what is about the station."""
    about: Mapped[str | None]
    """Id of what it works for, such as a study's; none where nothing is kept beside it."""
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    ended_at: Mapped[datetime | None]


class Deployment(Base):
    """A stretch of time that a robot spent in the water, or one imported recording."""

    __tablename__ = "deployment"
    __table_args__ = (
        UniqueConstraint("robot_key", "log"),
        Index(None, "robot_key", "key"),
        APPENDED_ONLY,
    )

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    kind: Mapped[str]
    state: Mapped[str]
    title: Mapped[str]
    purpose: Mapped[str]
    people: Mapped[list[str]]
    site: Mapped[Document]
    log: Mapped[int | None] = mapped_column(BigInteger)
    started_at: Mapped[datetime | None]
    ended_at: Mapped[datetime | None]
    void_reason: Mapped[str]
    rows: Mapped[int]
    variables: Mapped[list[str]]
    document: Mapped[Document]


class Idempotency(Base):
    """The answer that was given to a request with an idempotency key."""

    __tablename__ = "idempotency"
    __table_args__ = CLUSTERED

    caller: Mapped[str] = mapped_column(primary_key=True)
    request_key: Mapped[str] = mapped_column(primary_key=True)
    fingerprint: Mapped[str]
    status: Mapped[int | None]
    body: Mapped[bytes | None]
    at: Mapped[datetime]
    has_acted: Mapped[bool] = mapped_column(default=False, server_default=true())
    """Whether anything was changed for it; true of those that an earlier version kept."""
    made: Mapped[str | None]
    """Id of what it made, known before it is answered."""


class Setting(Base):
    """A value that the station keeps about itself."""

    __tablename__ = "setting"

    name: Mapped[str] = mapped_column(primary_key=True)
    value: Mapped[Document]
