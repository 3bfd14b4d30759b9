"""Tables of what was written of deployments: files, and deliveries with them."""

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


class DeliveryPackageRow(Base):
    """One delivery as it was packed: a ZIP, kept by its hash until it expires."""

    __tablename__ = "delivery_package"
    __table_args__ = (Index(None, "file_key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    file_key: Mapped[int] = mapped_column(ForeignKey("delivery_file.key"))
    """The NetCDF file in it, and with it the deployment."""
    name: Mapped[str]
    sha256: Mapped[str]
    bytes: Mapped[int] = mapped_column(BigInteger)
    has_journal: Mapped[bool]
    at: Mapped[datetime]
    by: Mapped[str]
    expires_at: Mapped[datetime]
