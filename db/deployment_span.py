"""Which deployment a moment of a robot belongs to: times are half-open, void ones hold nothing."""

from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, and_, or_, select
from sqlalchemy.orm import InstrumentedAttribute, Session

from db.tables import Deployment


@dataclass(frozen=True, slots=True)
class Period:
    """A stretch of time, both ends included."""

    first: datetime
    last: datetime | None
    """``None`` while it lasts."""

    def holds(self, *columns: InstrumentedAttribute[Any]) -> ColumnElement[bool]:
        """Return what is true of a row of which one of these moments is in it."""
        return or_(*(self._has(column) for column in columns))

    def _has(self, column: InstrumentedAttribute[Any]) -> ColumnElement[bool]:
        begun = column >= self.first
        return begun if self.last is None else and_(begun, column <= self.last)

    def overlaps(
        self, begun: InstrumentedAttribute[Any], ended: InstrumentedAttribute[Any]
    ) -> ColumnElement[bool]:
        """Return what is true of a row that lasted from one moment to another, in part within it.

        One without an end lasts still; one without a beginning never did.
        """
        has_begun = begun.is_not(None) if self.last is None else begun <= self.last
        return and_(has_begun, or_(ended.is_(None), ended >= self.first))

    def cut(self, start: datetime | None, end: datetime | None) -> tuple[datetime, datetime | None]:
        """Return the part of it between two moments."""
        first = self.first if start is None else max(self.first, start)
        ends = [at for at in (self.last, end) if at is not None]
        return first, min(ends, default=None)


@dataclass(frozen=True, slots=True)
class LiveSpan:
    """Time that a robot spent in the water: ``[started_at, ended_at)``."""

    key: int
    started_at: datetime
    ended_at: datetime | None

    def holds(self, at: datetime) -> bool:
        """Tell whether a moment belongs to it."""
        return self.started_at <= at and (self.ended_at is None or at < self.ended_at)


def live_spans(session: Session, robot_keys: Collection[int]) -> dict[int, list[LiveSpan]]:
    """Return the deployments of robots that have begun, by key of the robot, the newest first."""
    rows = session.execute(
        select(Deployment.robot_key, Deployment.key, Deployment.started_at, Deployment.ended_at)
        .where(
            Deployment.robot_key.in_(robot_keys),
            Deployment.kind == "live",
            Deployment.void_reason == "",
            Deployment.started_at.is_not(None),
        )
        .order_by(Deployment.started_at.desc())
    )
    spans: dict[int, list[LiveSpan]] = defaultdict(list)
    for robot_key, key, started_at, ended_at in rows:
        if started_at is not None:
            spans[robot_key].append(LiveSpan(key, started_at, ended_at))
    return spans
