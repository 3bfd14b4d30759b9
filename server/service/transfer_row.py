"""Transfers as rows: how they are shown, and how they end in one transaction with their plan."""

from datetime import datetime

from sqlalchemy.orm import Session

from db.query import transfers as query
from db.query.plans import PlanRecord, change_plan, get_plan
from db.query.transfers import TransferRecord
from server.service.plan_ledger import note_change
from server.service.view.plan import TransferView


class WithdrawnError(Exception):
    """Someone ended the transfer; it must not do anything more."""


def check_open(session: Session, transfer: str) -> None:
    """Raise WithdrawnError if a transfer has ended."""
    if query.get_transfer(session, transfer).ended_at is not None:
        raise WithdrawnError


def withdraw_in(session: Session, robot: str, at: datetime, reason: str) -> None:
    """Withdraw the transfers to a robot, in the transaction of a surface order."""
    for transfer in query.open_transfers(session):
        if transfer.robot == robot:
            close(session, transfer, "withdrawn", reason, at)


def close(
    session: Session, transfer: TransferRecord, state: str, reason: str, at: datetime
) -> PlanRecord | None:
    """End a transfer that is open; a plan that had not arrived is a draft again."""
    if query.get_transfer(session, transfer.id).ended_at is not None:
        return None
    query.change_transfer(session, transfer.id, state=state, reason=reason, ended_at=at)
    plan = get_plan(session, transfer.plan)
    if plan.state != "sent":
        return change_plan(session, plan.id, at=at, document={"message": reason})
    message = f"Not confirmed on board: {reason}"
    draft = change_plan(session, plan.id, at=at, state="draft", document={"message": message})
    note_change(session, draft, at, f"{plan.id} is a draft again. {message}")
    return draft


def transfer_view(record: TransferRecord) -> TransferView:
    """Return a transfer as REST says it."""
    return TransferView(
        id=record.id,
        robot=record.robot,
        plan_id=record.plan,
        state=record.state,
        items_sent=record.items_sent,
        items=record.items,
        bytes=record.bytes,
        level=record.level,
        started_at=record.started_at,
        ended_at=record.ended_at,
        reason=record.reason,
    )
