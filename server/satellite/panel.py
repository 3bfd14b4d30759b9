"""A robot's satellite link as an operator sees it: budget, and each message out and in."""

from collections.abc import Sequence
from datetime import datetime
from types import MappingProxyType
from typing import Final

from sqlalchemy.orm import Session

from db.query.satellite.inbox import InboxRecord, inbox_of, inbox_sizes
from db.query.satellite.outbox import OutboxRecord, get_outbox
from db.query.satellite.satellite_messages import SatelliteMessage, messages_to
from robot_link.satellite.config import Tariff
from robot_link.satellite.cost import credits
from server.fleet.link_view import IncomingMessageView, OutgoingMessageView, SatelliteView
from server.fleet.status import RobotStatus
from server.fleet.words import carrier_title
from server.satellite.account import settings_of
from server.satellite.budget import budget_of
from server.satellite.message_row import title
from server.satellite.modem import modems_of
from server.satellite.row_kind import RowKinds

_ENDS: Final = MappingProxyType(
    {
        "applied": "answered by another link",
        "expired": "too old",
        "withdrawn": "withdrawn",
        "superseded": "no longer needed",
    }
)
"""How a row ended, in a sentence about one of its messages."""


def satellite_view(
    session: Session, kinds: RowKinds, status: RobotStatus, now: datetime, limit: int
) -> SatelliteView:
    """Return a robot's budget and its newest messages; one without a modem has none."""
    robot = status.record.id
    modem = next(iter(modems_of(status.record)), None)
    tariff = settings_of(session, robot).satellite.tariff
    budget = budget_of(session, robot, tariff, now)
    midnight = now.replace(hour=0, minute=0, second=0, microsecond=0)
    known = status.satellite
    return SatelliteView(
        imei=None if modem is None else modem.imei,
        carrier="" if modem is None else modem.carrier,
        credits_today=budget.spent,
        credits_per_day=budget.per_day,
        credits_left=budget.left,
        credits_heard_today=sum(
            credits(size, tariff) for size in inbox_sizes(session, robot, since=midnight)
        ),
        next_session_at=None if known is None else known.next_session_at,
        outgoing=_outgoing_views(session, kinds, messages_to(session, robot, limit)),
        incoming=[_incoming(one, tariff) for one in inbox_of(session, robot, limit)],
    )


def _outgoing_views(
    session: Session, kinds: RowKinds, messages: Sequence[SatelliteMessage]
) -> list[OutgoingMessageView]:
    """Return what became of each message, the newest first."""
    rows = {one: get_outbox(session, one) for one in {message.outbox for message in messages}}
    said_again: set[tuple[str, int]] = set()
    views: list[OutgoingMessageView] = []
    for message in messages:
        place = (message.outbox, message.part)
        views.append(
            _outgoing(kinds, rows[message.outbox], message, is_last=place not in said_again)
        )
        said_again.add(place)
    return views


def _outgoing(
    kinds: RowKinds, row: OutboxRecord, message: SatelliteMessage, *, is_last: bool
) -> OutgoingMessageView:
    return OutgoingMessageView(
        at=message.created_at,
        kind=message.kind,
        bytes=len(message.data),
        credits=message.credits,
        state=message.state,
        message_id=message.message_id or None,
        mtmsn=message.mtmsn,
        text=_outgoing_text(kinds, row, message, is_last=is_last),
    )


def _outgoing_text(
    kinds: RowKinds, row: OutboxRecord, message: SatelliteMessage, *, is_last: bool
) -> str:
    subject = title(kinds, row, message)
    gateway = carrier_title(message.carrier)
    match message.state:
        case "sending":
            fate = message.text or f"{gateway} is being called."
        case "taken":
            fate = f"{gateway} took it. {_fate(kinds, row, message, is_last=is_last)}"
        case "radio":
            fate = "The robot's modem fetched it."
        case _:
            fate = message.text
    return f"{subject[0].upper()}{subject[1:]}: {fate}".strip()


def _fate(kinds: RowKinds, row: OutboxRecord, message: SatelliteMessage, *, is_last: bool) -> str:
    """Say what is known of a message that a gateway took and did not report as fetched."""
    if not is_last:
        return "The robot was not heard to have it when it called, so it was sent again."
    if kinds.of(row).is_held(row, message.part):
        return "The robot says that it has this part."
    if row.level in ("radio", "applied"):
        return "The robot's answer says that it has it."
    if row.ended_at is None:
        return f"The robot has not been heard to fetch it. {message.text}"
    return f"The robot was not heard to fetch it before it was {_ENDS.get(row.state, 'given up')}."


def _incoming(record: InboxRecord, tariff: Tariff) -> IncomingMessageView:
    message = record.message
    return IncomingMessageView(
        session_at=message.session_at,
        arrived_at=message.arrived_at,
        momsn=message.momsn,
        mtmsn=message.mtmsn or None,
        bytes=len(message.data),
        credits=credits(len(message.data), tariff),
        is_duplicate=record.deliveries > 1,
        is_decoded=record.is_decoded,
        text=record.text,
    )
