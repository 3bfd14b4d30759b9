"""Tables of what is kept ashore of a robot's own memory: its parameters and its log files."""

from datetime import datetime

from sqlalchemy import ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, CLUSTERED, Base, Key


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
