"""A plan on its way by satellite as a row: its state changes in the transaction that proves it."""

from collections.abc import Iterable
from datetime import datetime
from typing import Final

from sqlalchemy.orm import Session

from db.query import outbox as query
from db.query.outbox import CREATED, OutboxRecord
from db.query.plans import PlanRecord
from db.query.transfers import TransferRecord
from robot_link.messages import OnboardPlanState
from robot_link.satellite.blob import Blob
from robot_link.satellite.content import ShortPlanReport, TransferAck, TransferState
from robot_link.station.ground import GroundState, GroundTransfer, PartLevel, next_counter
from server.satellite.ending import end_row
from server.satellite.modem import Modem

HOLDS: Final = (OnboardPlanState.ON_BOARD, OnboardPlanState.RUNNING, OnboardPlanState.DONE)
PLAN_DIGITS: Final = 16
_ENDS: Final = {
    GroundState.APPLIED: "applied",
    GroundState.REFUSED: "refused",
    GroundState.EXPIRED: "expired",
    GroundState.SUPERSEDED: "superseded",
    GroundState.WITHDRAWN: "withdrawn",
}


def begin_plan(
    session: Session,
    transfer: TransferRecord,
    plan: PlanRecord,
    blob: Blob,
    modem: Modem,
    *,
    at: datetime,
    expires_at: datetime,
) -> OutboxRecord:
    """Return the row of a transfer, added if it has none; nothing is sent yet.

    A transfer that went by radio for a while goes on where it stopped.
    """
    known = query.outbox_of_transfer(session, transfer.id)
    if known is not None:
        if known.ended_at is None and known.state == "held":
            return query.change_outbox(session, known.id, state="open")
        return known
    before = query.newest_outbox(session, transfer.robot, "plan")
    counter = next_counter(query.newest_counter(session, transfer.robot), at)
    ground = GroundTransfer.begin(blob, counter, at, expires_at, start=transfer.start)
    return query.add_outbox(
        session,
        transfer.robot,
        "plan",
        carrier=modem.carrier,
        imei=modem.imei,
        counter=counter,
        document={
            "plan": plan.id,
            "transfer": ground.to_document(),
            "flush": before is not None and before.state == "superseded",
            "is_forced": transfer.is_forced,
        },
        at=at,
        expires_at=expires_at,
        transfer=transfer.id,
    )


def ground_of(row: OutboxRecord) -> GroundTransfer:
    """Return how far the transfer of a row is."""
    return GroundTransfer.from_document(row.document["transfer"])


def keep(session: Session, row: OutboxRecord, ground: GroundTransfer, at: datetime) -> OutboxRecord:
    """Write down how far a transfer is; a row that has ended stays as it ended."""
    if row.ended_at is not None:
        return row
    end, document = _ENDS.get(ground.state), {**row.document, "transfer": ground.to_document()}
    if end is None:
        return query.change_outbox(session, row.id, document=document, level=_level(ground))
    reason = _reason(row, ground)
    return end_row(session, row.id, end, reason, at, document=document, level=_level(ground))


def hold(session: Session, transfer: str) -> None:
    """Send nothing more of a transfer while something faster is tried."""
    row = query.outbox_of_transfer(session, transfer)
    if row is not None and row.state == "open":
        query.change_outbox(session, row.id, state="held")


def refuse(session: Session, row: OutboxRecord, reason: str, at: datetime) -> OutboxRecord:
    """End a transfer that the gateway will never take."""
    if row.ended_at is not None:
        return row
    return end_row(session, row.id, "refused", reason, at)


def end_with_transfer(
    session: Session, row: OutboxRecord, state: str, reason: str, at: datetime
) -> None:
    """End the row of a transfer that ended otherwise, such as by radio or by its operator."""
    if row.ended_at is not None:
        return
    ground = ground_of(row)
    if state == "withdrawn":
        ground = ground.withdrawn(at)
    elif state == "superseded":
        ground = ground.superseded(at)
    kept = keep(session, row, ground, at)
    if kept.ended_at is None:
        end_row(session, row.id, state, reason, at)
    else:
        query.change_outbox(session, row.id, reason=reason)


def hear(
    row: OutboxRecord,
    acks: Iterable[TransferAck],
    plan: ShortPlanReport | None,
    mtmsn: int | None,
    session_at: datetime,
) -> GroundTransfer:
    """Return how far a transfer is after a session of its robot.

    A session from before the transfer began proves nothing of it, whatever it says: gateways
    deliver late.
    """
    ground = ground_of(row)
    if session_at < row.created_at:
        return ground
    ground = ground.surfaced(session_at)
    if mtmsn is not None:
        ground = ground.taken(mtmsn, session_at)
    return _with_words(ground, acks, plan, session_at)


def heard(
    row: OutboxRecord,
    acks: Iterable[TransferAck],
    plan: ShortPlanReport | None,
    session_at: datetime,
) -> GroundTransfer:
    """Return how far a transfer that was given up is after the words of its robot."""
    return _with_words(ground_of(row), acks, plan, session_at)


def _with_words(
    ground: GroundTransfer,
    acks: Iterable[TransferAck],
    plan: ShortPlanReport | None,
    session_at: datetime,
) -> GroundTransfer:
    for ack in acks:
        ground = ground.heard(ack, session_at)
    if plan is not None and plan.state in HOLDS and plan.digits == ground.plan[:PLAN_DIGITS]:
        ground = ground.heard(_echo(ground), session_at)
    return ground


def _echo(ground: GroundTransfer) -> TransferAck:
    """Return the acknowledgement that the echoed hash of a plan amounts to."""
    count = len(ground.parts)
    everything = frozenset(range(count))
    return TransferAck(ground.transfer_id, count, everything, TransferState.APPLIED)


def _level(ground: GroundTransfer) -> str:
    if ground.state is GroundState.APPLIED:
        return "applied"
    levels = {part.level for part in ground.parts}
    if PartLevel.WAITING in levels:
        return CREATED
    return "queued" if PartLevel.QUEUED in levels else "radio"


def _reason(row: OutboxRecord, ground: GroundTransfer) -> str:
    match ground.state:
        case GroundState.REFUSED:
            return f"{row.robot} refused it: {ground.reason or 'it gave no reason'}"
        case GroundState.EXPIRED:
            return f"{row.robot} did not confirm it before it expired"
        case _:
            return ground.reason
