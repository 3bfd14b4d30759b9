"""A robot's satellite link as an operator sees it: budget, and each message out and in."""

from datetime import datetime

from sqlalchemy.orm import Session

from db.query.inbox import InboxRecord, inbox_of
from db.query.outbox import get_outbox
from db.query.satellite_messages import SatelliteMessage, messages_to
from server.service.picture import Picture
from server.service.satellite.budget import budget_of
from server.service.satellite.message_row import what
from server.service.satellite.modem import modems_of
from server.service.satellite.standing import settings_of
from server.service.view.link import IncomingMessageView, OutgoingMessageView, SatelliteView
from server.service.words import carrier_title


def satellite_view(session: Session, picture: Picture, now: datetime, limit: int) -> SatelliteView:
    """Return a robot's budget and its newest messages; one without a modem has none."""
    robot = picture.record.id
    modem = next(iter(modems_of(picture.record)), None)
    budget = budget_of(session, robot, settings_of(session, robot).satellite.tariff, now)
    standing = picture.satellite
    return SatelliteView(
        imei=None if modem is None else modem.imei,
        carrier="" if modem is None else modem.carrier,
        credits_today=budget.spent,
        credits_per_day=budget.per_day,
        credits_left=budget.left,
        next_session_at=None if standing is None else standing.next_session_at,
        outgoing=[_outgoing(session, one) for one in messages_to(session, robot, limit)],
        incoming=[_incoming(one) for one in inbox_of(session, robot, limit)],
    )


def _outgoing(session: Session, message: SatelliteMessage) -> OutgoingMessageView:
    return OutgoingMessageView(
        at=message.created_at,
        kind=message.kind,
        bytes=len(message.data),
        credits=message.credits,
        state=message.state,
        message_id=message.message_id or None,
        mtmsn=message.mtmsn,
        text=_outgoing_text(session, message),
    )


def _outgoing_text(session: Session, message: SatelliteMessage) -> str:
    subject = what(get_outbox(session, message.outbox), message)
    gateway = carrier_title(message.carrier)
    match message.state:
        case "sending":
            fate = message.text or f"{gateway} is being called."
        case "taken":
            fate = f"{gateway} has it; the robot has not been heard to fetch it. {message.text}"
        case "radio":
            fate = "The robot's modem fetched it."
        case _:
            fate = message.text
    return f"{subject[0].upper()}{subject[1:]}: {fate}".strip()


def _incoming(record: InboxRecord) -> IncomingMessageView:
    message = record.message
    return IncomingMessageView(
        session_at=message.session_at,
        arrived_at=message.arrived_at,
        momsn=message.momsn,
        mtmsn=message.mtmsn or None,
        bytes=len(message.data),
        is_duplicate=record.deliveries > 1,
        is_decoded=record.is_decoded,
        text=record.text,
    )
