"""Table of the waters in which robots work."""

from datetime import datetime

from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, Base, Document, Key


class WaterRow(Base):
    """A water: its document as it is now; it is retired, never deleted."""

    __tablename__ = "water"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    id: Mapped[str] = mapped_column(unique=True)
    document: Mapped[Document]
    version: Mapped[int]
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    changed_at: Mapped[datetime]
    retired_at: Mapped[datetime | None]
