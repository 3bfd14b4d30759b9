"""The word that keeps an abandoned plan from coming alive: a gateway may hold parts for days."""

from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.orm import Session

from db.query import outbox as query
from db.query.outbox import OutboxRecord
from db.query.satellite_messages import messages_of
from robot_link.satellite.ground import next_counter
from robot_link.satellite.withdrawal import pack_withdrawal
from server.service.satellite.modem import Modem

_LIFE: Final = timedelta(days=5)
"""A gateway keeps nothing longer, so nothing is left to be refused."""
_LEFT: Final = ("taken", "radio", "unknown")


def begin_withdrawal(session: Session, plan: OutboxRecord, at: datetime) -> OutboxRecord | None:
    """Add the word that a plan is withdrawn, if a gateway has or may have anything of it.

    It goes with the order to empty the robot's queue, and has the robot refuse what it fetched
    before; the mission on board stays.
    """
    if not any(one.state in _LEFT for one in messages_of(session, plan.id)):
        return None
    return query.add_outbox(
        session,
        plan.robot,
        "withdrawal",
        carrier=plan.carrier,
        imei=plan.imei,
        counter=next_counter(query.newest_counter(session, plan.robot), at),
        document={"kind": "withdrawal", "withdraws": plan.id, "flush": True, "sends": 0},
        at=at,
        expires_at=at + _LIFE,
    )


def withdrawal_bytes(row: OutboxRecord, key: bytes, modem: Modem, *, ack_seen: bool) -> bytes:
    """Return the message that withdraws every plan before it."""
    return pack_withdrawal(row.counter, key, modem.system, ack_seen=ack_seen)
