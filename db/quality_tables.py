"""Tables of quality control: runs of rules, what they found, and flags that people set."""

from datetime import datetime

from sqlalchemy import BigInteger, ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, CLUSTERED, Base, Document, Key


class QualityRunRow(Base):
    """One run over a deployment, with the rules that it followed; never changed."""

    __tablename__ = "quality_run"
    __table_args__ = (Index(None, "deployment_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    deployment_key: Mapped[int] = mapped_column(ForeignKey("deployment.key"))
    rules: Mapped[Document]
    sha256: Mapped[str]
    counts: Mapped[Document]
    """How many values have which flag, by series and test."""
    rows: Mapped[int] = mapped_column(BigInteger)
    """Moments that it looked at."""
    samples: Mapped[int | None] = mapped_column(BigInteger)
    """Measurements that there were; absent in runs of before this was kept, as is ``seen``."""
    seen: Mapped[bytes | None] = mapped_column(deferred=True)
    """At which moments it saw a value of each series; see ``db.query.measured.quality``."""
    at: Mapped[datetime]
    by: Mapped[str]


class QualityStretchRow(Base):
    """Values of a series in a row that have the same flag, which is not good."""

    __tablename__ = "quality_stretch"
    __table_args__ = CLUSTERED

    run_key: Mapped[int] = mapped_column(ForeignKey("quality_run.key"), primary_key=True)
    series: Mapped[str] = mapped_column(primary_key=True)
    first_at: Mapped[datetime] = mapped_column(primary_key=True)
    last_at: Mapped[datetime]
    flag: Mapped[int]
    tests: Mapped[str]
    """Names of the tests that gave it, with commas between."""


class ManualFlagRow(Base):
    """A flag that a person gave a stretch of time of a series, which counts before any test."""

    __tablename__ = "manual_flag"
    __table_args__ = (Index(None, "deployment_key", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    deployment_key: Mapped[int] = mapped_column(ForeignKey("deployment.key"))
    series: Mapped[str]
    first_at: Mapped[datetime]
    last_at: Mapped[datetime]
    flag: Mapped[int]
    reason: Mapped[str]
    at: Mapped[datetime]
    by: Mapped[str]
    withdrawn_at: Mapped[datetime | None]
    withdrawn_by: Mapped[str | None]
