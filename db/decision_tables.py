"""Tables of decisions: what each was made of, what came of it, and the contents of both."""

from datetime import datetime

from sqlalchemy import ForeignKey, Index, LargeBinary
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, Base, Document, Key


class DecisionRow(Base):
    """One decision as it was made; rows are never changed."""

    __tablename__ = "decision"
    __table_args__ = (Index(None, "robot_key", "at"), Index(None, "at"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    kind: Mapped[str]
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"))
    about: Mapped[str]
    """Id of what came of it, such as a plan's; "" where nothing has one."""
    at: Mapped[datetime]
    """When it was made, by the station's clock."""
    state: Mapped[str]
    input_sha256: Mapped[str]
    map_sha256: Mapped[str]
    outcome_sha256: Mapped[str | None]
    document: Mapped[Document]
    """Seed, counts, versions of settings and software."""


class DecisionContentRow(Base):
    """A content under its SHA-256: the same is kept once, however many decisions have it."""

    __tablename__ = "decision_content"

    sha256: Mapped[bytes] = mapped_column(LargeBinary(32), primary_key=True)
    deflated: Mapped[bytes]
