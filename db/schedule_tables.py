"""Table of plans that the station sends by itself: at a surfacing, at a time, or on a condition."""

from datetime import datetime

from sqlalchemy import ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, Base, Document, Key


class ScheduledSendRow(Base):
    """One plan that waits at the station to be sent."""

    __tablename__ = "scheduled_send"
    __table_args__ = (
        Index(None, "robot_key", "key"),
        Index(None, "ended_at"),
        APPENDED_ONLY,
    )

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    plan_key: Mapped[int] = mapped_column(ForeignKey("plan.key"))
    state: Mapped[str]
    condition: Mapped[Document]
    """What it waits for."""
    cursor: Mapped[int]
    """Of the event log when it was asked for: what happened before is no occasion."""
    route: Mapped[str]
    start: Mapped[bool]
    confirmed: Mapped[bool]
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    expires_at: Mapped[datetime]
    due_at: Mapped[datetime | None]
    sent_at: Mapped[datetime | None]
    ended_at: Mapped[datetime | None]
    reason: Mapped[str]
