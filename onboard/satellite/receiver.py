"""The robot's end of the satellite: chunks become missions, and nothing acts twice.

Each change is saved before it is answered, so a restart at any moment loses nothing: a chunk that
was taken stays taken, a mission that was complete is complete again (``pending``), a word is
repeated in every record until the station says that it has seen it.

One mission comes in at a time, the one with the newest counter. A counter not newer than that of
the mission applied last marks history: it is never applied, but its word is said again. Nor is a
mission applied that was sent before a withdrawal, or before an order to surface.
"""

from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Protocol

from onboard.satellite.receiver_memory import Answered, Assembly, Ended, ReceiverMemory
from robot_link.mavlink.command import ReceivedCommand
from robot_link.messages import CommandKind, PlanHash, SystemId
from robot_link.mission import Mission
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import TransferId, mission_of, transfer_id_of
from robot_link.satellite.chunk import Chunk, read_mobile_terminated
from robot_link.satellite.content import CommandAnswer, Reason, TransferAck, TransferState
from robot_link.satellite.frame import WireError
from robot_link.satellite.order import Order
from robot_link.satellite.withdrawal import Withdrawal
from robot_link.whole_file import replace_file

__all__ = [
    "Complete",
    "FileStore",
    "MemoryStore",
    "Nothing",
    "OrderReceived",
    "Receiver",
    "ReceiverStore",
]

