"""The state of a transfer: nothing moves it but what was proved of it, by this table.

=========================================  ==============  ==========  =======
state                                      evidence        becomes     and
=========================================  ==============  ==========  =======
waiting, sending, kept, on_board           first bytes     sending     goes on
waiting, sending                           robot keeps it  kept        goes on
waiting, sending, kept                     robot has it    on_board    goes on
kept, on_board                             robot flies it  running     goes on
kept                                       finished        kept        ends
on_board                                   finished        on_board    ends
running                                    finished        running     ends
waiting, sending, kept, on_board, running  failed          failed      ends
waiting, sending, kept, on_board, running  withdrawn       withdrawn   ends
waiting, sending, kept, on_board, running  superseded      superseded  ends
=========================================  ==============  ==========  =======

One that has ended takes no evidence. What is proved of a transfer is proved of its plan too, in the
same transaction: ``first bytes`` sends it, ``robot keeps it`` has it wait on board behind the plan
being flown, ``robot has it`` confirms it on board, and an end before that makes it a draft again
(``server.plan.state``). What is still to be sent by satellite ends with the transfer.
"""

from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import StrEnum
from typing import Final

from sqlalchemy.orm import Session

from db.query.mission import transfers as query
from db.query.mission.plans import get_plan
from db.query.mission.transfers import TransferRecord
from db.query.satellite.outbox import outbox_of_transfer
from server.base.transition_table import transitions
from server.command.state import SurfaceOrdered
from server.plan import state as plan_state
from server.plan.state import PlanEvidence, leads_on
from server.plan.view import TransferView
from server.transfer import plan_row, withdrawal_row

RADIO_LIFE: Final = timedelta(hours=24)
"""A transfer by radio that found no contact for this long, by the robots' clock, is given up."""


class TransferEvidence(StrEnum):
    """What can be proved of a transfer."""

    FIRST_BYTES = "first bytes"
    """A radio or a gateway took the first bytes."""
    ROBOT_KEEPS_IT = "robot keeps it"
    """The robot named its hash as the one that waits behind the plan that it flies."""
    ROBOT_HAS_IT = "robot has it"
    """The robot echoed the hash, by whichever link."""
    ROBOT_FLIES_IT = "robot flies it"
    FINISHED = "finished"
    """The plan is where the transfer was to bring it."""
    FAILED = "failed"
    WITHDRAWN = "withdrawn"
    SUPERSEDED = "superseded"


TRANSITIONS = transitions(__doc__, TransferEvidence)
_OF_PLAN = {
    TransferEvidence.FIRST_BYTES: PlanEvidence.SENT,
    TransferEvidence.ROBOT_KEEPS_IT: PlanEvidence.ROBOT_KEEPS_IT,
    TransferEvidence.ROBOT_HAS_IT: PlanEvidence.CONFIRMED,
}


@dataclass(frozen=True, slots=True)
class TransferChanged:
    """A transfer began, moved or ended; published after the commit."""

    transfer: TransferView


@dataclass(frozen=True, slots=True)
class TransferFailed:
    """A plan did not get on board or did not start, or a person withdrew it."""

    plan: str
    reason: str


class WithdrawnError(Exception):
    """Someone ended the transfer; it must not do anything more."""


def check_open(session: Session, transfer: str) -> TransferRecord:
    """Return a transfer as it is now; raise WithdrawnError if it has ended."""
    found = query.get_transfer(session, transfer)
    if found.ended_at is not None:
        raise WithdrawnError
    return found


def note(session: Session, transfer: str, **changes: object) -> None:
    """Write down more about an open transfer whose state does not change.

    Raises:
        WithdrawnError: If someone ended it; nothing is changed.
    """
    check_open(session, transfer)
    query.change_transfer(session, transfer, **changes)


def apply(
    session: Session,
    transfer: str,
    evidence: TransferEvidence,
    at: datetime,
    text: str = "",
    **changes: object,
) -> None:
    """Move an open transfer as the table says, and its plan by what that proves of it.

    Args:
        session: The transaction.
        transfer: Which.
        evidence: What was proved; it changes nothing if the transfer is further already.
        at: When.
        text: What the event of the plan says.
        **changes: What else is new of the transfer.

    Raises:
        WithdrawnError: If someone ended the transfer; nothing is changed.
    """
    before = check_open(session, transfer)
    step = TRANSITIONS.get((before.state, evidence))
    if step is None:
        return
    if step.event == "ends":
        changes["ended_at"] = at
    query.change_transfer(session, transfer, state=step.state, **changes)
    proved = _OF_PLAN.get(evidence)
    if proved is not None and leads_on(get_plan(session, before.plan).state, proved):
        plan_state.apply(session, before.plan, proved, text, at)
    if evidence is TransferEvidence.ROBOT_KEEPS_IT:
        plan_row.end_kept(session, transfer, at)


def withdraw_for(session: Session, event: SurfaceOrdered) -> None:
    """Withdraw the transfers to a robot, in the transaction of a command to surface.

    Where that goes by satellite too, it does itself what the word that calls back does.
    """
    withdrawn = TransferEvidence.WITHDRAWN
    close_all(session, event.robot, withdrawn, event.reason, event.at, calls_back=True)


def close_all(
    session: Session,
    robot: str,
    evidence: TransferEvidence,
    reason: str,
    at: datetime,
    *,
    calls_back: bool,
) -> None:
    """End every open transfer to a robot; see ``close``."""
    for transfer in query.open_transfers(session):
        if transfer.robot == robot:
            close(session, transfer.id, evidence, reason, at, calls_back=calls_back)


def close(
    session: Session,
    transfer: str,
    evidence: TransferEvidence,
    reason: str,
    at: datetime,
    *,
    calls_back: bool,
) -> None:
    """End a transfer that is open before its time; a plan that had not arrived is a draft again.

    Args:
        session: The transaction.
        transfer: Which.
        evidence: What ends it.
        reason: Why, for the operator.
        at: When.
        calls_back: Whether the robot is told by satellite to refuse what a gateway has of it.
    """
    before = query.get_transfer(session, transfer)
    if before.ended_at is not None:
        return
    apply(session, transfer, evidence, at, reason=reason)
    end_by_satellite(session, transfer, evidence.value, reason, at, calls_back=calls_back)
    ended = PlanEvidence.TRANSFER_ENDED
    if not leads_on(get_plan(session, before.plan).state, ended):
        plan_state.note(session, before.plan, {"message": reason}, at)
        return
    message = f"Not confirmed on board: {reason}"
    text = f"{before.plan} is a draft again. {message}"
    document = {"message": message}
    plan_state.apply(session, before.plan, ended, text, at, document=document)


def finish(session: Session, transfer: str, at: datetime) -> None:
    """End a transfer that did what it was to do.

    Raises:
        WithdrawnError: If someone ended it; nothing is changed.
    """
    apply(session, transfer, TransferEvidence.FINISHED, at)
    end_by_satellite(session, transfer, "superseded", "it is on board already", at, calls_back=True)


def end_by_satellite(
    session: Session, transfer: str, state: str, reason: str, at: datetime, *, calls_back: bool
) -> None:
    """Send nothing more of a transfer by satellite, in the transaction that ends it."""
    row = outbox_of_transfer(session, transfer)
    if row is None:
        return
    plan_row.end_with_transfer(session, row, state, reason, at)
    if calls_back:
        withdrawal_row.begin_withdrawal(session, row, at)
