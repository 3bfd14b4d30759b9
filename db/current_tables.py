"""Table of what robots believed of the water's current."""

from datetime import datetime

from sqlalchemy import ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import CLUSTERED, Base


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
