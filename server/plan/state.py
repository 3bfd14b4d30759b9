"""The state of a plan: nothing moves it but what was proved of the plan, by this table.

=======================================  ===================  ==========  ===============
state                                    evidence             becomes     event
=======================================  ===================  ==========  ===============
planning                                 made                 draft       plan.draft
planning                                 not made             failed      plan.failed
planning, draft                          cancelled            cancelled   plan.cancelled
draft                                    replaced             superseded  plan.superseded
draft                                    sent                 sent        plan.sent
sent                                     transfer ended       draft       plan.draft
draft, sent                              robot keeps it       waiting     plan.waiting
waiting                                  robot dropped it     draft       plan.draft
draft, sent, waiting                     confirmed            on_board    plan.on_board
draft, sent, waiting                     robot has it         on_board    plan.on_board
draft, sent, waiting, on_board           robot flies it       running     plan.running
draft, sent, waiting, on_board, running  robot is done        done        plan.done
draft, sent, waiting, on_board, running  robot gave up        failed      plan.failed
draft, sent, waiting, on_board, running  robot surfaced       cancelled   plan.cancelled
running                                  robot restarted      failed      plan.failed
running                                  robot changed over   superseded  plan.superseded
running                                  robot had flown it   done        plan.done
on_board, running                        robot holds another  superseded  plan.superseded
on_board, running                        robot holds none     failed      plan.failed
=======================================  ===================  ==========  ===============

Evidence that a state does not list changes nothing: reports may be missed, but never lead back.
Radio, satellite, robots' reports, planning and persons all hand theirs to ``apply``, which writes
state and event in their transaction. Once that is committed the bus is told ``PlanChanged``.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any

from sqlalchemy.orm import Session

from db.query.mission import plans as query
from db.query.mission.plans import PlanRecord, PlanStateError
from db.query.station.events import add_event
from db.writer import tell_after_commit
from server.base.transition_table import transitions

ON_THE_WAY = ("sent", "waiting", "on_board", "running")
"""States in which a plan has left the station and has not ended."""
_LEVELS = {"failed": "warning", "superseded": "watch", "cancelled": "watch"}


class PlanEvidence(StrEnum):
    """What can be proved of a plan."""

    MADE = "made"
    """It has its legs and its hash, and may be sent."""
    NOT_MADE = "not made"
    CANCELLED = "cancelled"
    """By a person, or by a survey that plans anew, before it left the station."""
    REPLACED = "replaced"
    """Another became the draft in its place."""
    SENT = "sent"
    """A radio or a gateway took the first bytes."""
    TRANSFER_ENDED = "transfer ended"
    """Withdrawn, refused, expired or failed before anyone confirmed it on board."""
    CONFIRMED = "confirmed"
    """The robot echoed the hash at the end of an upload, or acknowledged it by satellite."""
    ROBOT_KEEPS_IT = "robot keeps it"
    """It named the hash of a plan that waits on board behind the one that it flies."""
    ROBOT_DROPPED_IT = "robot dropped it"
    """It names another plan that waits, or none."""
    ROBOT_HAS_IT = "robot has it"
    ROBOT_FLIES_IT = "robot flies it"
    ROBOT_IS_DONE = "robot is done"
    ROBOT_GAVE_UP = "robot gave up"
    ROBOT_SURFACED = "robot surfaced"
    """It ended the plan because a person ordered it to the surface."""
    ROBOT_RESTARTED = "robot restarted"
    """It was switched off while it flew the plan, which waits on board again."""
    ROBOT_CHANGED_OVER = "robot changed over"
    """It ended the plan at a surfacing, for the one that waited."""
    ROBOT_HAD_FLOWN_IT = "robot had flown it"
    """It says so after it began the next: nobody heard it when it was done."""
    ROBOT_HOLDS_ANOTHER = "robot holds another"
    ROBOT_HOLDS_NONE = "robot holds none"


TRANSITIONS = transitions(__doc__, PlanEvidence)


@dataclass(frozen=True, slots=True)
class PlanChanged:
    """A plan was added, moved or written more about; told once for each commit, after it."""

    plan: PlanRecord


@dataclass(frozen=True, slots=True)
class PlanSeen:
    """More is known of a plan in which nothing was written.

    How far planning or a transfer is, what its robot says of it, or whether it still fits that.
    """

    plan: PlanRecord


def leads_on(state: str, evidence: PlanEvidence) -> bool:
    """Tell whether evidence moves a plan that is in a state."""
    return (state, evidence) in TRANSITIONS


def begin(session: Session, plan: str, document: Mapping[str, Any], at: datetime) -> PlanRecord:
    """Write down what is known of a plan that was added, and that it is about to be made."""
    record = note(session, plan, document, at)
    _log(session, record, "plan.planning", f"Planning {plan} for {record.robot}.", at)
    return record


def note(
    session: Session,
    plan: str,
    document: Mapping[str, Any],
    at: datetime,
    *,
    only_from: tuple[str, ...] | None = None,
    sha256: str | None = None,
) -> PlanRecord:
    """Write down more about a plan whose state does not change.

    Raises:
        PlanStateError: If it is not in one of ``only_from``; nothing is changed.
        UnknownIdError: If there is no such plan.
    """
    return _told(
        session,
        query.change_plan(
            session, plan, at=at, only_from=only_from, sha256=sha256, document=document
        ),
    )


def apply(
    session: Session,
    plan: str,
    evidence: PlanEvidence,
    text: str,
    at: datetime,
    *,
    sha256: str | None = None,
    document: Mapping[str, Any] | None = None,
) -> PlanRecord:
    """Move a plan as the table says, with the event, in the transaction of the evidence.

    Args:
        session: The transaction.
        plan: Id of the plan.
        evidence: What was proved.
        text: What the event says.
        at: When.
        sha256: Hash of the plan's canonical bytes, once it has one.
        document: Parts of the document that are new.

    Raises:
        PlanStateError: If it leads nowhere from the plan's state; nothing is changed.
        UnknownIdError: If there is no such plan.
    """
    before = query.get_plan(session, plan)
    step = TRANSITIONS.get((before.state, evidence))
    if step is None:
        raise PlanStateError(f"{plan} is {before.state.replace('_', ' ')}.")
    record = query.change_plan(
        session, plan, at=at, state=step.state, sha256=sha256, document=document
    )
    _log(session, record, step.event, text, at)
    return _told(session, record)


def _told(session: Session, plan: PlanRecord) -> PlanRecord:
    tell_after_commit(session, PlanChanged(plan), plan.id)
    return plan


def _log(session: Session, plan: PlanRecord, event: str, text: str, at: datetime) -> None:
    add_event(
        session,
        at,
        event,
        text,
        level=_LEVELS.get(plan.state, "info"),
        robot=plan.robot,
        data={"plan": plan.id, "mission": plan.mission, "sha256": plan.sha256},
    )
