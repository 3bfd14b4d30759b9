"""Transfers as an operator sees them: what is proved of each part, and what may still be done."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from sqlalchemy.orm import Session

from db.query.mission.plans import get_plan
from db.query.mission.transfers import TransferRecord, get_transfer, newest_transfer
from db.query.satellite.outbox import OutboxRecord, outbox_of_transfer
from db.query.satellite.satellite_messages import credits_of, messages_of
from db.record import same
from robot_link.satellite.cost import credits
from robot_link.station.ground import Part
from server.fleet.link_view import TransferPartView
from server.fleet.words import carrier_title
from server.plan.view import TransferView
from server.satellite.account import settings_of
from server.transfer.plan_row import ground_of
from server.transfer.state import RADIO_LIFE
from server.transfer.withdrawal_row import called_back

NOTHING_WAITS: Final[Mapping[str, str]] = MappingProxyType({})


def transfer_view(
    session: Session, transfer: str, waits: Mapping[str, str] = NOTHING_WAITS
) -> TransferView:
    """Return a transfer as REST says it.

    Args:
        session: Where to read.
        transfer: Which.
        waits: Why rows of the outbox are not sent on, by their ids.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    record = get_transfer(session, transfer)
    row = outbox_of_transfer(session, transfer)
    view = same(
        TransferView,
        record,
        plan_id=record.plan,
        sha256=get_plan(session, record.plan).sha256,
        expires_at=record.started_at + RADIO_LIFE,
        can_withdraw=record.ended_at is None and record.state in ("waiting", "sending"),
    )
    if row is None:
        return replace(view, text=_text(record, None, ""))
    return _by_satellite(session, view, record, row, waits.get(row.id, ""))


def transfer_of_plan(
    session: Session, plan: str, waits: Mapping[str, str] = NOTHING_WAITS
) -> TransferView | None:
    """Return the newest transfer of a plan, ``None`` if it was never sent."""
    newest = newest_transfer(session, plan)
    return None if newest is None else transfer_view(session, newest, waits)


def _by_satellite(
    session: Session, view: TransferView, record: TransferRecord, row: OutboxRecord, waits: str
) -> TransferView:
    tariff = settings_of(session, record.robot).satellite.tariff
    messages = messages_of(session, row.id)
    ground = ground_of(row)
    refusals = (one.text for one in messages if one.state == "sending" and one.text)
    refusal = next(
        (f"{carrier_title(row.carrier)}: {one} It is tried again." for one in refusals), ""
    )
    is_open = row.ended_at is None and row.state != "held"
    is_by_satellite = is_open or record.carrier == row.carrier
    level = row.level if is_by_satellite and record.level != "applied" else record.level
    return replace(
        view,
        level=level,
        can_withdraw=view.can_withdraw and row.state != "applied",
        carrier=row.carrier if is_open else record.carrier,
        expires_at=row.expires_at if is_by_satellite else view.expires_at,
        credits=credits_of(session, row.id),
        parts=[_part(part, credits(part.size, tariff)) for part in ground.parts],
        text=_text(record, row, waits or refusal, called_back(session, row)),
    )


def _part(part: Part, cost: int) -> TransferPartView:
    return same(
        TransferPartView,
        part,
        bytes=part.size,
        credits=cost,
        level=part.level.value,
    )


def _text(
    record: TransferRecord, row: OutboxRecord | None, waiting: str, called_back: str = ""
) -> str:
    if record.ended_at is not None or record.state in ("kept", "on_board", "running"):
        return f"{_end(record)} {called_back}".strip()
    if row is None or row.state == "held":
        if record.state == "waiting" and record.route != "radio":
            return "Is being made ready; nothing has left the station."
        if record.state == "waiting":
            return f"Waits until {record.robot} is reached by radio."
        return f"On its way to {record.robot} by radio; {record.robot} has not confirmed it."
    if waiting:
        return waiting
    match row.level:
        case "created":
            return f"{carrier_title(row.carrier)} has not taken all of it yet."
        case "queued":
            return f"{carrier_title(row.carrier)} has it; {record.robot} fetches it when it calls."
        case "radio":
            return f"{record.robot}'s modem has every part; {record.robot} has not confirmed it."
        case _:
            return f"{record.robot} has it on board."


def _end(record: TransferRecord) -> str:
    match record.state:
        case "kept":
            return f"{record.robot} has it on board, where it waits for the next surfacing."
        case "on_board":
            return f"{record.robot} has it on board."
        case "running":
            return f"{record.robot} flies it."
        case _:
            return f"{record.state.capitalize()}: {record.reason.rstrip('.')}."
