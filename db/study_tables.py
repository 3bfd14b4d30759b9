"""Tables of vehicles, and of the studies that operators make of them."""

from datetime import datetime
from typing import Any

from sqlalchemy import JSON, ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, Base, Document, Key

Absent = JSON(none_as_null=True)
"""A document that may be missing: then the column is NULL, which queries can ask for."""


class VehicleRow(Base):
    """A vehicle that was brought as a file or identified; rows are never changed."""

    __tablename__ = "vehicle"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    id: Mapped[str] = mapped_column(unique=True)
    title: Mapped[str]
    note: Mapped[str]
    origin: Mapped[str]
    document: Mapped[Document]
    created_at: Mapped[datetime]
    created_by: Mapped[str]


class WhatIf(Base):
    """One comparison of controllers on a trajectory, and what came of it."""

    __tablename__ = "whatif"
    __table_args__ = (Index(None, "robot_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    job_key: Mapped[int | None] = mapped_column(ForeignKey("job.key"))
    state: Mapped[str] = mapped_column(index=True)
    title: Mapped[str]
    vehicle: Mapped[str]
    scenario: Mapped[Document]
    controllers: Mapped[list[Any]] = mapped_column(JSON)
    message: Mapped[str]
    result: Mapped[Document | None] = mapped_column(Absent)
    shown_from: Mapped[Document | None] = mapped_column(Absent)
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    ended_at: Mapped[datetime | None]


class Identification(Base):
    """One search for a vehicle's parameters in a recording, with the point to go on from."""

    __tablename__ = "identification"
    __table_args__ = (Index(None, "robot_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    deployment_key: Mapped[int] = mapped_column(ForeignKey("deployment.key"))
    job_key: Mapped[int | None] = mapped_column(ForeignKey("job.key"))
    state: Mapped[str] = mapped_column(index=True)
    vehicle: Mapped[str]
    vehicle_document: Mapped[Document]
    config: Mapped[Document]
    data_start_at: Mapped[datetime]
    data_end_at: Mapped[datetime]
    progress: Mapped[float]
    message: Mapped[str]
    convergence: Mapped[list[Any]] = mapped_column(JSON)
    checkpoint: Mapped[Document | None] = mapped_column(Absent)
    result: Mapped[Document | None] = mapped_column(Absent)
    accepted_vehicle: Mapped[str | None]
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    ended_at: Mapped[datetime | None]


class TrimAdvice(Base):
    """What the last dives say of a robot's trim, and whether someone took the advice."""

    __tablename__ = "trim_advice"
    __table_args__ = (Index(None, "robot_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    deployment_key: Mapped[int] = mapped_column(ForeignKey("deployment.key"))
    trim_version: Mapped[str]
    document: Mapped[Document]
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    accepted_at: Mapped[datetime | None]
    accepted_by: Mapped[str | None]
    accepted_share: Mapped[float | None]
