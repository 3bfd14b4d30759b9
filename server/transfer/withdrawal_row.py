"""The word that keeps an abandoned plan from coming alive: a gateway may hold parts for days.

A robot that refused something answers; one to which nothing of the plan came has nothing to say.
So the word is said a few times, unless the robot or the network proves that it came.
"""

from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.orm import Session

from db.query.satellite import outbox as query
from db.query.satellite.outbox import OutboxRecord
from db.query.satellite.satellite_messages import SatelliteMessage, messages_of
from robot_link.satellite.withdrawal import pack_withdrawal
from robot_link.station.ground import GroundState, GroundTransfer, next_counter
from server.command.satellite_row import is_surface
from server.fleet.words import carrier_title
from server.satellite import repeating
from server.satellite.ending import end_row, told
from server.satellite.row_kind import Means, RobotSession, RowKind
from server.transfer import plan_row

_LIFE: Final = timedelta(days=5)
"""A gateway keeps nothing longer, so nothing is left to be refused."""
_LEFT: Final = ("taken", "radio", "unknown")
_SENDS_MAX: Final = 3


def begin_withdrawal(session: Session, plan: OutboxRecord, at: datetime) -> OutboxRecord | None:
    """Add the word that a plan is withdrawn, if a gateway has or may have anything of it.

    Nor may an older plan come alive whose place it had taken. It asks the gateway to empty
    the robot's queue, and has the robot refuse what it fetched before; the mission on board stays.
    """
    left = [one.counter for one in _given_up(session, plan, at) if _has_left(session, one, at)]
    if not left:
        return None
    said = query.newest_outbox(session, plan.robot, "withdrawal")
    if said is not None and said.imei == plan.imei and said.counter > max(left):
        return None
    row = query.add_outbox(
        session,
        plan.robot,
        "withdrawal",
        carrier=plan.carrier,
        imei=plan.imei,
        counter=next_counter(query.newest_counter(session, plan.robot), at),
        document={
            "kind": "withdrawal",
            "withdraws": plan.id,
            "flush": True,
            **repeating.not_sent(),
        },
        at=at,
        expires_at=at + _LIFE,
    )
    return told(session, row)


class WithdrawalRows(RowKind):
    """Rows of words that withdraw, which have one part."""

    name = "withdrawal"

    def due(self, session: Session, row: OutboxRecord, now: datetime) -> tuple[int, ...]:
        """Return the one part, but not while a command to surface is on its way: it says it too."""
        del now
        if row.document["sends"] >= _SENDS_MAX or not repeating.is_due(row.document):
            return ()
        is_said = any(
            is_surface(one) and one.imei == row.imei and one.counter > row.counter
            for one in query.open_outbox(session, row.robot)
        )
        return () if is_said else (0,)

    def pack(self, session: Session, row: OutboxRecord, means: Means) -> Sequence[bytes]:
        """Return the message that withdraws every plan before it."""
        del session
        return (
            pack_withdrawal(row.counter, means.key, means.modem.system, ack_seen=means.ack_seen),
        )

    def title(self, row: OutboxRecord, part: int) -> str:
        """Return what the message is."""
        del row, part
        return "the word that withdraws what is still on its way"

    def taken(
        self, session: Session, row: OutboxRecord, message: SatelliteMessage, at: datetime
    ) -> OutboxRecord:
        """Note that a gateway took it, which does not say that the robot will hear it."""
        del message, at
        level = "queued" if row.level == query.CREATED else row.level
        document = repeating.sent(row.document)
        return query.change_outbox(session, row.id, document=document, level=level)

    def fetched(self, session: Session, row: OutboxRecord, at: datetime) -> OutboxRecord:
        """Note that the robot's modem fetched it."""
        if row.ended_at is not None:
            return row
        reason = f"{row.robot}'s modem fetched it"
        return end_row(session, row.id, "sent", reason, at, level="radio")

    def expired(self, session: Session, row: OutboxRecord, at: datetime) -> OutboxRecord:
        """End what nothing is left of that could be refused."""
        reason = "no gateway holds anything of it any more"
        return end_row(session, row.id, "expired", reason, at)

    def heard(self, session: Session, row: OutboxRecord, said: RobotSession) -> OutboxRecord:
        """Note a session of the robot, and its last word on the plan if it brings one."""
        at = said.session_at
        if at < row.created_at:
            return row
        if _surfaced_since(session, row):
            reason = f"the order to surface said it too, and {row.robot} heard that"
            return end_row(session, row.id, "superseded", reason, at)
        withdrawn = query.get_outbox(session, row.document["withdraws"])
        ground = plan_row.with_words(plan_row.ground_of(withdrawn), said)
        if ground.is_told:
            return _told(session, row, withdrawn, ground, at)
        document = repeating.surfaced(row.document, at)
        if document["sends"] >= _SENDS_MAX and repeating.is_due(document):
            reason = f"said {_SENDS_MAX} times; {row.robot} had nothing to answer"
            return end_row(session, row.id, "sent", reason, at, document=document)
        if document == row.document:
            return row
        return query.change_outbox(session, row.id, document=document)

    def is_exempt(self, row: OutboxRecord) -> bool:
        """No budget holds it back."""
        del row
        return True


