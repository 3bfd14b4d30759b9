"""Scheduled sends as an operator sees them."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from db.query.mission.scheduled_sends import ScheduledSend
from db.record import same
from server.base.view import View, one_of
from server.fleet.routing import RequestedLink
from server.schedule.condition import Condition, condition_of, text_of

ScheduleState = Annotated[
    str, one_of("waiting", "sent", "done", "expired", "cancelled", "withdrawn", "failed")
]


@dataclass(frozen=True, slots=True)
class ScheduledSendView(View):
    """A plan that waits at the station, or how that ended."""

    id: str
    robot: str
    plan: str
    state: ScheduleState
    """``waiting`` at the station, ``sent`` (its transfer is under way), ``done`` (on board),
    ``expired`` (dropped, not sent), ``cancelled`` by a person, ``withdrawn`` by an order to surface
    or ``failed``."""
    condition: Condition
    text: str
    """What it waits for and until when, or how it ended, in one sentence."""
    route: RequestedLink
    start: bool
    created_at: datetime
    created_by: str
    expires_at: datetime
    """Nothing is sent after that."""
    due_at: datetime | None
    """Since when the condition is true; ``null`` while it is not."""
    sent_at: datetime | None
    ended_at: datetime | None
    can_cancel: bool


@dataclass(frozen=True, slots=True)
class ScheduleView(View):
    """What waits for a robot, the newest first, and the expiry that is offered."""

    sends: list[ScheduledSendView]
    default_expires_at: datetime
    """Offered where a person names none; the request must name one."""


def send_view(send: ScheduledSend) -> ScheduledSendView:
    """Return a scheduled send as REST says it."""
    condition = condition_of(send.condition)
    return same(
        ScheduledSendView,
        send,
        condition=condition,
        text=_text(send, condition),
        can_cancel=send.ended_at is None,
    )


def _text(send: ScheduledSend, condition: Condition) -> str:
    expiry = send.expires_at.strftime("%Y-%m-%d %H:%MZ")
    if send.ended_at is not None or send.state == "sent":
        return send.reason
    if send.due_at is None:
        return f"{send.plan} waits at the station for {text_of(condition)}, until {expiry}."
    why = f": {send.reason.rstrip('.')}" if send.reason else ""
    return f"{send.plan} is due and not sent yet{why}. It is dropped at {expiry}."
