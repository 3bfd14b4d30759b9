"""Table of the files that were written of deployments."""

from datetime import datetime

from sqlalchemy import BigInteger, ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, Base, Document, Key


class DeliveryFileRow(Base):
    """One file as it was written; its content is kept by its hash and never changed."""

    __tablename__ = "delivery_file"
    __table_args__ = (Index(None, "deployment_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    deployment_key: Mapped[int] = mapped_column(ForeignKey("deployment.key"))
    name: Mapped[str]
    mode: Mapped[str]
    sha256: Mapped[str]
    bytes: Mapped[int] = mapped_column(BigInteger)
    rows: Mapped[int] = mapped_column(BigInteger)
    document: Mapped[Document]
    """What the checks said, and what else is to be known of it."""
    at: Mapped[datetime]
    by: Mapped[str]
