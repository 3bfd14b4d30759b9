"""Who may be asked to look after an alarm, and whether a notice would reach them."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter
from sqlalchemy.orm import Session

from db.query.station.alarms import get_alarm
from db.query.station.notices import Reachable, everybody
from server.access.dependency import Pilot
from server.access.role import Right
from server.base.dependency import FoundationDep
from server.base.view import View, one_of
from server.notice.escalation import rights_of
from server.notice.wish import Wishes, gate

router = APIRouter(prefix="/api/notices", tags=["notices"])


@dataclass(frozen=True, slots=True)
class AssigneeView(View):
    """A person who may look after an alarm."""

    person: str
    told: Annotated[str, one_of("now", "later", "off_duty", "no_contact")]
    """When a notice would leave to them: ``later`` after their quiet hours; never to who is
    ``off_duty`` or has ``no_contact``."""
    told_at: datetime | None
    """When their quiet hours end."""


@router.get("/assignees/{alarm}")
async def list_assignees(
    caller: Pilot, alarm: str, foundation: FoundationDep
) -> list[AssigneeView]:
    """Return who may look after an alarm, and when a notice of it would leave to them."""
    del caller
    now = foundation.clock.now()

    def read(session: Session) -> list[AssigneeView]:
        found = get_alarm(session, alarm)
        return [
            _assignee(person, found.level, now)
            for person in everybody(session)
            if rights_of(person).may(Right.PILOT, found.robot)
        ]

    return await foundation.store.query(read)


def _assignee(person: Reachable, level: str, now: datetime) -> AssigneeView:
    if not any(contact.enabled for contact in person.contacts):
        return AssigneeView(person.name, "no_contact", None)
    found = gate(Wishes.model_validate(person.wishes), level, now)
    if found.is_open:
        return AssigneeView(person.name, "now", None)
    told = "off_duty" if found.until is None else "later"
    return AssigneeView(person.name, told, found.until)
