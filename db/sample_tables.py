"""Tables of what robots measured, narrow because they hold millions of rows.

Names that would be repeated in every row (channels, logs) are small integers, positions are whole
millimetres. Rows lie in the order in which charts and maps read them; that each measurement is kept
once is known from the runs of numbers that are kept of each log (``SampleRun``).
"""

from datetime import datetime

from sqlalchemy import BigInteger, ForeignKey, Index, Integer, UniqueConstraint, false
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, CLUSTERED, Base, Key

FINE_S, COARSE_S = 300, 86400
"""Lengths of the stretches of time that are summed up, s."""


class ChannelRow(Base):
    """The number that rows carry for a channel."""

    __tablename__ = "channel"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    name: Mapped[str] = mapped_column(unique=True)
    """The channel's key in the catalogue."""


class SampleLog(Base):
    """A log on board of a robot, or a recording."""

    __tablename__ = "sample_log"
    __table_args__ = (UniqueConstraint("robot_key", "log"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    log: Mapped[int] = mapped_column(BigInteger)
    received_at: Mapped[datetime]
    """When the newest of its samples came."""
    unsmoothed_from: Mapped[datetime | None]
    """When the first sample was taken that smoothing may not have looked at; None: it saw all."""


class SampleRun(Base):
    """Numbers of a log that are kept without a gap; the next run begins after one."""

    __tablename__ = "sample_run"
    __table_args__ = CLUSTERED

    log_key: Mapped[int] = mapped_column(ForeignKey("sample_log.key"), primary_key=True)
    first: Mapped[int] = mapped_column(BigInteger, primary_key=True)
    last: Mapped[int] = mapped_column(BigInteger)


class SampleRow(Base):
    """One measurement of a field at a place."""

    __tablename__ = "sample"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    channel_key: Mapped[int] = mapped_column(ForeignKey("channel.key"), primary_key=True)
    measured_at: Mapped[datetime] = mapped_column(primary_key=True)
    log_key: Mapped[int] = mapped_column(ForeignKey("sample_log.key"), primary_key=True)
    sequence: Mapped[int] = mapped_column(BigInteger, primary_key=True)
    value: Mapped[float]
    north_mm: Mapped[int] = mapped_column(Integer)
    east_mm: Mapped[int] = mapped_column(Integer)
    depth_mm: Mapped[int] = mapped_column(Integer)
    position_std_um: Mapped[int] = mapped_column(BigInteger)
    """Finer than the place: a fix makes it better by little."""


class RecoveredSample(Base):
    """Another word on a measurement: the card's of a robot, or that of a second file.

    ``sample`` keeps what came first; in a reviewed file the card's word counts before it.
    """

    __tablename__ = "recovered_sample"
    __table_args__ = CLUSTERED

    log_key: Mapped[int] = mapped_column(ForeignKey("sample_log.key"), primary_key=True)
    sequence: Mapped[int] = mapped_column(BigInteger, primary_key=True)
    measured_at: Mapped[datetime]
    value: Mapped[float]
    north_mm: Mapped[int] = mapped_column(Integer)
    east_mm: Mapped[int] = mapped_column(Integer)
    depth_mm: Mapped[int] = mapped_column(Integer)
    position_std_um: Mapped[int] = mapped_column(BigInteger)
    received_at: Mapped[datetime]
    is_card: Mapped[bool] = mapped_column(server_default=false())
    """Whether the robot's own card says so."""


class OtherSeries(Base):
    """A column of an imported file that is no channel: its name, its unit and its numbers."""

    __tablename__ = "other_series"
    __table_args__ = (Index(None, "deployment_key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    deployment_key: Mapped[int] = mapped_column(ForeignKey("deployment.key"))
    name: Mapped[str]
    unit: Mapped[str]
    """As the operator said, "" for none."""
    count: Mapped[int] = mapped_column(BigInteger)
    first_at: Mapped[datetime]
    last_at: Mapped[datetime]
    least: Mapped[float]
    greatest: Mapped[float]
    data: Mapped[bytes] = mapped_column(deferred=True)
    """An npz of ``at_us`` and ``value``, ascending in time."""


class ReadingRow(Base):
    """One reading of what belongs to no place: the robot's own condition."""

    __tablename__ = "reading"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    channel_key: Mapped[int] = mapped_column(ForeignKey("channel.key"), primary_key=True)
    measured_at: Mapped[datetime] = mapped_column(primary_key=True)
    value: Mapped[float]


class Rollup:
    """A stretch of time of a channel: how many values, and which are the extreme ones.

    Kept in the transaction that adds the values, in stretches of ``FINE_S`` and of ``COARSE_S``
    that begin at the epoch: counting millions of rows, or finding their extremes, takes seconds.
    """

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    channel_key: Mapped[int] = mapped_column(ForeignKey("channel.key"), primary_key=True)
    length_s: Mapped[int] = mapped_column(Integer, primary_key=True)
    stretch: Mapped[int] = mapped_column(BigInteger, primary_key=True)
    """Whole lengths from the epoch to its beginning."""
    size: Mapped[int] = mapped_column(BigInteger)
    """How many values."""
    least: Mapped[float]
    least_at: Mapped[datetime]
    greatest: Mapped[float]
    greatest_at: Mapped[datetime]


class SampleRollup(Rollup, Base):
    """Of samples."""

    __tablename__ = "sample_rollup"
    __table_args__ = CLUSTERED


class ReadingRollup(Rollup, Base):
    """Of readings."""

    __tablename__ = "reading_rollup"
    __table_args__ = CLUSTERED
