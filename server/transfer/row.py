"""Transfers as rows: they end in one transaction with their plan and what is still to be sent."""

from datetime import datetime

from sqlalchemy.orm import Session

from db.query import transfers as query
from db.query.outbox import outbox_of_transfer
from db.query.plans import PlanRecord, change_plan, get_plan
from db.query.transfers import TransferRecord
from server.plan.ledger import note_change
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
    plan_state: str,
    text: str,
    at: datetime,
    *,
    only_from: tuple[str, ...],
    **changes: object,
) -> PlanRecord | None:
    """Write down how far an open transfer is, and bring its plan into a state.

    Args:
        session: The transaction.
        transfer: Which.
        plan_state: What its plan becomes, unless it is further already.
        text: What the event says.
        at: When.
        only_from: States that the plan may leave.
        **changes: What is new of the transfer.

    Raises:
        WithdrawnError: If someone ended the transfer; nothing is changed.
    """
    proceed(session, transfer.id, **changes)
    if get_plan(session, transfer.plan).state not in only_from:
        return None
    plan = change_plan(session, transfer.plan, at=at, state=plan_state)
    note_change(session, plan, at, text)
    return plan


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
    if plan.state != "sent":
        return change_plan(session, plan.id, at=at, document={"message": reason})
    message = f"Not confirmed on board: {reason}"
    draft = change_plan(session, plan.id, at=at, state="draft", document={"message": message})
    note_change(session, draft, at, f"{plan.id} is a draft again. {message}")
    return draft


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
