"""Table of what robots that follow a target said of their hold on it."""

from datetime import datetime

from sqlalchemy import JSON, ForeignKey, false
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import CLUSTERED, Base


class TargetReportRow(Base):
    """One report of a robot on its target."""

    __tablename__ = "track_report"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    measured_at: Mapped[datetime] = mapped_column(primary_key=True)
    received_at: Mapped[datetime]
    phase: Mapped[int]
    north_m: Mapped[float]
    east_m: Mapped[float]
    hypotheses: Mapped[list[list[float]]] = mapped_column(JSON)
    """North m, east m, velocity north m/s, east m/s, covariance north-north, north-east, east-east
    m2 and weight of each, the likeliest first."""
    range_m: Mapped[float | None]
    range_age_s: Mapped[float]
    ranges_heard: Mapped[int]
    ranges_rejected: Mapped[int]
    determinant_m2_s: Mapped[float]
    barrier: Mapped[float]
    inverse_condition: Mapped[float]
    nominal_turn_rate_rad_s: Mapped[float]
    nominal_acceleration_m_s2: Mapped[float]
    turn_rate_rad_s: Mapped[float]
    acceleration_m_s2: Mapped[float]
    is_barrier_on: Mapped[bool]
    is_feasible: Mapped[bool]
    is_quiet: Mapped[bool]
    true_north_m: Mapped[float | None]
    true_east_m: Mapped[float | None]
    is_too_fast: Mapped[bool] = mapped_column(default=False, server_default=false())
    speed_class: Mapped[int | None]
    """Number of the class; none where the robot did not estimate it."""
    delay_s: Mapped[float | None]
