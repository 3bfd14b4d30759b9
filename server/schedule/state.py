"""The state of a scheduled send: nothing moves it but what was proved, by this table.

==============  ==========  ==========  ==================
state           evidence    becomes     event
==============  ==========  ==========  ==================
waiting         begun       sent        schedule.sent
sent            arrived     done        schedule.done
waiting, sent   expired     expired     schedule.expired
waiting, sent   cancelled   cancelled   schedule.cancelled
waiting, sent   purged      withdrawn   schedule.withdrawn
waiting, sent   failed      failed      schedule.failed
==============  ==========  ==========  ==================

``begun`` is written in the transaction that adds the transfer, so a station that is killed at any
moment has sent it or not. What has ended stays as it ended.
"""

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

from sqlalchemy.orm import Session

from db.query.mission import scheduled_sends as query
from db.query.mission.scheduled_sends import ScheduledSend
from db.query.station.events import add_event
from db.writer import tell_after_commit
from server.base.transition_table import transitions
from server.command.state import SurfaceOrdered

_LEVELS = {"expired": "watch", "failed": "warning", "withdrawn": "watch"}


class SendEvidence(StrEnum):
    """What can be proved of a scheduled send."""

    BEGUN = "begun"
    """Its transfer exists."""
    ARRIVED = "arrived"
    """The robot has the plan on board, by its own word."""
    EXPIRED = "expired"
    CANCELLED = "cancelled"
    PURGED = "purged"
    """The robot was told to surface: it gets nothing more by itself."""
    FAILED = "failed"
    """The plan cannot be sent any more, or its transfer ended otherwise."""


TRANSITIONS = transitions(__doc__, SendEvidence)


@dataclass(frozen=True, slots=True)
class ScheduleChanged:
    """A scheduled send was added, or moved; told after the commit."""

    send: ScheduledSend


def apply(
    session: Session, schedule: str, evidence: SendEvidence, text: str, at: datetime
) -> ScheduledSend | None:
    """Move a scheduled send as the table says, with its event.

    Args:
        session: The transaction.
        schedule: Which.
        evidence: What was proved.
        text: Why, one sentence.
        at: When.

    Returns:
        What it is now; ``None`` if the evidence leads nowhere, and nothing was changed.
    """
    before = query.get_scheduled_send(session, schedule)
    step = TRANSITIONS.get((before.state, evidence))
    if step is None:
        return None
    moved: dict[str, object] = {"state": step.state, "reason": text}
    moved["sent_at" if step.state == "sent" else "ended_at"] = at
    after = query.change_scheduled_send(session, schedule, **moved)
    data = {"schedule": after.id, "plan": after.plan}
    level = _LEVELS.get(after.state, "info")
    add_event(session, at, step.event, text, level=level, robot=after.robot, data=data)
    return told(session, after)


def note(session: Session, schedule: str, **changes: object) -> ScheduledSend:
    """Write down more about one whose state does not change, such as what holds it."""
    return told(session, query.change_scheduled_send(session, schedule, **changes))


def told(session: Session, send: ScheduledSend) -> ScheduledSend:
    """Have everybody told after the commit."""
    tell_after_commit(session, ScheduleChanged(send), send.id)
    return send


def purge_for(session: Session, event: SurfaceOrdered) -> None:
    """Let nothing more be sent to a robot by itself, in the transaction of its order to surface."""
    for send in query.open_scheduled_sends(session, event.robot):
        text = f"{send.plan} is not sent: {event.reason}"
        apply(session, send.id, SendEvidence.PURGED, text, event.at)