def _told(
    session: Session,
    row: OutboxRecord,
    withdrawn: OutboxRecord,
    ground: GroundTransfer,
    at: datetime,
) -> OutboxRecord:
    """End it: the robot has said its last word on the plan."""
    document = {**withdrawn.document, "transfer": ground.to_document()}
    query.change_outbox(session, withdrawn.id, document=document)
    if ground.state is GroundState.APPLIED:
        reason = f"{row.robot} has it on board already"
        return end_row(session, row.id, "sent", reason, at)
    return end_row(session, row.id, "applied", f"{row.robot} refuses it", at, level="applied")


def called_back(session: Session, plan: OutboxRecord) -> str:
    """Say what is known of the word that withdraws a plan; "" if there is none to be said."""
    said = next(
        (
            one
            for one in query.newest_outboxes(session, plan.robot, "withdrawal", plan.created_at)
            if one.document["withdraws"] == plan.id
        ),
        None,
    )
    if said is None:
        return ""
    robot, gateway = plan.robot, carrier_title(plan.carrier)
    if said.state == "applied":
        return f"{robot} refuses what is left of it."
    if said.level == "radio":
        return f"{robot}'s modem fetched the word that withdraws what is left of it."
    if said.ended_at is None and not said.document["sends"]:
        return (
            f"Parts of it may still lie at {gateway}; the word that withdraws them has not left "
            "the station."
        )
    if said.ended_at is None:
        return (
            f"Parts of it may still reach {robot}; {gateway} took the word that withdraws them, "
            f"and {robot} has not been heard to have it."
        )
    return f"The word that withdraws what was left of it ended: {said.reason}."


def _given_up(session: Session, plan: OutboxRecord, at: datetime) -> Iterator[OutboxRecord]:
    """Yield the plans that a modem was sent part of and must not fly any more."""
    for row in query.newest_outboxes(session, plan.robot, "plan", at - 2 * _LIFE):
        if row.imei != plan.imei or row.ended_at is None:
            continue
        if row.state == "applied":  # a robot refuses what is older than the plan on board
            return
        if not plan_row.ground_of(row).is_told:
            yield row


def _has_left(session: Session, row: OutboxRecord, at: datetime) -> bool:
    return any(
        one.state in _LEFT and (one.queued_at or one.created_at) > at - _LIFE
        for one in messages_of(session, row.id)
    )


def _surfaced_since(session: Session, row: OutboxRecord) -> bool:
    newest = query.newest_outboxes(session, row.robot, "order", row.created_at)
    return any(
        is_surface(one)
        and one.imei == row.imei
        and one.counter > row.counter
        and one.level in ("radio", "applied")
        for one in newest
    )
