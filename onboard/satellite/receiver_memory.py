"""What the robot's end of the satellite must not forget, as one value that is saved whole."""

import base64
import json
from dataclasses import dataclass, field
from typing import Any, Self

from robot_link.mavlink.command import ReceivedCommand
from robot_link.messages import CommandKind, CommandNumber
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import BlobCodec, TransferId
from robot_link.satellite.content import (
    CommandAnswer,
    Reason,
    TransferAck,
    TransferState,
    sending_of,
)


@dataclass
class Assembly:
    """A mission that is coming in."""

    transfer_id: TransferId
    counter: int
    count: int
    codec: BlobCodec
    start: bool
    data: dict[int, bytes] = field(default_factory=dict[int, bytes])

    @property
    def is_complete(self) -> bool:
        """Whether every chunk is there."""
        return len(self.data) == self.count

    @property
    def packed(self) -> bytes:
        """The blob, once it is complete."""
        return b"".join(self.data[index] for index in range(self.count))


@dataclass(frozen=True, slots=True)
class Ended:
    """The last word on a transfer."""

    transfer_id: TransferId
    counter: int
    count: int
    state: TransferState
    reason: Reason = Reason.NONE
    is_told: bool = False
    """Whether the station has seen it."""

    @property
    def ack(self) -> TransferAck:
        """The word as it travels."""
        everything = frozenset(range(self.count))
        return TransferAck(
            self.transfer_id,
            self.count,
            everything,
            self.state,
            self.reason,
            sending_of(self.counter),
        )


@dataclass(frozen=True, slots=True)
class Answered:
    """The last word on an order."""

    command: ReceivedCommand
    counter: int
    outcome: CommandOutcome
    is_told: bool = False
    """Whether the station has seen it."""

    @property
    def answer(self) -> CommandAnswer:
        """The word as it travels."""
        return CommandAnswer(self.command.number, self.outcome)


@dataclass
class ReceiverMemory:
    """All that survives a restart."""

    assembly: Assembly | None = None
    ended: list[Ended] = field(default_factory=list[Ended])
    """Words on transfers, the newest last."""
    answered: list[Answered] = field(default_factory=list[Answered])
    """Words on orders, the newest last."""
    applied_counter: int = -1
    """Of the mission that was applied last; older ones are history."""
    floor_counter: int = -1
    """Of the newest withdrawal or order to surface; no mission that is not newer is applied."""
    record_counter: int = 0
    """Of the newest record."""

    def to_bytes(self) -> bytes:
        """Return it to be saved."""
        assembly = self.assembly
        document = {
            "assembly": None if assembly is None else _assembly_document(assembly),
            "ended": [
                [one.transfer_id, one.counter, one.count, one.state, one.reason, one.is_told]
                for one in self.ended
            ],
            "answered": [
                [
                    one.command.kind.value,
                    one.command.number,
                    one.command.expiry_s,
                    one.command.plan_digits,
                    one.counter,
                    one.outcome.value,
                    one.is_told,
                ]
                for one in self.answered
            ],
            "applied_counter": self.applied_counter,
            "floor_counter": self.floor_counter,
            "record_counter": self.record_counter,
        }
        return json.dumps(document).encode()

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """Rebuild it.

        Raises:
            ValueError: If the bytes are no such memory.
        """
        try:
            document = json.loads(data)
            held = document["assembly"]
            return cls(
                assembly=None if held is None else _assembly(held),
                ended=[_ended(*one) for one in document["ended"]],
                answered=[_answered(*one) for one in document["answered"]],
                applied_counter=int(document["applied_counter"]),
                floor_counter=int(document["floor_counter"]),
                record_counter=int(document["record_counter"]),
            )
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError("the memory of satellite messages cannot be read") from error


def _assembly_document(assembly: Assembly) -> dict[str, Any]:
    return {
        "transfer_id": assembly.transfer_id,
        "counter": assembly.counter,
        "count": assembly.count,
        "codec": assembly.codec,
        "start": assembly.start,
        "data": {
            str(index): base64.b64encode(data).decode() for index, data in assembly.data.items()
        },
    }


def _assembly(document: dict[str, Any]) -> Assembly:
    return Assembly(
        transfer_id=TransferId(int(document["transfer_id"])),
        counter=int(document["counter"]),
        count=int(document["count"]),
        codec=BlobCodec(document["codec"]),
        start=bool(document["start"]),
        data={int(index): base64.b64decode(data) for index, data in document["data"].items()},
    )


def _ended(
    transfer_id: int, counter: int, count: int, state: int, reason: int, is_told: bool
) -> Ended:
    return Ended(
        TransferId(transfer_id), counter, count, TransferState(state), Reason(reason), is_told
    )


def _answered(
    kind: str,
    number: int,
    expiry_s: int,
    plan_digits: str,
    counter: int,
    outcome: str,
    is_told: bool,
) -> Answered:
    command = ReceivedCommand(CommandKind(kind), CommandNumber(number), expiry_s, plan_digits)
    return Answered(command, counter, CommandOutcome(outcome), is_told)
