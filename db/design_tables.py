"""Tables of designs: missions as people draw them, their steps, versions and templates."""

from datetime import datetime
from typing import Any

from sqlalchemy import JSON, ForeignKey, Index, false
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, CLUSTERED, Base, Document, Key


class DesignRow(Base):
    """A design; its working document is the step at the cursor."""

    __tablename__ = "design"
    __table_args__ = (Index(None, "robot_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    name: Mapped[str]
    water: Mapped[str | None]
    revision: Mapped[int]
    cursor: Mapped[int]
    is_archived: Mapped[bool] = mapped_column(server_default=false())
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    changed_at: Mapped[datetime]
    changed_by: Mapped[str]


class DesignStepRow(Base):
    """One change of a design: the whole document after it."""

    __tablename__ = "design_step"
    __table_args__ = CLUSTERED

    design_key: Mapped[int] = mapped_column(ForeignKey("design.key"), primary_key=True)
    number: Mapped[int] = mapped_column(primary_key=True)
    what: Mapped[str]
    document: Mapped[Document]
    changed_at: Mapped[datetime]
    changed_by: Mapped[str]


class DesignVersionRow(Base):
    """A saved version of a design; never changed but for the plan that it became last."""

    __tablename__ = "design_version"
    __table_args__ = CLUSTERED

    design_key: Mapped[int] = mapped_column(ForeignKey("design.key"), primary_key=True)
    number: Mapped[int] = mapped_column(primary_key=True)
    comment: Mapped[str]
    document: Mapped[Document]
    saved_at: Mapped[datetime]
    saved_by: Mapped[str]
    plan_key: Mapped[int | None] = mapped_column(ForeignKey("plan.key"))


class DesignTemplateRow(Base):
    """A document with parameters, from which designs begin."""

    __tablename__ = "design_template"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    name: Mapped[str]
    document: Mapped[Document]
    parameters: Mapped[list[dict[str, Any]]] = mapped_column(JSON)
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    is_archived: Mapped[bool] = mapped_column(server_default=false())
