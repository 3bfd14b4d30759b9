"""DirectIP's messages: bytes in, values out, and back.

A message is ``u8 revision = 1 | u16 length of the rest | element*`` and an element ``u8 id |
u16 length | content``; integers are big endian. Elements come in any order, and one of an
unknown id is passed over. A message that is cut, or longer than it says, is no message.

Source: Iridium, Short Burst Data Service Developers Guide 3.0, chapters 6 and 7. Its table 6-7
prints 20 as the length of the location, which is 11 in every capture, and its table 7.1-11
prints lengths of the headers that do not add up: they are 28 and 25.
"""

import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import IntEnum, IntFlag
from typing import Final

from robot_link.station.gateway.gateway import MobileOriginated, is_imei
from robot_link.station.gateway.push import payload_fault

REVISION: Final = 1
HEAD_BYTES: Final = 3
MESSAGE_BYTES_MAX: Final = 4096
"""More than any message of the protocol; a longer one is not read."""
MO_PAYLOAD_BYTES_MAX: Final = 1960
MT_PAYLOAD_BYTES_MAX: Final = 1890

_HEAD = struct.Struct(">BH")
_MO_HEADER = struct.Struct(">I15sBHHI")
_LOCATION = struct.Struct(">BBHBHI")
_MT_HEADER = struct.Struct(">4s15sH")
_MT_CONFIRMATION = struct.Struct(">4s15sIh")
_MINUTE_MAX = 59_999


class WireError(ValueError):
    """Bytes that are no message; the text says why."""


class ElementId(IntEnum):
    """What an element is."""

    MO_HEADER = 0x01
    MO_PAYLOAD = 0x02
    MO_LOCATION = 0x03
    MO_CONFIRMATION = 0x05
    MT_HEADER = 0x41
    MT_PAYLOAD = 0x42
    MT_CONFIRMATION = 0x44
    MT_PRIORITY = 0x46


class Disposition(IntFlag):
    """What the gateway shall do with a message to a modem."""

    FLUSH = 1
    """Throw away what waits for the modem first."""
    RING_ONLY = 2
    """Ring the modem; there is no payload."""
    UPDATE_LOCATION = 8
    HIGH_PRIORITY = 16
    ASSIGN_MTMSN = 32
    """Take the client id, 1..65535, as the message's sequence number."""


class MtStatus(IntEnum):
    """Answer to a message to a modem; 1..50 is its place in the queue."""

    NO_PAYLOAD = 0
    IMEI_FORMAT = -1
    IMEI_UNKNOWN = -2
    TOO_LARGE = -3
    PAYLOAD_EXPECTED = -4
    QUEUE_FULL = -5
    NO_RESOURCES = -6
    PROTOCOL = -7
    RING_DISABLED = -8
    NOT_ATTACHED = -9
    ADDRESS_REFUSED = -10
    MTMSN_RANGE = -11


@dataclass(frozen=True, slots=True)
class MoHeader:
    """Who sent, and when."""

    reference: int
    """The gateway's own number of the message."""
    imei: str
    session_status: int
    momsn: int
    mtmsn: int
    """0 when the session tried no message to the modem."""
    session_s: int
    """Seconds since 1970, UTC."""


@dataclass(frozen=True, slots=True)
class Location:
    """Where the network believes the modem to be."""

    latitude_deg: float
    longitude_deg: float
    cep_km: int
    """Radius of the circle that holds it in 80 % of cases."""


@dataclass(frozen=True, slots=True)
class MtHeader:
    """Whom a message is for."""

    client_id: bytes
    """Four bytes that the confirmation repeats."""
    imei: str
    disposition: int


@dataclass(frozen=True, slots=True)
class MtConfirmation:
    """The gateway's answer to a message to a modem."""

    client_id: bytes
    imei: str
    reference: int
    """The gateway's own number of the message; 0 when it took none."""
    status: int
    """1..50 place in the queue, else a ``MtStatus``."""


@dataclass(frozen=True, slots=True)
class DirectIpMessage:
    """The elements of one message; None for those that it lacks."""

    mo_header: MoHeader | None = None
    mo_payload: bytes | None = None
    mo_location: Location | None = None
    mo_confirmation: int | None = None
    """1 taken, 0 not taken."""
    mt_header: MtHeader | None = None
    mt_payload: bytes | None = None
    mt_confirmation: MtConfirmation | None = None
    mt_priority: int | None = None


