"""Commands to one robot: one after another, again and again, until answered or expired."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime

from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.command import acknowledged_kind, command_message
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    PlanHash,
)
from robot_link.station.peer import Peer

_LEAST_PAUSE_S = 0.2

_REFUSALS = {
    grace.MAV_RESULT_TEMPORARILY_REJECTED: "the robot cannot do this now",
    grace.MAV_RESULT_DENIED: "the robot holds another plan",
    grace.MAV_RESULT_UNSUPPORTED: "the robot does not know this command",
}

_OF_DEPTH = {
    grace.MAV_RESULT_TEMPORARILY_REJECTED: "it flies, is driven, or moves up or down; it must lie"
    " still at the surface",
    grace.MAV_RESULT_FAILED: "its depth sensor reads above the surface, or more than 0.5 m below"
    " it: it is under water, or the sensor is broken",
}
"""Of an order to zero the depth."""


def _refusal(kind: CommandKind, result: int) -> str:
    """Return why a robot refused, in words."""
    if kind is CommandKind.ZERO_DEPTH and result in _OF_DEPTH:
        return _OF_DEPTH[result]
    return _REFUSALS.get(result, "the robot failed to do this")


@dataclass(slots=True)
class Command:
    """What a robot is told, and how far it is proved to have come."""

    kind: CommandKind
    number: CommandNumber
    expires: datetime
    plan: PlanHash | None
    earlier: "Command | None" = None
    """Must be settled before this one is sent."""
    is_confirmed: bool = False
    """Whether the robot's radio confirmed the last attempt."""
    told: set[CommandLevel] = field(default_factory=set)
    settled: asyncio.Event = field(default_factory=asyncio.Event)
    stirred: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when there is reason to look at the command again."""


class CommandLane:
    """Belongs to one event loop; commands may be submitted before it runs."""

    def __init__(self, peer: Peer, on_report: Callable[[CommandReport], None]) -> None:
        self._peer = peer
        self._on_report = on_report
        self._submitted: asyncio.Queue[Command] = asyncio.Queue()
        self._open: list[Command] = []

    async def run(self) -> None:
        """Carry commands until cancelled."""
        async with asyncio.TaskGroup() as group:
            while True:
                command = await self._submitted.get()
                name = f"command {command.number} to {self._peer.robot}"
                group.create_task(self._carry(command), name=name)

    def submit(self, command: Command) -> None:
        """Take a command; SURFACE drops the ones before it, others wait for them."""
        if any(command.number == other.number for other in self._open):
            return
        if command.kind is CommandKind.SURFACE:
            for other in list(self._open):
                self._settle(other, CommandLevel.EXPIRED, "dropped: the robot is told to surface")
        elif self._open:
            command.earlier = self._open[-1]
        self._open.append(command)
        self._submitted.put_nowait(command)

    def answered(self, message: grace.MAVLink_command_ack_message) -> None:
        """Take the robot's answer; an answer to nothing is a late repetition.

        A vehicle that does not know the dialect refuses without the command's number.
        """
        kind = acknowledged_kind(message)
        is_strange = message.result == grace.MAV_RESULT_UNSUPPORTED and not message.result_param2
        for command in self._open:
            if command.kind is kind and (is_strange or command.number == message.result_param2):
                if message.result == grace.MAV_RESULT_ACCEPTED:
                    self._settle(command, CommandLevel.APPLIED)
                elif message.result == grace.MAV_RESULT_IN_PROGRESS:
                    command.is_confirmed = True
                    self._tell_once(command, CommandLevel.RADIO, self._peer.heard_by)
                else:
                    reason = _refusal(command.kind, message.result)
                    self._settle(command, CommandLevel.REFUSED, reason)
                return

    def contact(self) -> None:
        """Send at once what the robot did not confirm: it has just been heard."""
        for command in self._open:
            if not command.is_confirmed:
                command.stirred.set()

    async def _carry(self, command: Command) -> None:
        if command.earlier is not None:
            await self._wait(command, command.earlier.settled, None)
            command.earlier = None
        attempt = 0
        while not command.settled.is_set():
            if self._left_s(command) <= 0:
                self._settle(command, CommandLevel.EXPIRED, _expiry_reason(command))
                return
            command.stirred.clear()
            await self._send(command, attempt)
            attempt += 1
            await asyncio.sleep(min(_LEAST_PAUSE_S, self._left_s(command)))
            timing = self._peer.timing
            pause_s = timing.answer_s if command.is_confirmed else timing.retry_s
            await self._wait(command, command.stirred, pause_s)

    async def _send(self, command: Command, attempt: int) -> None:
        was_confirmed = await self._peer.deliver(
            (self._message(command, attempt),),
            on_taken=lambda: self._tell_once(command, CommandLevel.QUEUED, self._peer.taken_by),
            is_wanted=lambda: not command.settled.is_set() and self._left_s(command) > 0,
            on_every_path=command.kind is CommandKind.SURFACE,
        )
        command.is_confirmed = was_confirmed or self._has_answered(command)
        if was_confirmed:
            self._tell_once(command, CommandLevel.RADIO, self._peer.confirmed_by)

    def _has_answered(self, command: Command) -> bool:
        """Tell whether the robot itself proved that it heard an earlier attempt."""
        del command
        return False

    def _message(self, command: Command, attempt: int) -> WireMessage:
        return command_message(
            self._peer.system,
            command.kind,
            command.number,
            command.expires,
            command.plan,
            confirmation=min(attempt, 255),
        )

    async def _wait(self, command: Command, event: asyncio.Event, longest_s: float | None) -> None:
        """Wait for an event, not beyond the command's expiry."""
        left_s = max(0.0, self._left_s(command))
        try:
            async with asyncio.timeout(left_s if longest_s is None else min(left_s, longest_s)):
                await event.wait()
        except TimeoutError:
            pass

    def _left_s(self, command: Command) -> float:
        """Return the wall time until the command expires."""
        clock = self._peer.clock
        return (command.expires - clock.now()).total_seconds() / clock.speed

    def _settle(self, command: Command, level: CommandLevel, reason: str = "") -> None:
        if command in self._open:
            self._open.remove(command)
            command.settled.set()
            command.stirred.set()
            # what expired, no link has proved
            carrier = "" if level is CommandLevel.EXPIRED else self._peer.heard_by
            self._tell(command, level, carrier, reason)

    def _tell_once(self, command: Command, level: CommandLevel, carrier: str) -> None:
        if level not in command.told and not command.settled.is_set():
            command.told.add(level)
            self._tell(command, level, carrier)

    def _tell(self, command: Command, level: CommandLevel, carrier: str, reason: str = "") -> None:
        self._on_report(
            CommandReport(
                robot=self._peer.robot,
                number=command.number,
                level=level,
                at=self._peer.clock.now(),
                carrier=carrier,
                reason=reason,
            )
        )


def _expiry_reason(command: Command) -> str:
    if CommandLevel.RADIO in command.told:
        return "the robot did not answer in time"
    if CommandLevel.QUEUED in command.told:
        return "the robot was not in reach in time"
    return "the command could not leave the station in time"
