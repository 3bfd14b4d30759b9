"""A plan on its way by satellite as a row: its state changes in the transaction that proves it."""

from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Final

from sqlalchemy.orm import Session

from db.query.mission.plans import PlanRecord, get_plan, list_plans
from db.query.mission.transfers import TransferRecord
from db.query.satellite import outbox as query
from db.query.satellite.outbox import CREATED, OutboxRecord
from db.query.satellite.satellite_messages import SatelliteMessage
from robot_link.messages import OnboardPlanState, PlanHash
from robot_link.satellite.blob import Blob, TransferId
from robot_link.satellite.chunk import cut
from robot_link.satellite.content import TransferAck, TransferState
from robot_link.station.ground import GroundState, GroundTransfer, PartLevel, next_counter
from server.plan.document import mission_of
from server.satellite.ending import end_row, told
from server.satellite.modem import Modem
from server.satellite.row_kind import Means, RobotSession, RowKind

HOLDS: Final = (OnboardPlanState.ON_BOARD, OnboardPlanState.RUNNING, OnboardPlanState.DONE)
PLAN_DIGITS: Final = 16
_MAY_WAIT: Final = ("draft", "sent", "waiting")
_LOOKED_AT: Final = 20
"""Newest plans of a robot among which one that waits is looked for."""
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
            return told(session, query.change_outbox(session, known.id, state="open"))
        return known
    before = query.newest_outbox(session, transfer.robot, "plan")
    counter = next_counter(query.newest_counter(session, transfer.robot), at)
    ground = GroundTransfer.begin(blob, counter, at, expires_at, start=transfer.start)
    row = query.add_outbox(
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
    return told(session, row)


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


def hold(session: Session, transfer: str) -> OutboxRecord | None:
    """Send nothing more of a transfer while something faster is tried; return its row."""
    row = query.outbox_of_transfer(session, transfer)
    if row is not None and row.state == "open":
        return query.change_outbox(session, row.id, state="held")
    return row


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


class PlanRows(RowKind):
    """Rows of plans, in as many parts as their bytes need."""

    name = "plan"

    def __init__(self, withdraw: Callable[[Session, OutboxRecord, datetime], object]) -> None:
        self._withdraw = withdraw
        """Has the robot refuse what is left of a plan."""

    def due(self, session: Session, row: OutboxRecord, now: datetime) -> tuple[int, ...]:
        """Return the parts that the robot is not known to have."""
        del session
        return tuple(ground_of(row).due(now))

    def pack(self, session: Session, row: OutboxRecord, means: Means) -> Sequence[bytes]:
        """Return the message of each part."""
        blob = Blob.of(mission_of(get_plan(session, row.document["plan"])))
        start, system = ground_of(row).start, means.modem.system
        return cut(blob, means.key, system, row.counter, start=start, ack_seen=means.ack_seen)

    def title(self, row: OutboxRecord, part: int) -> str:
        """Return which part of which plan it is."""
        return f"part {part + 1} of {len(ground_of(row).parts)} of {row.document['plan']}"

    def taken(
        self, session: Session, row: OutboxRecord, message: SatelliteMessage, at: datetime
    ) -> OutboxRecord:
        """Note that the gateway has a part."""
        sent = ground_of(row).sent(message.part, at, message.message_id, message.mtmsn)
        return keep(session, row, sent, at)

    def expired(self, session: Session, row: OutboxRecord, at: datetime) -> OutboxRecord:
        """Give a plan up whose time has passed, and have the robot refuse what is left of it."""
        row = keep(session, row, ground_of(row).expired(at), at)
        self._withdraw(session, row, at)
        return row

    def heard(self, session: Session, row: OutboxRecord, said: RobotSession) -> OutboxRecord:
        """Note what a session says of a plan.

        A session from before the transfer began proves nothing of it, whatever it says: gateways
        deliver late.
        """
        ground = ground_of(row)
        if said.session_at >= row.created_at:
            ground = ground.surfaced(said.session_at)
            if said.mtmsn is not None:
                ground = ground.taken(said.mtmsn, said.session_at)
            ground = with_words(ground, said)
        return keep(session, row, ground, said.arrived_at)

    def is_held(self, row: OutboxRecord, part: int) -> bool:
        """Tell whether the robot says that it has a part."""
        return ground_of(row).parts[part].is_held

    def is_told(self, row: OutboxRecord) -> bool:
        """Tell whether the robot said its last word, or never had to."""
        if row.ended_at is None:
            return False
        transfer = row.document["transfer"]
        never_left = row.level == CREATED and not any(part["sends"] for part in transfer["parts"])
        return row.state == "applied" or never_left or transfer["is_told"]

    def plan_of(self, session: Session, robot: str, transfer_id: TransferId) -> PlanHash | None:
        """Return the hash of the plan on its way to a robot that has this name."""
        return plan_of_transfer(session, robot, transfer_id, states=_MAY_WAIT)

    def fault_of(self, row: OutboxRecord) -> str:
        """Return what the operator calls it."""
        return row.document["plan"]


def plan_of_transfer(
    session: Session, robot: str, transfer_id: TransferId, *, states: tuple[str, ...] | None
) -> PlanHash | None:
    """Return the hash of the newest plan of a robot whose transfer has this name.

    Args:
        session: Where to read.
        robot: Whose plan.
        transfer_id: Its name.
        states: States that the plan may be in; ``None`` for any.
    """
    for plan in list_plans(session, robot=robot, states=states, limit=_LOOKED_AT):
        if plan.sha256 is None:
            continue
        try:
            is_it = Blob.of(mission_of(plan)).transfer_id == transfer_id
        except ValueError:  # too long for satellite
            continue
        if is_it:
            return PlanHash(plan.sha256)
    return None


def end_kept(session: Session, transfer: str, at: datetime) -> None:
    """End the row of a transfer whose plan the robot keeps waiting: it has every part."""
    row = query.outbox_of_transfer(session, transfer)
    if row is not None and row.ended_at is None:
        keep(session, row, ground_of(row).heard(_echo(ground_of(row)), at), at)


def with_words(ground: GroundTransfer, said: RobotSession) -> GroundTransfer:
    """Return how far a transfer is after the words of its robot."""
    for ack in said.acks:
        ground = ground.heard(ack, said.session_at)
    plan = said.plan
    if plan is not None and plan.state in HOLDS and plan.digits == ground.plan[:PLAN_DIGITS]:
        ground = ground.heard(_echo(ground), said.session_at)
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
