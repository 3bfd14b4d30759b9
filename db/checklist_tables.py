"""Tables of checklists: templates as they were saved, runs through one, and what people ticked."""

from datetime import datetime

from sqlalchemy import ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, Base, Document, Key


class ChecklistTemplateRow(Base):
    """One version of a template; the newest of a key counts."""

    __tablename__ = "checklist_template"
    __table_args__ = (Index(None, "template", "version", unique=True), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    template: Mapped[str]
    version: Mapped[int]
    """Counts from 1; a delivered document is version 0 and has no row."""
    document: Mapped[Document | None]
    """None from when it is as delivered again, or put away where it was not delivered."""
    saved_at: Mapped[datetime]
    saved_by: Mapped[str]


class ChecklistRunRow(Base):
    """One run of a robot through a template, with the document that it was begun with."""

    __tablename__ = "checklist_run"
    __table_args__ = (
        Index(None, "robot_key", "key"),
        Index(None, "ended_at"),
        APPENDED_ONLY,
    )

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    deployment_key: Mapped[int | None] = mapped_column(ForeignKey("deployment.key"))
    template: Mapped[str]
    version: Mapped[int]
    document: Mapped[Document]
    state: Mapped[str]
    begun_at: Mapped[datetime]
    begun_by: Mapped[str]
    expires_at: Mapped[datetime | None]
    """None where it holds for the deployment."""
    ended_at: Mapped[datetime | None]
    """Since when it counts no more."""
    settled_at: Mapped[datetime | None]
    """When it was completed or overruled; None while it is open."""
    settled_by: Mapped[str]
    reason: Mapped[str]
    """Why it was overruled, or ended."""
    found: Mapped[Document]
    """What each automatic item found at that moment, and what was open then, by item."""


class ChecklistTickRow(Base):
    """An item that somebody ticked, or unticked."""

    __tablename__ = "checklist_tick"
    __table_args__ = (Index(None, "run_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    run_key: Mapped[int] = mapped_column(ForeignKey("checklist_run.key"))
    item: Mapped[str]
    is_ticked: Mapped[bool]
    at: Mapped[datetime]
    by: Mapped[str]
    note: Mapped[str]
