"""What happened, as the log book shows it between what people write: read, never copied."""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from sqlalchemy import ColumnElement
from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.query.log_book.entries import Place, is_about, is_before
from db.query.station.events import EventFilter, EventRecord, events_by_time
from db.tables import Event
from robot_link.messages import CommandKind

ORDERS: Final = (
    *(f"command.{kind.value}" for kind in CommandKind),
    "command.applied",
    "command.refused",
    "command.expired",
    "drive.begun",
    "drive.ended",
)
DIVES: Final = (
    "robot.dive_begun",
    "robot.dive_ended",
    "robot.surfaced",
    "deployment.began",
    "deployment.ended",
)
ALARMS: Final = (
    "alarm.raised",
    "alarm.changed",
    "alarm.acknowledged",
    "alarm.returned",
    "alarm.closed",
    "alarm.shelved",
    "alarm.unshelved",
    "alarm.suppressed",
    "alarm.out_of_service",
    "alarm.noted",
    "alarm.assigned",
)
PLANS: Final = (
    "plan.sent",
    "plan.waiting",
    "plan.on_board",
    "plan.running",
    "plan.done",
    "plan.failed",
    "plan.withdrawn",
    "plan.not_sent",
    "schedule.waiting",
    "schedule.sent",
    "schedule.expired",
)
CHECKLISTS: Final = (
    "checklist.begun",
    "checklist.completed",
    "checklist.overruled",
    "checklist.reopened",
)
CHARGE: Final = (
    "lease.taken",
    "lease.taken_over",
    "lease.granted",
    "lease.handed_over",
    "lease.released",
    "lease.timed_out",
)
"""Who came to be in charge of a robot."""
WATCH: Final = ("shift.begun", "shift.ended", "page.signed", "page.taken", *CHECKLISTS, *CHARGE)
GROUPS = MappingProxyType(
    {"orders": ORDERS, "dives": DIVES, "alarms": ALARMS, "plans": PLANS, "watch": WATCH}
)
"""Kinds of events that the log book shows, by what they are about."""
GROUP_OF = MappingProxyType({kind: group for group, kinds in GROUPS.items() for kind in kinds})


@dataclass(frozen=True, slots=True)
class ToldFilter:
    """Which events are wanted; what is not given takes all of the groups."""

    groups: tuple[str, ...]
    robot: str | None = None
    period: Period | None = None
    by: str | None = None
    text: str = ""
    before: Place | None = None
    robots: frozenset[str] | None = None
    """Only about these; ``None`` for everything."""


def told_events(session: Session, wanted: ToldFilter, limit: int) -> list[EventRecord]:
    """Return events of some groups, the newest moments first.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    kinds = [kind for group in wanted.groups for kind in GROUPS[group]]
    if not kinds:
        return []
    chosen = EventFilter(
        robot=wanted.robot, kinds=kinds, period=wanted.period, by=wanted.by, text=wanted.text
    )
    conditions = list[ColumnElement[bool]]()
    if wanted.before is not None:
        conditions.append(is_before(wanted.before, 0, Event.at, Event.cursor))
    if wanted.robots is not None:
        conditions.append(is_about(wanted.robots, Event.robot_key))
    return events_by_time(session, chosen, limit, *conditions)


def place_of(event: EventRecord) -> Place:
    """Return where an event stands in the log book."""
    return Place(event.at, 0, event.cursor)
