"""The level of a command: nothing raises it but what a link proved, by this table.

======================  =======  =======  ===============
level                   proved   becomes  event
======================  =======  =======  ===============
created                 queued   queued   command.queued
created, queued         radio    radio    command.radio
created, queued, radio  applied  applied  command.applied
created, queued, radio  refused  refused  command.refused
created, queued, radio  expired  expired  command.expired
======================  =======  =======  ===============

Radio, satellite and time hand theirs to ``apply``. What a level does not list changes nothing, but
that a second carrier proved the same level is noted. ``queued`` and ``radio`` say how far a link
has it, ``applied`` and ``refused`` what the robot answered.
"""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from db.query.mission import commands as query
from db.query.mission.commands import CommandRecord
from db.query.satellite.outbox import newest_outboxes, open_outbox
from db.query.station.events import add_event
from robot_link.messages import CommandKind, CommandLevel
from server.base.transition_table import transitions
from server.command.view import CommandView, command_view
from server.fleet.status import SurfaceFault
from server.satellite.ending import end_row

TRANSITIONS = transitions(__doc__, CommandLevel)
SETTLED = ("applied", "refused", "expired")
"""Levels that a command never leaves."""


@dataclass(frozen=True, slots=True)
class CommandChanged:
    """A command was sent, or more of it was proved; published after the commit."""

    command: CommandView


@dataclass(frozen=True, slots=True)
class SurfaceOrdered:
    """A robot was told to surface: the station has nothing more for it by itself.

    What was queued for it is withdrawn in the transaction of the command
    (``EventBus.subscribe_within``), what runs for it in memory is stopped after the commit.
    """

    robot: str
    at: datetime
    reason: str


def apply(
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
    step = TRANSITIONS.get((before.level, level))
    if step is None and level.value != before.level:
        return before
    after = query.add_level(session, command, level, at=at, carrier=carrier, reason=reason)
    if step is None:
        return after
    add_event(
        session,
        at,
        step.event,
        command_view(after).text,
        level=_event_level(after),
        robot=after.robot,
        data={"command": after.id, "kind": after.kind.value, "level": step.state},
    )
    if step.state in SETTLED:
        for row in open_outbox(session, after.robot):
            if row.command == after.id:
                end_row(session, row.id, _row_end(after, at), reason, at)
    return after


def surface_fault(session: Session, robot: str) -> SurfaceFault | None:
    """Return why the newest order to surface is not obeyed; ``None`` while it may be."""
    command = query.newest_of_kind(session, robot, CommandKind.SURFACE)
    if command is None or command.level == "applied":
        return None
    if command.level == "refused" or (
        command.level == "expired" and command.levels[-1].at >= command.expires_at
    ):
        return SurfaceFault(command.created_at, command_view(command).text)
    refused = [
        row.reason
        for row in newest_outboxes(session, robot, "order", command.created_at)
        if row.command == command.id and row.state == "refused"
    ]
    if not refused or command.level == "expired":
        return None
    text = f"The surface order for {robot} does not go by satellite: {refused[0].rstrip('.')}."
    return SurfaceFault(command.created_at, text)


def _event_level(command: CommandRecord) -> str:
    if command.level not in ("refused", "expired"):
        return "info"
    is_refused_surface = command.kind is CommandKind.SURFACE and command.level == "refused"
    return "critical" if is_refused_surface else "watch"


def _row_end(command: CommandRecord, at: datetime) -> str:
    """Return how a row ends whose command another link or a later command settled."""
    has_run_out = command.level == "expired" and at >= command.expires_at
    return command.level if command.level == "applied" or has_run_out else "superseded"
