"""Which days of a robot may not be touched: of deployments that last, and of those relied upon."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import Select, or_, select
from sqlalchemy.orm import Session

from db.delivery_tables import DeliveryFileRow
from db.identity import public_id
from db.log_book_tables import LogEntryRow, LogEntryVersionRow
from db.quality_tables import ManualFlagRow, QualityRunRow
from db.query.storage.prunable import day_of
from db.storage_tables import NOBODY, ArchiveFileRow
from db.tables import Deployment

RESTORED_FOR = timedelta(days=30)
"""What was read back from files stays for so long."""


@dataclass(frozen=True, slots=True)
class Hold:
    """Days of a robot that may not be touched, both included."""

    robot_key: int
    first: int
    last: int | None
    """``None``: without an end."""
    about: str
    """Id of the deployment; "" where it is none."""
    because: str
    """A part of a sentence, such as ``it lasts``."""

    def has(self, day: int) -> bool:
        """Tell whether a day is one of them."""
        return self.first <= day and (self.last is None or day <= self.last)


_REASONS: tuple[tuple[str, Select[Any]], ...] = (
    ("files were written of it", select(DeliveryFileRow.deployment_key)),
    ("its quality was judged", select(QualityRunRow.deployment_key)),
    (
        "somebody set flags in it",
        select(ManualFlagRow.deployment_key).where(ManualFlagRow.withdrawn_at.is_(None)),
    ),
    (
        "a signed page tells of it",
        select(LogEntryVersionRow.deployment_key)
        .join(LogEntryRow, LogEntryRow.key == LogEntryVersionRow.entry_key)
        .where(LogEntryRow.page_key.is_not(None), LogEntryVersionRow.deployment_key.is_not(None)),
    ),
)


def holds(session: Session, now: datetime, robot_key: int | None = None) -> list[Hold]:
    """Return every hold, or those of a robot."""
    relied: dict[int, str] = {}
    for because, statement in _REASONS:
        for key in session.scalars(statement.distinct()):
            relied.setdefault(key, because)
    statement = select(
        Deployment.key, Deployment.robot_key, Deployment.started_at, Deployment.ended_at
    ).where(
        Deployment.void_reason == "",
        Deployment.started_at.is_not(None),
        or_(Deployment.ended_at.is_(None), Deployment.key.in_(relied)),
    )
    if robot_key is not None:
        statement = statement.where(Deployment.robot_key == robot_key)
    found: list[Hold] = []
    for key, owner, started_at, ended_at in session.execute(statement):
        if started_at is None:
            continue
        because = relied.get(key, "it lasts") if ended_at is not None else "it lasts"
        last = None if ended_at is None else day_of(ended_at)
        found.append(Hold(owner, day_of(started_at), last, public_id("deployment", key), because))
    return [*found, *_restored(session, now, robot_key)]


def _restored(session: Session, now: datetime, robot_key: int | None) -> list[Hold]:
    statement = select(ArchiveFileRow.robot_key, ArchiveFileRow.day).where(
        ArchiveFileRow.state == "restored", ArchiveFileRow.restored_at > now - RESTORED_FOR
    )
    if robot_key is not None:
        statement = statement.where(ArchiveFileRow.robot_key.in_((robot_key, NOBODY)))
    because = "it was read back from files lately"
    return [Hold(owner, day, day, "", because) for owner, day in session.execute(statement)]


def is_held(found: Sequence[Hold], robot_key: int, day: int) -> bool:
    """Tell whether a day of a robot may not be touched.

    Packets of nobody are held wherever a deployment of any robot lasts: they may be of it.
    """
    return any(
        hold.has(day)
        and (hold.robot_key in (robot_key, NOBODY) or (robot_key == NOBODY and hold.last is None))
        for hold in found
    )
