"""The robot's end of the satellite: chunks become missions, and nothing acts twice."""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Protocol

from robot_link.mavlink.command import ReceivedCommand
from robot_link.messages import PlanHash, SystemId
from robot_link.mission import Mission
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import TransferId
from robot_link.satellite.record import CommandAnswer, TransferAck


@dataclass(frozen=True, slots=True)
class Complete:
    """Every chunk is there and their hash is right: apply the mission, then say so.

    Call ``applied`` or ``refused`` at once; until then ``Receiver.pending`` says it again.
    """

    mission: Mission
    start: bool
    """Whether to fly it at once."""
    transfer_id: TransferId


@dataclass(frozen=True, slots=True)
class OrderReceived:
    """A command to act on; then call ``answered``."""

    command: ReceivedCommand


@dataclass(frozen=True, slots=True)
class Nothing:
    """Nothing to do: a part of something, heard before, too old, or no message for this robot."""

    reason: str
    is_bad: bool = False
    """Whether the bytes were no message for this robot, to be counted."""


class ReceiverStore(Protocol):
    """Memory that survives a restart, replaced whole or not at all."""

    def load(self) -> bytes | None:
        """Return what was saved last, None at first."""
        ...

    def save(self, data: bytes) -> None:
        """Replace what is saved."""
        ...


class MemoryStore:
    """A store that lives as long as its process."""

    def __init__(self, data: bytes | None = None) -> None:
        self.data = data

    def load(self) -> bytes | None:
        """Return what was saved last."""
        return self.data

    def save(self, data: bytes) -> None:
        """Replace what is saved."""
        self.data = data


class FileStore:
    """A store in one file."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> bytes | None:
        """Return what was saved last."""
        raise NotImplementedError

    def save(self, data: bytes) -> None:
        """Replace the file."""
        raise NotImplementedError


class Receiver:
    """Collects chunks and orders of one robot.

    Args:
        store: Its memory.
        key: The robot's key.
        system: The robot's MAVLink system id.
    """

    def __init__(self, store: ReceiverStore, key: bytes, system: SystemId) -> None:
        raise NotImplementedError

    def take(self, data: bytes, now: datetime) -> Complete | OrderReceived | Nothing:
        """Take one message from the satellite; never raises for what is in it."""
        raise NotImplementedError

    def pending(self, on_board: PlanHash | None) -> Complete | None:
        """Return the mission that was complete when the robot stopped; call it once at the start.

        Args:
            on_board: The plan on board; if it is that mission, it counts as applied.
        """
        raise NotImplementedError

    def applied(self, transfer_id: TransferId) -> None:
        """Note that the mission is on board."""
        raise NotImplementedError

    def refused(self, transfer_id: TransferId, reason: str) -> None:
        """Note that the mission was not taken, with the robot's own sentence."""
        raise NotImplementedError

    def answered(self, command: ReceivedCommand, outcome: CommandOutcome) -> None:
        """Note what came of an order."""
        raise NotImplementedError

    def acks(self) -> tuple[TransferAck, ...]:
        """Return what to say of transfers in every record, until the station has seen it."""
        raise NotImplementedError

    def answers(self) -> tuple[CommandAnswer, ...]:
        """Return what to say of orders in every record, until the station has seen it."""
        raise NotImplementedError

    def next_counter(self) -> int:
        """Return the counter of the next record; each is used once, across restarts too."""
        raise NotImplementedError
