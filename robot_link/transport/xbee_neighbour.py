"""What a radio says of the other radios of its network when it is asked who is there (ND)."""

from dataclasses import dataclass
from typing import Final

from robot_link.transport.datagram import Address

REPORT_STRENGTH: Final = 0x04
"""Bit of the NO parameter that appends the strength of the last hop to each answer."""

_ADDRESS_AT: Final = 2
_NAME_AT: Final = 10
_BEHIND_NAME: Final = 8
"""Parent u16, device type, status, profile u16, manufacturer u16."""
_DEVICE_IDENTIFIER: Final = 4
"""Stands before the strength where bit 0 of the NO parameter is set."""


@dataclass(frozen=True, slots=True)
class NeighbourRadio:
    """One radio that answered."""

    address: Address
    node_id: str
    """Its name, the NI parameter."""
    rssi_dbm: float | None
    """Strength of its answer, None where the radio does not tell."""


def parse_neighbour(value: bytes) -> NeighbourRadio | None:
    """Return the radio that one ND answer names; None for one that is cut short.

    The answer is ``MY u16 | SH u32 | SL u32 | NI, zero-terminated | parent u16 | device type |
    status | profile u16 | manufacturer u16 [| device identifier u32] [| strength]``, big endian;
    the strength is in -dBm.
    """
    end = value.find(0, _NAME_AT)
    if end < 0:
        return None
    tail = value[end + 1 :]
    extra = len(tail) - _BEHIND_NAME
    if extra not in (0, 1, _DEVICE_IDENTIFIER, _DEVICE_IDENTIFIER + 1):
        return None
    has_strength = extra in (1, _DEVICE_IDENTIFIER + 1)
    return NeighbourRadio(
        Address(int.from_bytes(value[_ADDRESS_AT:_NAME_AT], "big")),
        value[_NAME_AT:end].decode("ascii", "replace"),
        -float(tail[-1]) if has_strength else None,
    )


def neighbour_value(radio: NeighbourRadio) -> bytes:
    """Return the ND answer that names a radio."""
    answer = (
        b"\xff\xfe"
        + radio.address.to_bytes(8, "big")
        + radio.node_id.encode("ascii", "replace")
        + b"\0\xff\xfe\x01\x00\xc1\x05\x10\x1e"
    )
    return answer if radio.rssi_dbm is None else answer + bytes((round(-radio.rssi_dbm),))
