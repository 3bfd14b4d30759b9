"""Table of who is in charge of each robot."""

from datetime import datetime

from sqlalchemy import ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, Base, Key


class LeaseRow(Base):
    """The lease of one robot; a robot without a row is free."""

    __tablename__ = "lease"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), unique=True)
    state: Mapped[str]
    holder: Mapped[str | None]
    holder_kind: Mapped[str | None]
    holder_token: Mapped[str | None]
    holder_system: Mapped[int | None]
    """MAVLink system id of another ground station that holds it."""
    since: Mapped[datetime | None]
    reason: Mapped[str]
    """Why it came to be held as it is, one sentence."""
    requested_by: Mapped[str | None]
    requested_system: Mapped[int | None]
    """The same of one that asks for it."""
    requested_at: Mapped[datetime | None]
    request_note: Mapped[str]
    script: Mapped[str | None]
    script_token: Mapped[str | None]
    """The script that may act under the lease of a person."""
