"""Which messages are to be sent now, and their rows: written down before the first byte leaves."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.identity import key_of
from db.link_tables import OutboxRow
from db.query import outbox as outbox_query
from db.query import satellite_messages as query
from db.query.outbox import CREATED, OutboxRecord
from db.query.plans import get_plan
from db.query.robots import robot_key
from db.query.satellite_messages import SENDING
from robot_link.satellite.blob import Blob
from robot_link.satellite.chunk import cut
from robot_link.satellite.config import Tariff
from robot_link.satellite.cost import credits
from server.plan.document import mission_of
from server.satellite import order_row, plan_row, withdrawal_row
from server.satellite.budget import budget_of
from server.satellite.ending import end_row
from server.satellite.modem import Modem

_FORGOTTEN: Final = timedelta(days=10)
"""What is older than this cannot be in any queue, nor can the robot's word on it."""


@dataclass(frozen=True, slots=True)
class Means:
    """What sending to one robot takes."""

    modem: Modem
    key: bytes
    tariff: Tariff


@dataclass(frozen=True, slots=True)
class Looked:
    """What came of a look at a row."""

    waits: str = ""
    """Why something that is due is not sent; empty if nothing waits."""
    is_over_budget: bool = False


def needs_work(session: Session, row: OutboxRecord, now: datetime) -> bool:
    """Tell, without changing anything, whether a row has something to send or has expired."""
    if now >= row.expires_at:
        return True
    return bool(_due(session, row, now))


def expire(session: Session, outbox: str, now: datetime) -> OutboxRecord:
    """End a row whose time has passed; nothing of it is sent any more."""
    row = outbox_query.get_outbox(session, outbox)
    if row.ended_at is not None or now < row.expires_at:
        return row
    if row.kind == "plan":
        row = plan_row.keep(session, row, plan_row.ground_of(row).expired(now), now)
        withdrawal_row.begin_withdrawal(session, row, now)
        return row
    if row.kind == "order":
        return order_row.expired(session, row, now)
    return end_row(session, outbox, "expired", "no gateway holds anything of it any more", now)


def prepare(session: Session, outbox: str, means: Means, now: datetime) -> Looked:
    """Add the messages that are due, as far as today's budget allows."""
    row = outbox_query.get_outbox(session, outbox)
    if row.ended_at is not None or row.state != "open":
        return Looked()
    due = _due(session, row, now)
    if not due:
        return Looked()
    texts = _bytes(session, row, means)
    for index in due:
        data = texts[index]
        cost = credits(len(data), means.tariff)
        budget = budget_of(session, row.robot, means.tariff, now)
        if not _is_exempt(row) and not budget.allows(cost):
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
            priority=_priority(row),
        )
    return Looked()


def _due(session: Session, row: OutboxRecord, now: datetime) -> tuple[int, ...]:
    if row.ended_at is not None or row.state != "open":
        return ()
    sending = {one.part for one in query.messages_of(session, row.id) if one.state == SENDING}
    if row.kind == "plan":
        return tuple(i for i in plan_row.ground_of(row).due(now) if i not in sending)
    if sending:
        return ()
    is_order = row.kind == "order"
    is_due = order_row.is_due(row) if is_order else withdrawal_row.is_due(session, row)
    return (0,) if is_due else ()


def _bytes(session: Session, row: OutboxRecord, means: Means) -> tuple[bytes, ...]:
    ack_seen = _ack_seen(session, row)
    if row.kind == "order":
        return (order_row.order_bytes(row, means.key, means.modem, ack_seen=ack_seen),)
    if row.kind == "withdrawal":
        return (withdrawal_row.withdrawal_bytes(row, means.key, means.modem, ack_seen=ack_seen),)
    blob = Blob.of(mission_of(get_plan(session, row.document["plan"])))
    return cut(
        blob,
        means.key,
        means.modem.system,
        row.counter,
        start=plan_row.ground_of(row).start,
        ack_seen=ack_seen,
    )


def _ack_seen(session: Session, row: OutboxRecord) -> bool:
    """Tell whether the robot need not repeat its word on anything from before this row."""
    earlier = session.scalars(
        select(OutboxRow).where(
            OutboxRow.robot_key == robot_key(session, row.robot),
            OutboxRow.key < key_of("outbox", row.id),
            OutboxRow.created_at > row.created_at - _FORGOTTEN,
        )
    )
    return all(_is_over(one) for one in earlier)


def _is_over(row: OutboxRow) -> bool:
    if row.state == "applied" or (row.kind != "plan" and row.ended_at is not None):
        return True
    if row.ended_at is None:
        return False
    transfer = row.document["transfer"]
    never_left = row.level == CREATED and not any(part["sends"] for part in transfer["parts"])
    return never_left or transfer["is_told"]


def _priority(row: OutboxRecord) -> int:
    if order_row.is_surface(row):
        return order_row.SURFACE_PRIORITY
    return order_row.ORDER_PRIORITY if row.kind == "order" else 5


def _is_exempt(row: OutboxRecord) -> bool:
    """Tell whether no budget holds a row back: it keeps a robot at the surface."""
    return order_row.is_surface(row) or row.kind == "withdrawal"
