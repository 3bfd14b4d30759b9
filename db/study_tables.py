"""Tables of vehicles, and of the studies that are made of them and of field maps."""

from datetime import datetime

from sqlalchemy import JSON, ForeignKey, Index, UniqueConstraint
from sqlalchemy.orm import Mapped, column_property, mapped_column

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


class Study(Base):
    """What was asked of a vehicle or of a map, how far that is, and what came of it.

    The documents are the models of its kind: ``asked`` is set for ever, ``news`` grows while it
    runs, ``checkpoint`` is what it goes on from, ``result`` and ``arrays`` are what it left, and
    ``use`` is what people made of that since.
    """

    __tablename__ = "study"
    __table_args__ = (
        UniqueConstraint("kind", "number"),
        Index(None, "robot_key", "kind", "number"),
        APPENDED_ONLY,
    )

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    kind: Mapped[str]
    number: Mapped[int]
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    job_key: Mapped[int | None] = mapped_column(ForeignKey("job.key"))
    state: Mapped[str] = mapped_column(index=True)
    message: Mapped[str]
    asked: Mapped[Document]
    news: Mapped[Document]
    use: Mapped[Document | None] = mapped_column(Absent)
    checkpoint: Mapped[Document | None] = mapped_column(Absent, deferred=True)
    result: Mapped[Document | None] = mapped_column(Absent, deferred=True)
    arrays: Mapped[bytes | None] = mapped_column(deferred=True)
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    ended_at: Mapped[datetime | None]

    has_checkpoint: Mapped[bool] = column_property(checkpoint.is_not(None))