def length_of(head: bytes) -> int:
    """Return how many bytes follow the first three of a message.

    Raises:
        WireError: If they do not begin one.
    """
    revision, length = _HEAD.unpack(head)
    if revision != REVISION:
        raise WireError(f"revision {revision} of the protocol is not {REVISION}")
    if length > MESSAGE_BYTES_MAX:
        raise WireError(f"a message of {length} bytes is longer than any")
    return length


def parse(data: bytes) -> DirectIpMessage:
    """Return the message that ``data`` is, whole and alone.

    Raises:
        WireError: If it is none; the text says why.
    """
    if len(data) < HEAD_BYTES:
        raise WireError(f"{len(data)} bytes are no message")
    length = length_of(data[:HEAD_BYTES])
    if len(data) - HEAD_BYTES != length:
        raise WireError(f"{len(data) - HEAD_BYTES} bytes follow where {length} are announced")
    return _message(_elements(data[HEAD_BYTES:]))


def encode(message: DirectIpMessage) -> bytes:
    """Return the bytes of a message; what tells of the modem comes before its payload.

    Raises:
        ValueError: If a value does not fit its field.
    """
    try:
        body = b"".join(
            _HEAD.pack(kind, len(content)) + content for kind, content in _contents(message)
        )
        return _HEAD.pack(REVISION, len(body)) + body
    except struct.error as error:
        raise ValueError(f"a value does not fit its field: {error}") from error


def read_message(data: bytes, arrived_at: datetime) -> MobileOriginated:
    """Return the robot's message that a gateway delivers.

    A session that failed, or that only looked for messages, has no payload.

    Raises:
        WireError: If it is none; the text says why.
    """
    message = parse(data)
    header = message.mo_header
    if header is None:
        raise WireError("the header of a message from a modem is missing")
    if not is_imei(header.imei):
        raise WireError("the IMEI has not 15 digits")
    place, data = message.mo_location, message.mo_payload or b""
    return MobileOriginated(
        carrier="directip",
        imei=header.imei,
        momsn=header.momsn,
        mtmsn=header.mtmsn or None,
        session_at=datetime.fromtimestamp(header.session_s, UTC),
        arrived_at=arrived_at,
        data=data,
        latitude_deg=None if place is None else place.latitude_deg,
        longitude_deg=None if place is None else place.longitude_deg,
        cep_km=None if place is None else float(place.cep_km),
        session_status=header.session_status,
        fault=payload_fault(data),
    )


def _elements(body: bytes) -> Mapping[int, bytes]:
    elements: dict[int, bytes] = {}
    at = 0
    while at < len(body):
        if len(body) - at < _HEAD.size:
            raise WireError("the message ends within the head of an element")
        kind, length = _HEAD.unpack_from(body, at)
        at += _HEAD.size
        if len(body) - at < length:
            raise WireError(f"element {kind:#04x} of {length} bytes is cut")
        if kind in elements and kind in _KNOWN:
            raise WireError(f"element {kind:#04x} stands twice")
        elements[kind] = body[at : at + length]
        at += length
    return elements


def _message(elements: Mapping[int, bytes]) -> DirectIpMessage:
    for kind, (least, most) in _KNOWN.items():
        content = elements.get(kind)
        if content is not None and not least <= len(content) <= most:
            raise WireError(f"element {kind:#04x} has {len(content)} bytes, not {least} to {most}")
    mo_header = elements.get(ElementId.MO_HEADER)
    location = elements.get(ElementId.MO_LOCATION)
    confirmation = elements.get(ElementId.MO_CONFIRMATION)
    mt_header = elements.get(ElementId.MT_HEADER)
    mt_confirmation = elements.get(ElementId.MT_CONFIRMATION)
    priority = elements.get(ElementId.MT_PRIORITY)
    return DirectIpMessage(
        mo_header=None if mo_header is None else _mo_header(mo_header),
        mo_payload=elements.get(ElementId.MO_PAYLOAD),
        mo_location=None if location is None else _location(location),
        mo_confirmation=None if confirmation is None else confirmation[0],
        mt_header=None if mt_header is None else _mt_header(mt_header),
        mt_payload=elements.get(ElementId.MT_PAYLOAD),
        mt_confirmation=None if mt_confirmation is None else _mt_confirmation(mt_confirmation),
        mt_priority=None if priority is None else int.from_bytes(priority, "big"),
    )


