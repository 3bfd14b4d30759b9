"""The state of a checklist's run: nothing moves it but this table.

=========================  =========  =========  ====================
state                      evidence   becomes    event
=========================  =========  =========  ====================
open                       completed  complete   checklist.completed
open, complete, overruled  overruled  overruled  checklist.overruled
complete                   unticked   open       checklist.reopened
open, complete, overruled  expired    expired    checklist.expired
=========================  =========  =========  ====================

``completed`` is a person's word, by whom every blocking item was found well at that moment; an
overruled run was started against open items, which it names. What has expired stays as it ended.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any

from sqlalchemy.orm import Session

from db.query.mission import checklists as query
from db.query.mission.checklists import ChecklistRun
from db.query.station.events import add_event
from db.writer import tell_after_commit
from server.base.problem import conflict
from server.base.transition_table import transitions

SETTLED = ("complete", "overruled")
"""States in which a start need not wait for a run's ticks."""
_LEVELS = {"checklist.overruled": "warning", "checklist.reopened": "watch"}


class RunEvidence(StrEnum):
    """What can be proved of a run."""

    COMPLETED = "completed"
    OVERRULED = "overruled"
    UNTICKED = "unticked"
    """A blocking item is open again, by somebody's hand."""
    EXPIRED = "expired"
    """Its time is over, its deployment has ended, or another run took its place."""


TRANSITIONS = transitions(__doc__, RunEvidence)


@dataclass(frozen=True, slots=True)
class ChecklistChanged:
    """A run was begun, ticked or moved; told after the commit."""

    run: ChecklistRun


def apply(
    session: Session,
    run: str,
    evidence: RunEvidence,
    text: str,
    at: datetime,
    *,
    by: str = "",
    reason: str = "",
    found: Mapping[str, Any] | None = None,
) -> ChecklistRun:
    """Move a run as the table says, with its event.

    Args:
        session: The transaction.
        run: Which.
        evidence: What was proved.
        text: What the event says.
        at: When.
        by: Who settles it.
        reason: Why it is overruled, or has ended.
        found: What automatic items found, and what was open, as it is settled.

    Raises:
        Problem: 409 if the evidence leads nowhere; nothing is changed.
        UnknownIdError: If there is no such run.
    """
    before = query.get_run(session, run)
    step = TRANSITIONS.get((before.state, evidence))
    if step is None:
        raise conflict(f"{run} is {before.state}; begin the list anew.")
    moved: dict[str, Any] = {"state": step.state, "reason": reason}
    if step.state in SETTLED:
        moved.update(settled_at=at, settled_by=by, found=dict(found or {}))
    elif step.state == "open":
        moved.update(settled_at=None, settled_by="", found={})
    else:
        moved["ended_at"] = at
    after = query.change_run(session, run, **moved)
    data = {"checklist": run, "template": after.template, "reason": reason}
    add_event(
        session, at, step.event, text, level=_LEVELS.get(step.event, "info"), robot=after.robot,
        data=data,
    )  # fmt: skip
    return told(session, after)


def told(session: Session, run: ChecklistRun) -> ChecklistRun:
    """Have everybody told after the commit."""
    tell_after_commit(session, ChecklistChanged(run), run.id)
    return run
