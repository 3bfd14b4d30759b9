"""Orders: a command in one message of 28 bytes, which costs one credit.

An order, big endian, before the code of ``frame``:

    u8   version << 4 | 2
    u8   flags: bit 4 acknowledgements seen
    u32  counter
    u8   kind: 1 surface, 2 hold, 3 resume, 4 start, 5 quiet, 6 ping
    u24  number of the command, by every link the same
    u32  second since 1970 at which it expires; with the number its name
    u48  first 12 hexadecimal digits of the hash of START's plan, else 0
"""

import struct
from dataclasses import dataclass
from datetime import datetime

from robot_link.mavlink.command import PLAN_DIGITS, ReceivedCommand
from robot_link.messages import CommandKind, CommandNumber, PlanHash, SystemId
from robot_link.satellite.frame import (
    ACK_SEEN,
    MessageType,
    WireError,
    check_counter,
    first_byte,
    sealed_down,
)

_BODY = struct.Struct(">BBIB3sI6s")
_NUMBER_BYTES = 3
_NUMBER_MAX = 2 ** (8 * _NUMBER_BYTES) - 1
_SECOND_MAX = 2**32 - 1
_CODES = {
    CommandKind.SURFACE: 1,
    CommandKind.HOLD: 2,
    CommandKind.RESUME: 3,
    CommandKind.START: 4,
    CommandKind.QUIET: 5,
    CommandKind.PING: 6,
}
_KINDS = {code: kind for kind, code in _CODES.items()}


@dataclass(frozen=True, slots=True)
class Order:
    """A command, with the counter that keeps an old one from being said again."""

    command: ReceivedCommand
    counter: int
    ack_seen: bool
    """Whether the station has seen the final word on every transfer and order before this one."""


def pack_order(
    kind: CommandKind,
    number: CommandNumber,
    expires: datetime,
    plan: PlanHash | None,
    key: bytes,
    system: SystemId,
    counter: int,
    *,
    ack_seen: bool = False,
) -> bytes:
    """Return the message that carries a command.

    Args:
        kind: What to do.
        number: The command's number, by every carrier the same; with ``expires`` its name.
        expires: When it is too late, but for SURFACE and HOLD; whole seconds count.
        plan: Plan that START names.
        key: The robot's key.
        system: The robot's MAVLink system id.
        counter: Newer than of every transfer and order before (``ground.next_counter``).
        ack_seen: The station has seen the final word on every transfer and order before.

    Raises:
        ValueError: If number, expiry or counter do not fit, or START names no plan.
    """
    if (kind is CommandKind.START) != (plan is not None):
        raise ValueError("START names a plan, and no other command does")
    expiry_s = int(expires.timestamp())
    if not (0 < number <= _NUMBER_MAX and 0 <= expiry_s <= _SECOND_MAX):
        raise ValueError(f"command {number} that expires {expires} cannot travel")
    check_counter(counter)
    digits = "0" * PLAN_DIGITS if plan is None else plan[:PLAN_DIGITS]
    body = _BODY.pack(
        first_byte(MessageType.ORDER),
        ACK_SEEN * ack_seen,
        counter,
        _CODES[kind],
        number.to_bytes(_NUMBER_BYTES, "big"),
        expiry_s,
        bytes.fromhex(digits),
    )
    return sealed_down(body, key, system)


def read_order(body: bytes) -> Order:
    """Read an order whose code was checked.

    Raises:
        WireError: If it is none.
    """
    if len(body) != _BODY.size:
        raise WireError(f"an order has {_BODY.size} bytes, not {len(body)}")
    _, flags, counter, code, number, expiry_s, digits = _BODY.unpack(body)
    kind = _KINDS.get(code)
    if kind is None or flags & ~ACK_SEEN or not any(number):
        raise WireError("kind, flags or number of an order are unknown")
    if kind is not CommandKind.START and any(digits):
        raise WireError(f"the order to {kind} names a plan")
    command = ReceivedCommand(
        kind=kind,
        number=CommandNumber(int.from_bytes(number, "big")),
        expiry_s=expiry_s,
        plan_digits=digits.hex() if kind is CommandKind.START else "",
    )
    return Order(command, counter, bool(flags & ACK_SEEN))
