"""Tables of what robots believed of the current, what dives tell of it, and where robots were."""

from datetime import datetime

from sqlalchemy import ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, CLUSTERED, Base, Document, Key


class CurrentReportRow(Base):
    """One report of a robot on the current with which it reckons its position."""

    __tablename__ = "current_report"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    measured_at: Mapped[datetime] = mapped_column(primary_key=True)
    received_at: Mapped[datetime]
    north_m_s: Mapped[float]
    east_m_s: Mapped[float]
    std_m_s: Mapped[float]
    doubt: Mapped[float]
    dives: Mapped[int]
    fixes_refused: Mapped[int]


class CurrentObservationRow(Base):
    """What a dive, or a stay at the surface, told of the current between its two fixes."""

    __tablename__ = "current_observation"
    __table_args__ = (UniqueConstraint("robot_key", "ended_at", "started_at"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    started_at: Mapped[datetime]
    ended_at: Mapped[datetime]
    is_surface: Mapped[bool]
    document: Mapped[Document]


class PredictionRow(Base):
    """Where a robot that was not heard should have been, and where the next fix found it."""

    __tablename__ = "prediction"
    __table_args__ = (UniqueConstraint("robot_key", "seen_at"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    said_at: Mapped[datetime]
    seen_at: Mapped[datetime]
    is_inside: Mapped[bool]
    document: Mapped[Document]