_WORDS_KEPT = 16
"""Words on transfers, and on orders, that are remembered."""
_STAYS_UP = (CommandKind.SURFACE, CommandKind.HOLD)
"""Orders that never expire, and after which no earlier mission begins to fly."""
_LEAVES_SURFACE = (CommandKind.HOLD, CommandKind.QUIET, CommandKind.PING)
"""Orders that send the robot nowhere: one to surface from before them holds. A robot that holds
flies its dive to the end first."""


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
    """A store in one file, which is on the disk, its name too, when ``save`` returns."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> bytes | None:
        """Return what was saved last."""
        try:
            return self._path.read_bytes()
        except FileNotFoundError:
            return None

    def save(self, data: bytes) -> None:
        """Replace the file.

        Raises:
            OSError: If the disk refuses; the file is then what it was, or the new one.
        """
        replace_file(self._path, data)


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


class Receiver:
    """Collects chunks and orders of one robot.

    Args:
        store: Its memory.
        key: The robot's key.
        system: The robot's MAVLink system id.
    """

    def __init__(self, store: ReceiverStore, key: bytes, system: SystemId) -> None:
        self._store = store
        self._key = key
        self._system = system
        self._open: dict[tuple[int, int], int] = {}
        saved = store.load()
        self.memory_was_lost = False
        """Whether what was saved could not be read, so that old messages are not told from new."""
        try:
            self._memory = ReceiverMemory() if saved is None else ReceiverMemory.from_bytes(saved)
        except ValueError:
            self._memory = ReceiverMemory()
            self.memory_was_lost = True

    def take(self, data: bytes, now: datetime) -> Complete | OrderReceived | Nothing:
        """Take one message from the satellite; never raises for what is in it.

        Args:
            data: The message.
            now: The robot's clock, against which all orders but SURFACE and HOLD expire.

        Raises:
            OSError: If the store refuses.
        """
        try:
            message = read_mobile_terminated(data, self._key, self._system)
        except WireError as error:
            return Nothing(str(error), is_bad=True)
        if message.ack_seen:
            self._note_told(message.counter)
        match message:
            case Chunk():
                taken = self._chunk(message)
            case Order():
                taken = self._order(message, now)
            case Withdrawal():
                self._raise_floor(message.counter)
                taken = Nothing("missions from before this message are withdrawn")
        self._save()
        return taken

    def pending(self, on_board: PlanHash | None) -> Complete | None:
        """Return the mission that was complete when the robot stopped; call it once at the start.

        Args:
            on_board: The plan on board; if it is that mission, it counts as applied.
        """
        assembly = self._memory.assembly
        if assembly is None or not assembly.is_complete:
            return None
        found = self._completed(assembly)
        self._save()
        if not isinstance(found, Complete):
            return None
        if found.mission.sha256() != on_board:
            return found
        self.applied(found.transfer_id)
        return None

    def applied(self, transfer_id: TransferId) -> None:
        """Note that the mission is on board."""
        self._end(transfer_id, TransferState.APPLIED, Reason.NONE)

    def refused(self, transfer_id: TransferId, reason: str) -> None:
        """Note that the mission was not taken, with the robot's own sentence."""
        self._end(transfer_id, TransferState.REFUSED, Reason.of(reason) or Reason.OTHER)

    def answered(self, command: ReceivedCommand, outcome: CommandOutcome) -> None:
        """Note what came of an order."""
        counter = self._open.pop((command.number, command.expiry_s), None)
        if counter is not None:
            self._remember(Answered(command, counter, outcome))
            self._save()

    def acks(self) -> tuple[TransferAck, ...]:
        """Return what to say of transfers in every record, until the station has seen it."""
        untold = [one.ack for one in reversed(self._memory.ended) if not one.is_told]
        assembly = self._memory.assembly
        if assembly is None:
            return tuple(untold)
        held = frozenset(assembly.data)
        coming = TransferAck(
            assembly.transfer_id, assembly.count, held, TransferState.RECEIVING, Reason.NONE
        )
        return (coming, *untold)

    def answers(self) -> tuple[CommandAnswer, ...]:
        """Return what to say of orders in every record, until the station has seen it."""
        return tuple(one.answer for one in reversed(self._memory.answered) if not one.is_told)

    def next_counter(self) -> int:
        """Return the counter of the next record; each is used once, across restarts too."""
        self._memory.record_counter += 1
        self._save()
        return self._memory.record_counter

    def _chunk(self, chunk: Chunk) -> Complete | Nothing:
        memory = self._memory
        if memory.assembly is not None and chunk.transfer_id == memory.assembly.transfer_id:
            return self._assembled(memory.assembly, chunk)
        known = next(
            (one for one in reversed(memory.ended) if one.transfer_id == chunk.transfer_id), None
        )
        if known is not None and self._is_said_again(known, chunk):
            self._say_again(known, chunk.counter)
            return Nothing("this transfer has ended; its word is said again")
        if chunk.counter <= memory.applied_counter:
            return Nothing("this transfer is older than the mission on board")
        if chunk.counter <= memory.floor_counter:
            self._add_word(_withdrawn(chunk.transfer_id, chunk.counter, chunk.count))
            return Nothing("this transfer was withdrawn")
        if memory.assembly is not None and chunk.counter <= memory.assembly.counter:
            return Nothing("a newer transfer has taken the place of this one")
        memory.ended = [one for one in memory.ended if one is not known]
        memory.assembly = Assembly(
            chunk.transfer_id, chunk.counter, chunk.count, chunk.codec, chunk.start
        )
        return self._assembled(memory.assembly, chunk)

    def _assembled(self, assembly: Assembly, chunk: Chunk) -> Complete | Nothing:
        """Add a chunk to the mission that is coming in.

        Its bytes are the mission's whichever sending brought them; what is to become of the mission
        is said by the newest.
        """
        if (chunk.count, chunk.codec) != (assembly.count, assembly.codec):
            return Nothing("this chunk does not fit the others of its transfer", is_bad=True)
        if chunk.counter > assembly.counter:
            assembly.counter, assembly.start = chunk.counter, chunk.start
        assembly.data[chunk.index] = chunk.data
        if assembly.is_complete:
            return self._completed(assembly)
        return Nothing(f"chunk {chunk.index + 1} of {chunk.count} is there")

    def _is_said_again(self, known: Ended, chunk: Chunk) -> bool:
        """Tell whether a chunk belongs to a transfer that has ended, not to the same wish anew."""
        is_newest = known.counter == self._memory.applied_counter
        if known.state is TransferState.APPLIED and is_newest:
            return True
        return chunk.counter <= max(known.counter, self._memory.applied_counter)

    def _say_again(self, known: Ended, counter: int) -> None:
        memory = self._memory
        if known.state is TransferState.APPLIED and known.counter == memory.applied_counter:
            memory.applied_counter = max(known.counter, counter)
            known_counter = memory.applied_counter
        else:
            known_counter = max(known.counter, counter)
        memory.ended = [
            replace(one, counter=known_counter, is_told=False)
            if one.transfer_id == known.transfer_id
            else one
            for one in memory.ended
        ]

    def _completed(self, assembly: Assembly) -> Complete | Nothing:
        """Check the whole once more; a mission that is none ends its transfer."""
        if transfer_id_of(assembly.packed) != assembly.transfer_id:
            self._end(assembly.transfer_id, TransferState.BAD_HASH, Reason.NONE)
            return Nothing("the chunks together are not what was sent")
        try:
            mission = mission_of(assembly.packed, assembly.codec)
        except WireError as error:
            self._end(assembly.transfer_id, TransferState.BAD_SCHEMA, Reason.NONE)
            return Nothing(str(error))
        start = assembly.start and not self._was_brought_up_after(assembly.counter)
        return Complete(mission, start, assembly.transfer_id)

    def _was_brought_up_after(self, counter: int) -> bool:
        return any(
            one.counter > counter and one.command.kind in _STAYS_UP for one in self._memory.answered
        )

    def _order(self, order: Order, now: datetime) -> OrderReceived | Nothing:
        command, counter = order.command, order.counter
        memory = self._memory
        if command.kind is CommandKind.SURFACE:
            self._raise_floor(counter)
        name = (command.number, command.expiry_s)
        for index, one in enumerate(memory.answered):
            if (one.command.number, one.command.expiry_s) == name:
                memory.answered[index] = replace(
                    one, counter=max(one.counter, counter), is_told=False
                )
                return Nothing("this order was answered; its answer is said again")
        counters = [one.counter for one in memory.answered]
        if len(counters) == _WORDS_KEPT and counter <= min(counters):
            return Nothing("this order is older than all that are remembered")
        is_overtaken = self._is_overtaken(command.kind, counter)
        is_late = command.kind not in _STAYS_UP and now.timestamp() > command.expiry_s
        if is_overtaken or is_late:
            self._remember(Answered(command, counter, self._outcome_unobeyed(command, counter)))
            return Nothing(f"this order was {'overtaken by another' if is_overtaken else 'late'}")
        self._open[name] = counter
        return OrderReceived(command)

    def _is_overtaken(self, kind: CommandKind, counter: int) -> bool:
        """Tell whether an order given later, which takes the place of this one, was answered."""
        later = [one.command.kind for one in self._memory.answered if one.counter >= counter]
        if kind is CommandKind.SURFACE:
            return any(one not in _LEAVES_SURFACE for one in later)
        return bool(later)

    def _outcome_unobeyed(self, command: ReceivedCommand, counter: int) -> CommandOutcome:
        """Return what came of an order that is not acted on; what a later one did holds for it."""
        did_the_same = any(
            one.command.kind is command.kind is CommandKind.SURFACE and one.counter >= counter
            for one in self._memory.answered
            if one.outcome is CommandOutcome.DONE
        )
        return CommandOutcome.DONE if did_the_same else CommandOutcome.NOT_NOW

    def _note_told(self, counter: int) -> None:
        """Stop repeating what the station had seen when it said this."""
        memory = self._memory
        memory.ended = [
            replace(one, is_told=True) if one.counter < counter else one for one in memory.ended
        ]
        memory.answered = [
            replace(one, is_told=True) if one.counter < counter else one for one in memory.answered
        ]

    def _end(self, transfer_id: TransferId, state: TransferState, reason: Reason) -> None:
        """Replace the assembly by the last word on it, in one step."""
        memory = self._memory
        assembly = memory.assembly
        if assembly is None or assembly.transfer_id != transfer_id:
            return
        self._add_word(Ended(transfer_id, assembly.counter, assembly.count, state, reason))
        memory.assembly = None
        if state is TransferState.APPLIED:
            memory.applied_counter = assembly.counter
        self._save()

    def _raise_floor(self, counter: int) -> None:
        """Let no mission that is not newer come on board, nor the one that is coming in."""
        memory = self._memory
        memory.floor_counter = max(memory.floor_counter, counter)
        assembly = memory.assembly
        if assembly is not None and assembly.counter <= counter:
            self._add_word(_withdrawn(assembly.transfer_id, assembly.counter, assembly.count))
            memory.assembly = None

    def _add_word(self, word: Ended) -> None:
        others = [one for one in self._memory.ended if one.transfer_id != word.transfer_id]
        self._memory.ended = [*others, word][-_WORDS_KEPT:]

    def _remember(self, word: Answered) -> None:
        self._memory.answered = [*self._memory.answered, word][-_WORDS_KEPT:]

    def _save(self) -> None:
        self._store.save(self._memory.to_bytes())


def _withdrawn(transfer_id: TransferId, counter: int, count: int) -> Ended:
    return Ended(transfer_id, counter, count, TransferState.REFUSED, Reason.WITHDRAWN)
