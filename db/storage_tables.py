"""Tables of what no longer is where it was: days that were pruned, and the files that hold them."""

from datetime import datetime

from sqlalchemy import BigInteger, Index, Integer, false
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, CLUSTERED, Base, Key

NOBODY = 0
"""Stands for the robot of packets that belong to none."""


class PrunedDayRow(Base):
    """What went of one kind of data, of one robot and one day (UTC), in one way.

    Counted in the transactions in which the rows go, or come back from files, so that it tells of
    no row too many or few.
    """

    __tablename__ = "pruned_day"
    __table_args__ = CLUSTERED

    kind: Mapped[str] = mapped_column(primary_key=True)
    robot_key: Mapped[int] = mapped_column(Key, primary_key=True)
    day: Mapped[int] = mapped_column(Integer, primary_key=True)
    """Days from the epoch."""
    action: Mapped[str] = mapped_column(primary_key=True)
    """``thin``, ``move`` or ``delete``."""
    period_s: Mapped[int] = mapped_column(Integer, primary_key=True)
    """Of a series that was thinned; else 0."""
    rows: Mapped[int] = mapped_column(BigInteger)
    first_at: Mapped[datetime | None]
    """Of the rows that went; none before the first has."""
    last_at: Mapped[datetime | None]
    is_whole: Mapped[bool] = mapped_column(server_default=false())
    """Whether all of the day was seen to; the next pass need not look at it."""


class ArchiveFileRow(Base):
    """A file that holds what was moved out of the database; see ``server.storage.archive``."""

    __tablename__ = "archive_file"
    __table_args__ = (Index(None, "kind", "robot_key", "day"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    kind: Mapped[str]
    robot_key: Mapped[int] = mapped_column(Key)
    day: Mapped[int] = mapped_column(Integer)
    path: Mapped[str]
    """Below the folder of archives."""
    rows: Mapped[int] = mapped_column(BigInteger)
    bytes: Mapped[int] = mapped_column(BigInteger)
    sha256: Mapped[str]
    first_at: Mapped[datetime]
    last_at: Mapped[datetime]
    state: Mapped[str]
    """``written``: the rows are in both, or on their way out; ``moved``: those that might go are in
    the file alone; ``restored``: back, or on their way."""
    written_at: Mapped[datetime]
    restored_at: Mapped[datetime | None]
