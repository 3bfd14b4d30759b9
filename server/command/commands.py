"""Commands to robots: a row first, then bytes, then only those levels that were proved."""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.fault import StoreUnavailableError
from db.query.mission import commands as query
from db.query.mission.commands import CommandRecord, ProvedLevel
from db.query.station.events import add_event
from robot_link.messages import (
    FIRST_EMERGENCY_NUMBER,
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    PlanHash,
    RobotId,
)
from server.base.foundation import Foundation
from server.base.problem import conflict
from server.base.retry_queue import RetryQueue
from server.base.secret import SecretUnreadableError
from server.command.satellite_row import CommandRows, add_rows, emergency_message
from server.command.state import (
    SETTLED,
    CommandChanged,
    SurfaceOrdered,
    apply,
    surface_fault,
)
from server.command.view import CommandView, command_view, waiting_view
from server.fleet.capability import refuse_unless_able
from server.fleet.dependency import refuse_recording
from server.fleet.fleet import Fleet
from server.fleet.routing import RequestedLink
from server.fleet.words import told_to
from server.link.link import Radio
from server.satellite.satellite import OutboxChanged, Satellite

log = logging.getLogger(__name__)

_LIFE = {
    CommandKind.SURFACE: timedelta(hours=24),
    CommandKind.HOLD: timedelta(hours=24),
    CommandKind.RESUME: timedelta(hours=1),
    CommandKind.START: timedelta(minutes=30),
    CommandKind.QUIET: timedelta(hours=1),
    CommandKind.PING: timedelta(hours=1),
    CommandKind.ARM: timedelta(minutes=5),
    CommandKind.DISARM: timedelta(minutes=10),
    CommandKind.ZERO_DEPTH: timedelta(minutes=2),
}
"""Time after which a command is never sent, by the robots' clock."""
_CAPABILITIES = {
    CommandKind.SURFACE: "surface",
    CommandKind.HOLD: "hold",
    CommandKind.RESUME: "resume",
    CommandKind.START: "start",
    CommandKind.QUIET: "ping",
    CommandKind.PING: "ping",
    CommandKind.ARM: "arm",
    CommandKind.DISARM: "arm",
    CommandKind.ZERO_DEPTH: "zero_depth",
}
"""What a robot must be able to do to be told each."""
_BY_RADIO_ALONE = (CommandKind.ARM, CommandKind.DISARM, CommandKind.ZERO_DEPTH)
"""Who orders these stands beside the robot."""
_SATELLITE_LIFE = timedelta(hours=24)
"""The same of a command that goes by satellite: its robot may not call for hours."""
_WRITE_PATIENCE_S = 0.1
"""A command to surface waits this long, by the wall, for the database."""
_EMERGENCY_NUMBERS = range(2**24 - 1, FIRST_EMERGENCY_NUMBER - 1, -1)
"""Numbers of emergencies, which are not written down; the counting ones never get here."""

Check = Callable[[Session], object]
"""Raises if what leads to a command holds no longer, for example because of one to surface."""


@dataclass(frozen=True, slots=True)
class _NewCommand:
    """A command that is about to be written down."""

    robot: str
    kind: CommandKind
    by: str
    plan: PlanHash | None
    requested: RequestedLink
    links: tuple[str, ...]
    at: datetime
    expires_at: datetime