_KNOWN: Final[Mapping[int, tuple[int, int]]] = {
    ElementId.MO_HEADER: (_MO_HEADER.size, _MO_HEADER.size),
    ElementId.MO_PAYLOAD: (0, MO_PAYLOAD_BYTES_MAX),
    ElementId.MO_LOCATION: (_LOCATION.size, _LOCATION.size),
    ElementId.MO_CONFIRMATION: (1, 1),
    ElementId.MT_HEADER: (_MT_HEADER.size, _MT_HEADER.size),
    ElementId.MT_PAYLOAD: (0, MT_PAYLOAD_BYTES_MAX),
    ElementId.MT_CONFIRMATION: (_MT_CONFIRMATION.size, _MT_CONFIRMATION.size),
    ElementId.MT_PRIORITY: (2, 2),
}
"""Fewest and most bytes of each known element."""


def _mo_header(content: bytes) -> MoHeader:
    reference, imei, status, momsn, mtmsn, session_s = _MO_HEADER.unpack(content)
    return MoHeader(reference, imei.decode("latin-1"), status, momsn, mtmsn, session_s)


def _location(content: bytes) -> Location:
    flags, latitude, latitude_minute, longitude, longitude_minute, cep_km = _LOCATION.unpack(
        content
    )
    if flags & 0x0C:
        raise WireError("the location is of an unknown format")
    if latitude_minute > _MINUTE_MAX or longitude_minute > _MINUTE_MAX:
        raise WireError("the location has more than 60 minutes in a degree")
    latitude_deg = latitude + latitude_minute / 60_000
    longitude_deg = longitude + longitude_minute / 60_000
    if latitude_deg > 90 or longitude_deg > 180:
        raise WireError("the location is not on Earth")
    return Location(
        -latitude_deg if flags & 2 else latitude_deg,
        -longitude_deg if flags & 1 else longitude_deg,
        cep_km,
    )


def _mt_header(content: bytes) -> MtHeader:
    client_id, imei, disposition = _MT_HEADER.unpack(content)
    return MtHeader(client_id, imei.decode("latin-1"), disposition)


def _mt_confirmation(content: bytes) -> MtConfirmation:
    client_id, imei, reference, status = _MT_CONFIRMATION.unpack(content)
    return MtConfirmation(client_id, imei.decode("latin-1"), reference, status)


def _contents(message: DirectIpMessage) -> Iterable[tuple[int, bytes]]:
    if (header := message.mo_header) is not None:
        yield (
            ElementId.MO_HEADER,
            _MO_HEADER.pack(
                header.reference,
                _imei(header.imei),
                header.session_status,
                header.momsn,
                header.mtmsn,
                header.session_s,
            ),
        )
    if message.mo_location is not None:
        yield ElementId.MO_LOCATION, _packed_location(message.mo_location)
    if message.mo_payload is not None:
        yield ElementId.MO_PAYLOAD, message.mo_payload
    if message.mo_confirmation is not None:
        yield ElementId.MO_CONFIRMATION, bytes((message.mo_confirmation,))
    if (mt := message.mt_header) is not None:
        yield (
            ElementId.MT_HEADER,
            _MT_HEADER.pack(_client_id(mt.client_id), _imei(mt.imei), mt.disposition),
        )
    if message.mt_priority is not None:
        yield ElementId.MT_PRIORITY, struct.pack(">H", message.mt_priority)
    if message.mt_payload is not None:
        yield ElementId.MT_PAYLOAD, message.mt_payload
    if (answer := message.mt_confirmation) is not None:
        yield (
            ElementId.MT_CONFIRMATION,
            _MT_CONFIRMATION.pack(
                _client_id(answer.client_id), _imei(answer.imei), answer.reference, answer.status
            ),
        )


def _packed_location(location: Location) -> bytes:
    flags = 2 * (location.latitude_deg < 0) + (location.longitude_deg < 0)
    parts: list[int] = []
    for angle_deg in (location.latitude_deg, location.longitude_deg):
        parts += divmod(round(abs(angle_deg) * 60_000), 60_000)
    return _LOCATION.pack(flags, *parts, location.cep_km)


def _imei(text: str) -> bytes:
    data = text.encode("latin-1")
    if len(data) != 15:
        raise ValueError(f"an IMEI has 15 characters, unlike {text!r}")
    return data


def _client_id(data: bytes) -> bytes:
    if len(data) != 4:
        raise ValueError(f"a client id has 4 bytes, not {len(data)}")
    return data
