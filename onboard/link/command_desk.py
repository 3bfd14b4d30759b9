"""The robot's handling of commands: each acts once, and none that was overtaken acts at all."""

import logging
from collections import OrderedDict
from collections.abc import Sequence
from typing import Protocol

from robot_link.mavlink.command import ReceivedCommand
from robot_link.messages import FIRST_EMERGENCY_NUMBER, CommandKind, CommandNumber
from robot_link.robot_program import CommandOutcome

_REMEMBERED = 64
_NUMBERS = FIRST_EMERGENCY_NUMBER - 1
"""Ordinary numbers, which begin again at 1."""
_OVERTAKEN_S = 60.0
"""How long after SURFACE an older command may still be on its way."""


_log = logging.getLogger(__name__)


class Obedient(Protocol):
    """The part of ``RobotProgram`` that acts on commands."""

    def obey(self, kind: CommandKind, plan_digits: str) -> CommandOutcome:
        """Act on a command."""
        ...


class CommandMemory(Protocol):
    """Keeps what came of the newest commands while the robot is switched off."""

    def load(self) -> Sequence[tuple[CommandNumber, int, CommandOutcome]]:
        """Return number, expiry (second since 1970) and outcome, oldest first."""
        ...

    def save(self, outcomes: Sequence[tuple[CommandNumber, int, CommandOutcome]]) -> None:
        """Replace what is kept, whole or not at all.

        Raises:
            OSError: If it cannot be kept.
        """
        ...


class CommandDesk:
    """Remembers the newest commands by number and expiry, with what came of them.

    The radio may deliver a command twice, or after a later one. A repetition is answered as
    before without acting again. A command that the station numbered before a SURFACE and that
    arrives after it is not obeyed: the station has dropped it, and the robot must stay up. Nor is
    a PING that was numbered before a QUIET, whichever link each took.
    """

    def __init__(self, program: Obedient, memory: CommandMemory | None = None) -> None:
        self._program = program
        self._memory = memory
        self._outcomes: OrderedDict[tuple[CommandNumber, int], CommandOutcome] = OrderedDict(
            ((number, expiry_s), outcome)
            for number, expiry_s, outcome in (() if memory is None else memory.load())
        )
        self._surface: tuple[CommandNumber, float] | None = None
        self._quiet: CommandNumber | None = None

    def take(self, command: ReceivedCommand, now_s: float) -> CommandOutcome:
        """Act on a command unless that was done or must not be; return what came of it."""
        name = (command.number, command.expiry_s)
        if name not in self._outcomes:
            self._outcomes[name] = self._act(command, now_s)
            if len(self._outcomes) > _REMEMBERED:
                self._outcomes.popitem(last=False)
            self._keep()
        return self._outcomes[name]

    def _keep(self) -> None:
        """Keep what is remembered; a robot that cannot (a full disk) must obey all the same."""
        if self._memory is None:
            return
        try:
            self._memory.save([(*name, outcome) for name, outcome in self._outcomes.items()])
        except OSError as error:
            _log.error("what came of the newest commands was not kept: %s", error)

    def _act(self, command: ReceivedCommand, now_s: float) -> CommandOutcome:
        if command.kind is CommandKind.SURFACE:
            self._surface = (command.number, now_s)
        elif self._surface is not None:
            number, surfaced_s = self._surface
            if _is_older(command.number, number) and now_s - surfaced_s < _OVERTAKEN_S:
                return CommandOutcome.NOT_NOW
        is_before_quiet = self._quiet is not None and _is_older(command.number, self._quiet)
        if command.kind is CommandKind.PING and is_before_quiet:
            return CommandOutcome.NOT_NOW
        if command.kind is CommandKind.QUIET:
            self._quiet = command.number
        return self._program.obey(command.kind, command.plan_digits)


def _is_older(number: CommandNumber, other: CommandNumber) -> bool:
    """Tell whether a command was numbered before another."""
    if other >= FIRST_EMERGENCY_NUMBER:
        return number < FIRST_EMERGENCY_NUMBER
    return 0 < (other - number) % _NUMBERS < _NUMBERS // 2