class Commands:
    """Sends commands and follows their levels. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        radio: Radio,
        satellite: Satellite,
    ) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._bus = foundation.bus
        self._fleet = fleet
        self._radio = radio
        self._satellite = satellite
        self._queue = RetryQueue("command reports")
        self._emergency_numbers = iter(_EMERGENCY_NUMBERS)
        self._emergencies: dict[str, CommandRecord] = {}
        self._written: dict[CommandNumber, str] = {}
        """Unsettled commands that were written down after all, by the emergency's number."""
        satellite.kinds.register(CommandRows())
        self._bus.subscribe(OutboxChanged, self._row_changed)

    async def run(self) -> None:
        """Store levels as they are proved, until cancelled."""
        await self._queue.run()

    async def resume(self) -> None:
        """Send what the station had not finished when it stopped; robots act once all the same."""
        waiting = await self._store.query(
            lambda session: query.list_commands(session, open_only=True, limit=1000)
        )
        now = self._clock.now()
        for status in list(self._fleet.statuses):
            await self._show_surfacing(status.record.id)
        for command in reversed(waiting):
            if command.expires_at <= now:
                await self._add_level(command.id, CommandLevel.EXPIRED, now, "", "")
            elif self._fleet.knows(command.robot):
                self._send(command)

    async def send(
        self,
        robot: str,
        kind: CommandKind,
        *,
        by: str,
        plan: PlanHash | None = None,
        check: Check | None = None,
        requested: RequestedLink = "auto",
    ) -> str:
        """Write a command down, send it, and return its id.

        SURFACE withdraws, in the same transaction, everything that the station had queued for the
        robot by itself. It goes by every link at once, even when it cannot be written down. Of the
        others, radio repeats them until it reaches the robot, also where satellite carries them:
        the robot acts once.

        Args:
            robot: Whom to tell.
            kind: What to tell.
            by: Who tells.
            plan: The plan that START means.
            check: Asked in the transaction; what it raises keeps the command from being sent.
            requested: The link that it is to take, as the operator says; SURFACE takes every one.

        Raises:
            Problem: 404 for an unknown robot, 409 for one that cannot be told anything, or not by
                the link that was asked for.
            StoreUnavailableError: The command was not written down and not sent.
        """
        new = self._new_command(robot, kind, by, plan, requested)

        def write(session: Session) -> CommandRecord:
            if check is not None:
                check(session)
            return self._add(session, new)

        if kind is CommandKind.SURFACE:
            command = await self._surface(robot, write, new.at, by)
        else:
            command = await self._store.write(write)
        self._show(command.id)
        if command.id not in self._emergencies and new.requested != "satellite":
            self._send(command)
        return command.id

    async def view(self, command: str) -> CommandView:
        """Return a command and how far it is proved.

        Raises:
            UnknownIdError: If there is no such command.
        """
        emergency = self._emergencies.get(command)
        if emergency is not None:
            return command_view(emergency)
        waits = self._satellite.waits
        return await self._store.query(
            lambda session: waiting_view(session, query.get_command(session, command), waits)
        )

    async def latest(
        self, robot: str, limit: int, period: Period | None = None
    ) -> list[CommandView]:
        """Return the newest commands of a robot, the newest first."""
        waits = self._satellite.waits

        def read(session: Session) -> list[CommandView]:
            records = query.list_commands(session, robot=robot, period=period, limit=limit)
            return [waiting_view(session, record, waits) for record in records]

        return await self._store.query(read)

    def take(self, report: CommandReport) -> None:
        """Take a level that the link proved."""
        emergency = self._emergencies.get(_emergency_id(report.number))
        written = self._written.get(report.number)
        if written is not None:
            self._take_of_emergency(written, report)
        elif emergency is None:
            self._queue.add(lambda: self._store_report(report))
        else:
            step = ProvedLevel(report.level, report.at, report.carrier, report.reason)
            levels = (*emergency.levels, step)
            changed = replace(emergency, level=report.level.value, levels=levels)
            self._emergencies[emergency.id] = changed
            self._bus.publish(CommandChanged(command_view(changed)))

    def _new_command(
        self,
        robot: str,
        kind: CommandKind,
        by: str,
        plan: PlanHash | None,
        requested: RequestedLink,
    ) -> _NewCommand:
        """Return what is to be written down.

        Raises:
            Problem: As of ``send``.
        """
        refuse_recording(self._fleet.status(robot), "cannot be told anything")
        refuse_unless_able(self._fleet.status(robot), _CAPABILITIES[kind])
        if kind is CommandKind.SURFACE:
            requested = "auto"
        links = self._links(robot, kind, requested)
        life = max(_LIFE[kind], _SATELLITE_LIFE) if "satellite" in links else _LIFE[kind]
        at = self._clock.now()
        return _NewCommand(robot, kind, by, plan, requested, links, at, at + life)

    def _add(self, session: Session, new: _NewCommand) -> CommandRecord:
        """Write a command down with all that belongs to it, in one transaction."""
        robot, kind, at = new.robot, new.kind, new.at
        if kind is CommandKind.SURFACE:
            self._bus.write(session, _surface_ordered(robot, at, new.by), robot)
        command = query.add_command(
            session,
            robot,
            kind,
            at=at,
            expires_at=new.expires_at,
            by=new.by,
            plan_sha256=new.plan,
        )
        if "satellite" in new.links:
            modems = self._satellite.enabled_modems(robot)
            add_rows(session, command, modems, is_only=new.requested == "satellite")
        add_event(
            session,
            at,
            f"command.{kind.value}",
            f"{new.by} told {robot} {told_to(kind)}.",
            level="watch" if kind is CommandKind.SURFACE else "info",
            robot=robot,
            data={"command": command.id, "by": new.by},
        )
        return command

    def _links(self, robot: str, kind: CommandKind, requested: RequestedLink) -> tuple[str, ...]:
        """Return the links of a command; one that no link takes waits for radio.

        Raises:
            Problem: 409 if the operator asks for a link that the robot has not.
        """
        if kind is CommandKind.SURFACE:
            return self._satellite.choice(robot, "surface").links
        if kind in _BY_RADIO_ALONE:
            if requested == "satellite":
                raise conflict("Orders to arm, to disarm and to zero the depth go by radio alone.")
            return ()
        choice = self._satellite.choice(robot, "command", requested)
        if requested != "auto" and not choice.links:
            raise conflict(choice.reason)
        return choice.links

    def _send(self, command: CommandRecord) -> None:
        self._radio.send_command(
            RobotId(command.robot),
            command.kind,
            command.number,
            command.expires_at,
            None if command.plan_sha256 is None else PlanHash(command.plan_sha256),
        )

    async def _surface(
        self, robot: str, write: Callable[[Session], CommandRecord], at: datetime, by: str
    ) -> CommandRecord:
        """Write a command to surface down, but let it leave before if that takes long or fails.

        A robot that hears two of them comes up once.
        """
        writing = asyncio.ensure_future(self._store.write(write))
        await asyncio.wait([writing], timeout=_WRITE_PATIENCE_S)
        if writing.done() and writing.exception() is None:
            return writing.result()
        emergency = self._emergency(robot, at, by)
        self._send(emergency)
        self._send_by_satellite(emergency)
        try:
            command = await writing
        except StoreUnavailableError as error:
            log.critical("%s surfaces by a command that is not written down: %s", robot, error)
            ordered = _surface_ordered(robot, at, by)
            self._bus.publish(ordered)
            self._queue.add(
                lambda: self._store.write(lambda session: self._bus.write(session, ordered, robot))
            )
            return emergency
        self._written[emergency.number] = command.id
        for step in self._emergencies.pop(emergency.id).levels:
            report = CommandReport(
                RobotId(robot), emergency.number, step.level, step.at, step.carrier, step.reason
            )
            self._take_of_emergency(command.id, report)
        return command

    def _take_of_emergency(self, command: str, report: CommandReport) -> None:
        """Take what became of an emergency as a level of the command: a person gave one order.

        The radio drops the one for the other, which ends neither.
        """
        if report.level is not CommandLevel.EXPIRED:
            level, at, carrier = report.level, report.at, report.carrier
            self._queue.add(lambda: self._add_level(command, level, at, carrier, report.reason))

    def _send_by_satellite(self, emergency: CommandRecord) -> None:
        """Hand an emergency to every satellite link from memory."""
        robot = emergency.robot
        try:
            key = self._satellite.robot_key(robot)
        except SecretUnreadableError as error:
            log.critical("%s is not told by satellite to surface: %s", robot, error)
            return
        for modem in self._satellite.enabled_modems(robot):

            def taken(carrier: str = modem.carrier) -> None:
                at, queued = self._clock.now(), CommandLevel.QUEUED
                self.take(CommandReport(RobotId(robot), emergency.number, queued, at, carrier))

            self._satellite.emergency.add(emergency_message(emergency, modem, key, taken))

    def _emergency(self, robot: str, at: datetime, by: str) -> CommandRecord:
        """Return a command that lives in memory only: coming up must not wait for a disk."""
        number = CommandNumber(next(self._emergency_numbers))
        command = CommandRecord(
            id=_emergency_id(number),
            number=number,
            robot=robot,
            kind=CommandKind.SURFACE,
            plan_sha256=None,
            level=query.CREATED,
            levels=(),
            created_at=at,
            created_by=by,
            expires_at=at + _LIFE[CommandKind.SURFACE],
        )
        self._emergencies[command.id] = command
        return command

    async def _store_report(self, report: CommandReport) -> None:
        command = await self._store.query(
            lambda session: query.command_of_number(session, report.robot, report.number)
        )
        if command is not None:
            await self._add_level(
                command.id, report.level, report.at, report.carrier, report.reason
            )

    async def _add_level(
        self, command: str, level: CommandLevel, at: datetime, carrier: str, reason: str
    ) -> None:
        await self._store.write(
            lambda session: apply(session, command, level, at=at, carrier=carrier, reason=reason)
        )
        self._show(command)

    def _row_changed(self, event: OutboxChanged) -> None:
        if event.row.command is not None:
            self._show(event.row.command)

    def _show(self, command: str) -> None:
        """Tell everyone about a command that was changed in the database."""
        self._queue.add(lambda: self._publish(command))

    async def _publish(self, command: str) -> None:
        view = await self.view(command)
        self._bus.publish(CommandChanged(view))
        if view.level in SETTLED:
            self._written = {of: one for of, one in self._written.items() if one != command}
        if view.kind == CommandKind.SURFACE.value:
            await self._show_surfacing(view.robot)

    async def _show_surfacing(self, robot: str) -> None:
        """Have it known whether the newest order to surface was refused."""
        fault = await self._store.query(lambda session: surface_fault(session, robot))
        if self._fleet.knows(robot):
            self._fleet.set_surface_fault(robot, fault)


def _surface_ordered(robot: str, at: datetime, by: str) -> SurfaceOrdered:
    return SurfaceOrdered(robot, at, f"{by} ordered {robot} to the surface.")


def _emergency_id(number: CommandNumber) -> str:
    return f"command-unwritten-{number}"
