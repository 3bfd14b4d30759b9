"""Tables of field maps, and of what the station worked out about the samples behind them."""

from datetime import datetime

from sqlalchemy import BigInteger, ForeignKey, Index, Integer
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, CLUSTERED, Base, Document, Key


class MapSnapshot(Base):
    """A field map as it was after some samples, for the time slider and for a restart."""

    __tablename__ = "map_snapshot"
    __table_args__ = (Index(None, "robot_key", "variable", "model", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    variable: Mapped[str]
    model: Mapped[str]
    at: Mapped[datetime]
    samples: Mapped[int]
    document: Mapped[Document]
    grid: Mapped[bytes]


class SmoothedSample(Base):
    """Where a sample was taken, after the fix that ended its dive; the robot's own word stays.

    Every sample of a dive that was smoothed has a row; all rows of a dive are written at once.
    """

    __tablename__ = "smoothed_place"
    __table_args__ = CLUSTERED

    log_key: Mapped[int] = mapped_column(ForeignKey("sample_log.key"), primary_key=True)
    sequence: Mapped[int] = mapped_column(BigInteger, primary_key=True)
    north_mm: Mapped[int] = mapped_column(Integer)
    east_mm: Mapped[int] = mapped_column(Integer)
    depth_mm: Mapped[int] = mapped_column(Integer)
    position_std_um: Mapped[int] = mapped_column(BigInteger)
