"""Withdrawals: no mission from before this message shall come alive any more.

A gateway keeps messages for five days, so chunks of a mission that nobody wants any longer may
still arrive. A withdrawal, big endian, before the code of ``frame``, 14 bytes and one credit:

    u8   version << 4 | 4
    u8   flags: bit 4 acknowledgements seen
    u32  counter; missions whose counter is not newer are refused
"""

import struct
from dataclasses import dataclass

from robot_link.messages import SystemId
from robot_link.satellite.frame import (
    ACK_SEEN,
    MessageType,
    WireError,
    check_counter,
    first_byte,
    sealed_down,
)

_BODY = struct.Struct(">BBI")


@dataclass(frozen=True, slots=True)
class Withdrawal:
    """The end of every mission that is not newer and not on board yet."""

    counter: int
    ack_seen: bool
    """Whether the station has seen the final word on every transfer and order before this one."""


def pack_withdrawal(counter: int, key: bytes, system: SystemId, *, ack_seen: bool = False) -> bytes:
    """Return the message that ends every mission which is not newer and not on board yet.

    Args:
        counter: Newer than of every transfer and order before (``ground.next_counter``).
        key: The robot's key.
        system: The robot's MAVLink system id.
        ack_seen: The station has seen the final word on every transfer and order before.

    Raises:
        ValueError: If the counter does not fit.
    """
    check_counter(counter)
    body = _BODY.pack(first_byte(MessageType.WITHDRAWAL), ACK_SEEN * ack_seen, counter)
    return sealed_down(body, key, system)


def read_withdrawal(body: bytes) -> Withdrawal:
    """Read a withdrawal whose code was checked.

    Raises:
        WireError: If it is none.
    """
    if len(body) != _BODY.size:
        raise WireError(f"a withdrawal has {_BODY.size} bytes, not {len(body)}")
    _, flags, counter = _BODY.unpack(body)
    if flags & ~ACK_SEEN:
        raise WireError(f"flags {flags:#x} of a withdrawal are unknown")
    return Withdrawal(counter, bool(flags & ACK_SEEN))
