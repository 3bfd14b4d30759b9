"""Tables of what robots say of themselves: parameters, log files, how their actuators follow."""

from datetime import datetime

from sqlalchemy import BigInteger, ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, CLUSTERED, Base, Document, Key


class RobotParameterRow(Base):
    """A parameter as the robot said it last."""

    __tablename__ = "robot_parameter"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    name: Mapped[str] = mapped_column(primary_key=True)
    place: Mapped[int]
    value: Mapped[float]
    type: Mapped[str]
    read_at: Mapped[datetime]


class RobotLogRow(Base):
    """A file on board as it was listed last, and what was fetched of it."""

    __tablename__ = "robot_log"
    __table_args__ = (UniqueConstraint("robot_key", "path"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    path: Mapped[str]
    size: Mapped[int]
    listed_at: Mapped[datetime]
    fetched_size: Mapped[int | None]
    sha256: Mapped[str | None]
    fetched_at: Mapped[datetime | None]


class ActuatorReportRow(Base):
    """One report of a robot on how its sliding mass and its pump follow their commands."""

    __tablename__ = "actuator_report"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    measured_at: Mapped[datetime] = mapped_column(primary_key=True)
    received_at: Mapped[datetime]
    mass_rate_share: Mapped[float]
    mass_rate_std_octaves: Mapped[float]
    mass_delay_s: Mapped[float]
    mass_delay_std_s: Mapped[float]
    mass_learned_age_s: Mapped[float | None]
    pump_rate_share: Mapped[float]
    pump_rate_std_octaves: Mapped[float]
    pump_delay_s: Mapped[float]
    pump_delay_std_s: Mapped[float]
    pump_learned_age_s: Mapped[float | None]
    speed_share: Mapped[float]
    is_mass_off: Mapped[bool]
    is_swinging: Mapped[bool]
    stuck: Mapped[str]
    """Names of actuators with commas between, such as ``sliding mass,pump``."""


class RobotChannelRow(Base):
    """A table of channels that a robot announced, and from which measurement on it held."""

    __tablename__ = "robot_channel"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    log: Mapped[int] = mapped_column(BigInteger, primary_key=True)
    sequence: Mapped[int] = mapped_column(BigInteger, primary_key=True)
    version: Mapped[int] = mapped_column(BigInteger)
    since_at: Mapped[datetime]
    """By the robot's clock."""
    heard_at: Mapped[datetime]
    document: Mapped[Document]
    """Rows, each its number, key, unit, kind and period in s."""
