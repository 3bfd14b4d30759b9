"""DirectIP messages as the gateway writes and reads them; all integers are big endian.

A message is ``u8 1 | u16 length of the rest | elements``; an element is ``u8 id | u16 length |
bytes``.

``robot_link.station.gateway.directip_wire`` describes the same wire for the station. The two share
nothing: each is written from the guide, so that one program's mistake cannot hide in the other's.

Source: Iridium Short Burst Data Service Developers Guide 3.0, sections 6 and 7. Its table 6-7
prints 20 bytes for the location; messages of the real gateway have 11.
"""

import struct
from dataclasses import dataclass

from simulator.iridium.session import MobileOriginatedMessage

REVISION = 1
HEAD = struct.Struct(">BH")
MO_CONFIRMATION = bytes.fromhex("01 0004 05 0001 01")
"""What a customer answers who confirms."""

FLUSH, RING_ONLY, UPDATE_LOCATION, HIGH_PRIORITY, ASSIGN_MTMSN = 1, 2, 8, 16, 32

_MO_HEADER, _MO_PAYLOAD, _MO_LOCATION = 0x01, 0x02, 0x03
_MT_HEADER, _MT_PAYLOAD, _MT_CONFIRMATION, _MT_PRIORITY = 0x41, 0x42, 0x44, 0x46
_WEST, _SOUTH = 1, 2
_MINUTE_PARTS = 60000
"""Thousandths of a minute in a degree."""
_PRIORITIES = range(1, 6)
_LOWEST = 5

_MO_HEADER_LAYOUT = struct.Struct(">I15sBHHI")
_LOCATION_LAYOUT = struct.Struct(">BBHBHI")
_MT_HEADER_LAYOUT = struct.Struct(">4s15sH")
_CONFIRMATION_LAYOUT = struct.Struct(">4s15sIh")


class WireError(Exception):
    """Bytes that are no DirectIP message to a modem."""


@dataclass(frozen=True, slots=True)
class MobileTerminatedRequest:
    """What a customer asks for."""

    client_id: bytes
    imei: bytes
    """15 bytes; digits, if the customer is right."""
    disposition: int
    priority: int
    data: bytes | None
    """None where there is no payload."""

    def has(self, flag: int) -> bool:
        """Say whether a disposition flag is set."""
        return bool(self.disposition & flag)


def pack_mobile_originated(message: MobileOriginatedMessage) -> bytes:
    """Return the bytes that tell a customer of a session."""
    header = _MO_HEADER_LAYOUT.pack(
        message.record_id,
        message.imei.encode("ascii"),
        message.session_status,
        message.momsn,
        message.mtmsn,
        int(message.session_at.timestamp()),
    )
    latitude, latitude_parts = _split(message.latitude_deg)
    longitude, longitude_parts = _split(message.longitude_deg)
    flags = _WEST * (message.longitude_deg < 0) | _SOUTH * (message.latitude_deg < 0)
    location = _LOCATION_LAYOUT.pack(
        flags, latitude, latitude_parts, longitude, longitude_parts, message.cep_km
    )
    body = _element(_MO_HEADER, header) + _element(_MO_LOCATION, location)
    if message.data:
        body += _element(_MO_PAYLOAD, message.data)
    return HEAD.pack(REVISION, len(body)) + body


def read_mobile_terminated(body: bytes) -> MobileTerminatedRequest:
    """Read the elements of a message to a modem, in any order; unknown ones are skipped.

    Raises:
        WireError: If an element is cut, has a wrong length, or the header is missing.
    """
    elements = _elements(body)
    header = elements.get(_MT_HEADER)
    if header is None or len(header) != _MT_HEADER_LAYOUT.size:
        raise WireError("no header")
    client_id, imei, disposition = _MT_HEADER_LAYOUT.unpack(header)
    priority = int.from_bytes(elements.get(_MT_PRIORITY, b""), "big")
    return MobileTerminatedRequest(
        client_id,
        imei,
        disposition,
        priority if priority in _PRIORITIES else _LOWEST,
        elements.get(_MT_PAYLOAD),
    )


def pack_confirmation(client_id: bytes, imei: bytes, message_id: int, status: int) -> bytes:
    """Return the bytes that tell a customer what became of its message."""
    content = _CONFIRMATION_LAYOUT.pack(client_id, imei, message_id, status)
    body = _element(_MT_CONFIRMATION, content)
    return HEAD.pack(REVISION, len(body)) + body


def _elements(body: bytes) -> dict[int, bytes]:
    elements: dict[int, bytes] = {}
    while body:
        if len(body) < HEAD.size:
            raise WireError("a cut element")
        number, length = HEAD.unpack_from(body)
        content, body = body[HEAD.size : HEAD.size + length], body[HEAD.size + length :]
        if len(content) != length:
            raise WireError("a cut element")
        elements[number] = content
    return elements


def _element(number: int, content: bytes) -> bytes:
    return HEAD.pack(number, len(content)) + content


def _split(angle_deg: float) -> tuple[int, int]:
    """Return whole degrees and thousandths of minutes of an angle without its sign."""
    return divmod(round(abs(angle_deg) * _MINUTE_PARTS), _MINUTE_PARTS)
