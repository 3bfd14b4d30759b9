"""Commands to robots: a row first, then bytes, then only those levels that were proved."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import replace
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from db.fault import StoreUnavailableError
from db.query import commands as query
from db.query.commands import CommandRecord, ProvedLevel
from db.query.events import add_event
from db.store import Store
from robot_link.clock import Clock
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    PlanHash,
    RobotId,
)
from server.problem import conflict
from server.service.fleet import Fleet
from server.service.link import Radio
from server.service.turn import Turns
from server.service.view.command import CommandView, LevelView
from server.service.words import command_text

log = logging.getLogger(__name__)

_LIFE = {
    CommandKind.SURFACE: timedelta(hours=24),
    CommandKind.HOLD: timedelta(hours=24),
    CommandKind.RESUME: timedelta(hours=1),
    CommandKind.START: timedelta(minutes=30),
}
"""Time after which a command is never sent, by the robots' clock."""
_WRITE_PATIENCE_S = 0.1
"""A surface order waits this long, by the wall, for the database."""
_EMERGENCY_NUMBERS = range(2**24 - 1, 2**24 - 2**16, -1)
"""Numbers of surface orders that could not be written down; the counting ones never get here."""

Purge = Callable[[Session, str, datetime, str], None]
"""Withdraws, in the transaction of a surface order, what was queued for a robot by itself."""
Check = Callable[[Session], None]
"""Raises if what leads to a command holds no longer, for example because of a surface order."""


class Commands:
    """Sends commands and follows their levels. Belongs to one event loop."""

    def __init__(self, store: Store, clock: Clock, fleet: Fleet, radio: Radio) -> None:
        self._store = store
        self._clock = clock
        self._fleet = fleet
        self._radio = radio
        self._turns = Turns("command reports")
        self._emergency_numbers = iter(_EMERGENCY_NUMBERS)
        self._unwritten: dict[str, CommandRecord] = {}
        self.purges: list[Purge] = []
        self.on_surface: list[Callable[[str], Awaitable[None]]] = []
        """Awaited after a surface order left, to stop what runs for that robot in memory."""

    async def run(self) -> None:
        """Store levels as they are proved, until cancelled."""
        await self._turns.run()

    async def resume(self) -> None:
        """Send what the station had not finished when it stopped; robots act once all the same."""
        waiting = await self._store.query(
            lambda session: query.list_commands(session, open_only=True, limit=1000)
        )
        now = self._clock.now()
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
    ) -> str:
        """Write a command down, send it, and return its id.

        SURFACE withdraws, in the same transaction, everything that the station had queued for the
        robot by itself. It goes out even when it cannot be written down.

        Args:
            robot: Whom to tell.
            kind: What to tell.
            by: Who tells.
            plan: The plan that START means.
            check: Asked in the transaction; what it raises keeps the command from being sent.

        Raises:
            Problem: 404 for an unknown robot, 409 for one that cannot be told anything.
            StoreUnavailableError: The command was not written down and not sent.
        """
        picture = self._fleet.picture(robot)
        if picture.record.system_id is None:
            raise conflict(f"{robot} is a recording; it cannot be told anything.")
        at = self._clock.now()

        def write(session: Session) -> CommandRecord:
            if check is not None:
                check(session)
            if kind is CommandKind.SURFACE:
                self._purge(session, robot, at, by)
            command = query.add_command(
                session, robot, kind, at=at, expires_at=at + _LIFE[kind], by=by, plan_sha256=plan
            )
            add_event(
                session,
                at,
                f"command.{kind.value}",
                f"{by} told {robot} to {kind.value}.",
                level="watch" if kind is CommandKind.SURFACE else "info",
                robot=robot,
                data={"command": command.id, "by": by},
            )
            return command

        if kind is CommandKind.SURFACE:
            command = await self._surface(robot, write, at, by)
        else:
            command = await self._store.write(write)
        if command.id not in self._unwritten:
            self._send(command)
        if kind is CommandKind.SURFACE:
            for stop in self.on_surface:
                await stop(robot)
        return command.id

    async def view(self, command: str) -> CommandView:
        """Return a command and how far it is proved.

        Raises:
            UnknownIdError: If there is no such command.
        """
        unwritten = self._unwritten.get(command)
        if unwritten is not None:
            return command_view(unwritten)
        record = await self._store.query(lambda session: query.get_command(session, command))
        return command_view(record)

    async def latest(self, robot: str, limit: int) -> list[CommandView]:
        """Return the newest commands of a robot, the newest first."""
        records = await self._store.query(
            lambda session: query.list_commands(session, robot=robot, limit=limit)
        )
        return [command_view(record) for record in records]

    def take(self, report: CommandReport) -> None:
        """Take a level that the link proved."""
        unwritten = self._unwritten.get(_unwritten_id(report.number))
        if unwritten is None:
            self._turns.add(lambda: self._store_report(report))
        else:
            step = ProvedLevel(report.level, report.at, report.carrier, report.reason)
            levels = (*unwritten.levels, step)
            self._unwritten[unwritten.id] = replace(
                unwritten, level=report.level.value, levels=levels
            )

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
        """Write a surface order down, but let it leave before if that takes long or fails.

        A robot that hears two orders comes up once.
        """
        writing = asyncio.ensure_future(self._store.write(write))
        await asyncio.wait([writing], timeout=_WRITE_PATIENCE_S)
        if writing.done() and writing.exception() is None:
            return writing.result()
        unwritten = self._unwritten_surface_order(robot, at, by)
        self._send(unwritten)
        try:
            return await writing
        except StoreUnavailableError as error:
            log.critical("%s surfaces by an order that is not written down: %s", robot, error)
            self._turns.add(
                lambda: self._store.write(lambda session: self._purge(session, robot, at, by))
            )
            return unwritten

    def _purge(self, session: Session, robot: str, at: datetime, by: str) -> None:
        for purge in self.purges:
            purge(session, robot, at, f"{by} ordered {robot} to the surface.")

    def _unwritten_surface_order(self, robot: str, at: datetime, by: str) -> CommandRecord:
        """Return an order that lives in memory only: coming up must not wait for a disk."""
        number = CommandNumber(next(self._emergency_numbers))
        command = CommandRecord(
            id=_unwritten_id(number),
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
        self._unwritten[command.id] = command
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
        def write(session: Session) -> None:
            before = query.get_command(session, command)
            after = query.add_level(session, command, level, at=at, carrier=carrier, reason=reason)
            if after.level != before.level:
                view = command_view(after)
                add_event(
                    session,
                    at,
                    f"command.{after.level}",
                    view.text,
                    level="watch" if after.level in {"refused", "expired"} else "info",
                    robot=after.robot,
                    data={"command": after.id, "kind": after.kind.value, "level": after.level},
                )

        await self._store.write(write)


def _unwritten_id(number: CommandNumber) -> str:
    return f"command-unwritten-{number}"


def command_view(record: CommandRecord) -> CommandView:
    """Return a command as REST says it."""
    reason = record.levels[-1].reason if record.levels else ""
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
        text=command_text(record.robot, record.kind, record.level, reason),
    )
