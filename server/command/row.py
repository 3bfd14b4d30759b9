"""Commands as rows: a level that was proved, with its event and with what it settles."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from typing import Final

from sqlalchemy.orm import Session

from db.query import commands as query
from db.query.commands import CommandRecord
from db.query.events import add_event
from db.query.outbox import open_outbox
from robot_link.messages import CommandLevel
from server.command.view import CommandView, LevelView
from server.fleet.words import command_text
from server.satellite.ending import end_row

_SETTLED: Final = ("applied", "refused", "expired")


def note_level(
    session: Session,
    command: str,
    level: CommandLevel,
    *,
    at: datetime,
    carrier: str,
    reason: str = "",
) -> CommandRecord:
    """Write down a level that was proved; one that is settled is not sent by satellite any more."""
    before = query.get_command(session, command)
    after = query.add_level(session, command, level, at=at, carrier=carrier, reason=reason)
    if after.level == before.level:
        return after
    add_event(
        session,
        at,
        f"command.{after.level}",
        command_view(after).text,
        level="watch" if after.level in {"refused", "expired"} else "info",
        robot=after.robot,
        data={"command": after.id, "kind": after.kind.value, "level": after.level},
    )
    if after.level in _SETTLED:
        _settle(session, after, at)
    return after


def command_view(record: CommandRecord) -> CommandView:
    """Return a command as REST says it."""
    reason = record.levels[-1].reason if record.levels else ""
    carriers = [step.carrier for step in record.levels if step.level.value == record.level]
    return CommandView(
        id=record.id,
        robot=record.robot,
        kind=record.kind.value,
        level=record.level,
        levels=[
            LevelView(step.level.value, step.at, step.carrier, step.reason)
            for step in record.levels
        ],
        created_at=record.created_at,
        expires_at=record.expires_at,
        text=command_text(record.robot, record.kind, record.level, reason, carriers),
    )


def waiting_view(session: Session, record: CommandRecord, waits: Mapping[str, str]) -> CommandView:
    """Return a command as REST says it, and why satellite does not send it on.

    Args:
        session: Where to read.
        record: The command.
        waits: Why rows of the outbox are not sent on, by their ids.
    """
    view = command_view(record)
    if record.level != query.CREATED or not waits:
        return view
    reasons = [
        waits[row.id]
        for row in open_outbox(session, record.robot)
        if row.command == record.id and row.id in waits
    ]
    return replace(view, text=" ".join([view.text, *dict.fromkeys(reasons)]))


def _settle(session: Session, command: CommandRecord, at: datetime) -> None:
    for row in open_outbox(session, command.robot):
        if row.command == command.id:
            end_row(session, row.id, command.level, row.reason, at)
