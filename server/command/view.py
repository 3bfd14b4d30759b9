"""A command and how far it is proved, as an operator sees it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Annotated

from sqlalchemy.orm import Session

from db.query.mission.commands import CREATED, CommandRecord
from db.query.satellite.outbox import open_outbox
from db.record import same
from robot_link.messages import CommandKind
from server.base.view import View, one_of
from server.fleet.words import command_text

CommandLevel = Annotated[str, one_of("created", "queued", "radio", "applied", "refused", "expired")]
"""How far a command is proved to have come."""


@dataclass(frozen=True, slots=True)
class LevelView(View):
    """A level that a command has reached."""

    level: CommandLevel
    at: datetime
    carrier: str
    """The link that proved it; empty where the station itself did."""
    reason: str


@dataclass(frozen=True, slots=True)
class CommandView(View):
    """One command to a robot."""

    id: str
    robot: str
    kind: Annotated[str, one_of(*CommandKind)]
    level: CommandLevel
    """``created``, ``queued``, ``radio``, ``applied``, ``refused`` or ``expired``."""
    levels: list[LevelView]
    created_at: datetime
    expires_at: datetime
    text: str
    """One sentence for the operator."""


def command_view(record: CommandRecord) -> CommandView:
    """Return a command as REST says it."""
    reason = record.levels[-1].reason if record.levels else ""
    carriers = [step.carrier for step in record.levels if step.level.value == record.level]
    return same(
        CommandView,
        record,
        kind=record.kind.value,
        levels=[
            LevelView(step.level.value, step.at, step.carrier, step.reason)
            for step in record.levels
        ],
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
    if record.level != CREATED or not waits:
        return view
    reasons = [
        waits[row.id]
        for row in open_outbox(session, record.robot)
        if row.command == record.id and row.id in waits
    ]
    return replace(view, text=" ".join([view.text, *dict.fromkeys(reasons)]))
