"""Which messages are to be sent now, and their rows: written down before the first byte leaves."""

from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.orm import Session

from db.query.satellite import outbox as outbox_query
from db.query.satellite import satellite_messages as query
from db.query.satellite.outbox import OutboxRecord
from db.query.satellite.satellite_messages import SENDING
from robot_link.satellite.cost import credits
from server.satellite.budget import budget_of
from server.satellite.row_kind import Means, RowKinds

_FORGOTTEN: Final = timedelta(days=10)
"""What is older than this cannot be in any queue, nor can the robot's word on it."""


@dataclass(frozen=True, slots=True)
class Looked:
    """What came of a look at a row."""

    waits: str = ""
    """Why something that is due is not sent; empty if nothing waits."""
    is_over_budget: bool = False


def needs_work(session: Session, kinds: RowKinds, row: OutboxRecord, now: datetime) -> bool:
    """Tell, without changing anything, whether a row has something to send or has expired."""
    if now >= row.expires_at:
        return True
    return bool(_due(session, kinds, row, now))


def expire(session: Session, kinds: RowKinds, outbox: str, now: datetime) -> OutboxRecord:
    """End a row whose time has passed; nothing of it is sent any more."""
    row = outbox_query.get_outbox(session, outbox)
    if row.ended_at is not None or now < row.expires_at:
        return row
    return kinds.of(row).expired(session, row, now)


def prepare(session: Session, kinds: RowKinds, outbox: str, means: Means, now: datetime) -> Looked:
    """Add the messages that are due, as far as today's budget allows."""
    row = outbox_query.get_outbox(session, outbox)
    if row.ended_at is not None or row.state != "open":
        return Looked()
    due = _due(session, kinds, row, now)
    if not due:
        return Looked()
    kind = kinds.of(row)
    means = replace(means, ack_seen=_ack_seen(session, kinds, row))
    parts = kind.pack(session, row, means)
    for index in due:
        data = parts[index]
        cost = credits(len(data), means.tariff)
        budget = budget_of(session, row.robot, means.tariff, now)
        if not kind.is_exempt(row) and not budget.allows(cost):
            return Looked(
                f"Today's budget of {budget.per_day} credits is spent ({budget.spent} used, "
                f"{cost} more needed); it goes on at 00:00Z, or with a greater budget.",
                is_over_budget=True,
            )
        query.add_message(
            session,
            row.id,
            row.robot,
            part=index,
            carrier=row.carrier,
            imei=row.imei,
            data=data,
            cost=cost,
            at=now,
            flush=bool(row.document.get("flush")) and not query.messages_of(session, row.id),
            priority=kind.priority(row),
        )
    return Looked()


def _due(session: Session, kinds: RowKinds, row: OutboxRecord, now: datetime) -> tuple[int, ...]:
    if row.ended_at is not None or row.state != "open":
        return ()
    sending = {one.part for one in query.messages_of(session, row.id) if one.state == SENDING}
    return tuple(part for part in kinds.of(row).due(session, row, now) if part not in sending)


def _ack_seen(session: Session, kinds: RowKinds, row: OutboxRecord) -> bool:
    """Tell whether the robot need not repeat its word on anything from before this row."""
    earlier = outbox_query.outboxes_before(session, row, row.created_at - _FORGOTTEN)
    return all(kinds.of(one).is_told(one) for one in earlier)
