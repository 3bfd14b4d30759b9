"""Transfers as rows: they end in one transaction with their plan and what is still to be sent."""

from datetime import datetime

from sqlalchemy.orm import Session

from db.query import transfers as query
from db.query.outbox import outbox_of_transfer
from db.query.plans import PlanRecord, change_plan, get_plan
from db.query.transfers import TransferRecord
from server.plan.state import PlanEvidence, apply, leads_on
from server.satellite import plan_row, withdrawal_row


class WithdrawnError(Exception):
    """Someone ended the transfer; it must not do anything more."""


def check_open(session: Session, transfer: str) -> None:
    """Raise WithdrawnError if a transfer has ended."""
    if query.get_transfer(session, transfer).ended_at is not None:
        raise WithdrawnError


def proceed(session: Session, transfer: str, **changes: object) -> None:
    """Write down how far an open transfer is.

    Raises:
        WithdrawnError: If someone ended it; nothing is changed.
    """
    check_open(session, transfer)
    query.change_transfer(session, transfer, **changes)


def proceed_with_plan(
    session: Session,
    transfer: TransferRecord,
    evidence: PlanEvidence,
    text: str,
    at: datetime,
    **changes: object,
) -> PlanRecord | None:
    """Write down how far an open transfer is, and what that proves of its plan.

    Args:
        session: The transaction.
        transfer: Which.
        evidence: What it proves, unless the plan is further already.
        text: What the event says.
        at: When.
        **changes: What is new of the transfer.

    Raises:
        WithdrawnError: If someone ended the transfer; nothing is changed.
    """
    proceed(session, transfer.id, **changes)
    if not leads_on(get_plan(session, transfer.plan).state, evidence):
        return None
    return apply(session, transfer.plan, evidence, text, at)


def withdraw_in(session: Session, robot: str, at: datetime, reason: str) -> None:
    """Withdraw the transfers to a robot, in the transaction of a surface order.

    Where the order goes by satellite too, it does itself what the word that calls back does.
    """
    close_all(session, robot, "withdrawn", reason, at, calls_back=True)


def close_all(
    session: Session, robot: str, state: str, reason: str, at: datetime, *, calls_back: bool
) -> None:
    """End every open transfer to a robot; see ``close``."""
    for transfer in query.open_transfers(session):
        if transfer.robot == robot:
            close(session, transfer, state, reason, at, calls_back=calls_back)


def close(
    session: Session,
    transfer: TransferRecord,
    state: str,
    reason: str,
    at: datetime,
    *,
    calls_back: bool = False,
) -> PlanRecord | None:
    """End a transfer that is open; a plan that had not arrived is a draft again.

    Args:
        session: The transaction.
        transfer: Which.
        state: How it ended.
        reason: Why, for the operator.
        at: When.
        calls_back: Whether the robot is told by satellite to refuse what a gateway has of it.
    """
    if query.get_transfer(session, transfer.id).ended_at is not None:
        return None
    query.change_transfer(session, transfer.id, state=state, reason=reason, ended_at=at)
    end_by_satellite(session, transfer.id, state, reason, at, calls_back=calls_back)
    plan = get_plan(session, transfer.plan)
    ended = PlanEvidence.TRANSFER_ENDED
    if not leads_on(plan.state, ended):
        return change_plan(session, plan.id, at=at, document={"message": reason})
    message = f"Not confirmed on board: {reason}"
    text = f"{plan.id} is a draft again. {message}"
    return apply(session, plan.id, ended, text, at, document={"message": message})


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
