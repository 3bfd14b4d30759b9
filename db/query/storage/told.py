"""What is no longer all there, told wherever it is shown."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.query.fleet.robots import robot_key
from db.query.storage.prunable import PRUNABLE, day_of
from db.storage_tables import NOBODY, PrunedDayRow
from db.tables import STATE_CHANNELS
from robot_link.messages import STATE

_ONE_AFTER_ANOTHER: Final = timedelta(days=1)


@dataclass(frozen=True, slots=True)
class PrunedStretch:
    """Rows that went, on days one after another."""

    kind: str
    action: str
    """``thin``, ``move`` or ``delete``."""
    period_s: int
    """Of which one row stayed, 0 where none did."""
    first_at: datetime
    last_at: datetime
    rows: int

    def joined(self, later: "PrunedStretch") -> "PrunedStretch":
        """Return this and a later stretch as one."""
        first_at, last_at = min(self.first_at, later.first_at), max(self.last_at, later.last_at)
        return replace(self, first_at=first_at, last_at=last_at, rows=self.rows + later.rows)

    @property
    def text(self) -> str:
        """A sentence, such as: *State reports ... are thinned to one per 10 s*."""
        became = {
            "thin": f"are thinned to one per {self.period_s} s, with their extremes",
            "move": "were moved to files",
            "delete": "were deleted",
        }[self.action]
        title = PRUNABLE[self.kind].title
        times = f"from {self.first_at:%Y-%m-%d} to {self.last_at:%Y-%m-%d}"
        return f"{title[0].upper()}{title[1:]} {times} {became}."


def pruned_stretches(
    session: Session,
    robot: str | None = None,
    kinds: Collection[str] = tuple(PRUNABLE),
    start: datetime | None = None,
    end: datetime | None = None,
) -> list[PrunedStretch]:
    """Return what went of a robot between two moments, the oldest first; of all where ``None``.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    of = PrunedDayRow
    columns = (of.kind, of.action, of.period_s, of.first_at, of.last_at, of.rows)
    statement = select(*columns).where(of.kind.in_(kinds), of.rows > 0)
    if robot is not None:
        statement = statement.where(of.robot_key.in_((robot_key(session, robot), NOBODY)))
    if start is not None:
        statement = statement.where(of.day >= day_of(start))
    if end is not None:
        statement = statement.where(of.day <= day_of(end))
    found: list[PrunedStretch] = []
    newest: dict[tuple[str, str, int], int] = {}
    for row in session.execute(statement.order_by(of.day)):
        kind, action, period_s, first_at, last_at, rows = row
        if first_at is None or last_at is None:
            continue
        stretch = PrunedStretch(kind, action, period_s, first_at, last_at, rows)
        series = (kind, action, period_s)
        place = newest.get(series)
        if place is None or first_at - found[place].last_at > _ONE_AFTER_ANOTHER:
            newest[series] = len(found)
            found.append(stretch)
        else:
            found[place] = found[place].joined(stretch)
    return found


def pruned_of_channel(
    session: Session,
    robot: str,
    channel: str | None,
    start: datetime | None = None,
    end: datetime | None = None,
) -> list[str]:
    """Return what is no longer all there of a channel, or of a track where ``None``; sentences.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    is_of_state = channel is None or channel in STATE_CHANNELS or bool(STATE.parts_of_norm(channel))
    kinds = ("states",) if is_of_state else ("samples", "readings")
    return [one.text for one in pruned_stretches(session, robot, kinds, start, end)]
