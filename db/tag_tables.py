"""Tables of acoustic tags that robots heard, and of the receivers that heard them."""

from datetime import datetime

from sqlalchemy import BigInteger, ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import CLUSTERED, Base


class DetectionRow(Base):
    """One transmission of a tag that a robot's receiver heard, told by the robot or imported.

    The same transmission on the same receiver is kept once, whichever way it came.
    """

    __tablename__ = "detection"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    measured_at: Mapped[datetime] = mapped_column(primary_key=True)
    tag: Mapped[str] = mapped_column(primary_key=True)
    receiver: Mapped[str] = mapped_column(primary_key=True)
    received_at: Mapped[datetime]
    sensor: Mapped[float | None]
    sensor_unit: Mapped[str | None]
    north_m: Mapped[float | None]
    east_m: Mapped[float | None]
    depth_m: Mapped[float | None]
    position_std_m: Mapped[float | None]
    tag_name: Mapped[str | None]
    tag_serial: Mapped[str | None]
    station: Mapped[str | None]


class ReceiverReportRow(Base):
    """One report of a robot on its tag receiver."""

    __tablename__ = "receiver_report"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    measured_at: Mapped[datetime] = mapped_column(primary_key=True)
    received_at: Mapped[datetime]
    receiver: Mapped[int] = mapped_column(BigInteger)
    heard: Mapped[int] = mapped_column(BigInteger)
    refused_sum: Mapped[int] = mapped_column(BigInteger)
    refused_date: Mapped[int] = mapped_column(BigInteger)
    refused_code: Mapped[int] = mapped_column(BigInteger)
    clock_offset_s: Mapped[float | None]
