"""MAVLink 2 frames in datagrams: bytes in, messages out, and back; no input or output.

Every datagram carries whole frames, so nothing is kept from one to the next: a frame that is cut
off or corrupt costs itself alone.
"""

from collections.abc import Iterable
from typing import NamedTuple

from robot_link.mavlink.frame import MAGIC, SIGNATURE_BYTES, frame_bytes
from robot_link.mavlink.signing import Signing
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId

STATION_SYSTEM = SystemId(255)
ROBOT_COMPONENT = grace.MAV_COMP_ID_AUTOPILOT1
STATION_COMPONENT = grace.MAV_COMP_ID_MISSIONPLANNER

WireMessage = grace.MAVLink_message


class Unpacked(NamedTuple):
    """What one datagram held."""

    messages: list[WireMessage]
    bad: int
    """Stretches of bytes that were no valid frame of the dialect."""


class Codec:
    """Frames of one sender and, in the other direction, of anyone.

    With ``signing`` what is packed is signed. Nothing is checked when unpacking: who wants
    signatures asks ``Signing.check`` for each message's own frame.
    """

    def __init__(self, system: SystemId, component: int, signing: Signing | None = None) -> None:
        self._mavlink = grace.MAVLink(None, srcSystem=system, srcComponent=component)
        self._reader = grace.MAVLink(None)
        self._signing = signing
        if signing is not None:
            self._mavlink.signing.secret_key = signing.secret
            self._mavlink.signing.link_id = signing.link
            self._mavlink.signing.sign_outgoing = True

    @property
    def trailer_bytes(self) -> int:
        """Bytes that signing adds to each frame."""
        return 0 if self._signing is None else SIGNATURE_BYTES

    def pack(self, message: WireMessage) -> bytes:
        """Return the frame of a message; frames of one codec are numbered modulo 256."""
        if self._signing is not None:
            self._mavlink.signing.timestamp = self._signing.next_stamp()
        frame = message.pack(self._mavlink)
        self._mavlink.seq = (self._mavlink.seq + 1) % 256
        return frame

    def unpack(self, datagram: bytes) -> Unpacked:
        """Decode every frame of a datagram; what is not a frame is counted, never raised."""
        messages: list[WireMessage] = []
        bad = 0
        offset = 0
        while offset < len(datagram):
            end = _frame_end(datagram, offset)
            message = None if end is None else self._decode(datagram[offset:end])
            if end is None or message is None:
                bad += 1
                found = datagram.find(MAGIC, offset + 1)
                offset = len(datagram) if found < 0 else found
            else:
                messages.append(message)
                offset = end
        return Unpacked(messages, bad)

    def unknown(self, datagram: bytes) -> int:
        """Count the whole frames that follow one another and that the dialect does not know.

        ``unpack`` counts them as bad: their checksum cannot be proved. A vehicle of another maker
        sends such in good faith.
        """
        found = offset = 0
        while offset < len(datagram) and (end := _frame_end(datagram, offset)) is not None:
            message = self._read(datagram[offset:end])
            found += isinstance(message, grace.MAVLink_unknown)
            offset = end
        return found

    def _decode(self, frame: bytes) -> WireMessage | None:
        message = self._read(frame)
        return None if isinstance(message, grace.MAVLink_unknown) else message

    def _read(self, frame: bytes) -> WireMessage | None:
        try:
            return self._reader.decode(bytearray(frame))
        except grace.MAVError:
            return None


def packets(frames: Iterable[bytes], limit: int) -> list[bytes]:
    """Join frames to datagrams of at most ``limit`` bytes, in order; no frame is split.

    A frame that alone is longer than the limit becomes a datagram that the radio will refuse.
    """
    joined: list[bytes] = []
    for frame in frames:
        if joined and len(joined[-1]) + len(frame) <= limit:
            joined[-1] += frame
        else:
            joined.append(frame)
    return joined


def _frame_end(datagram: bytes, offset: int) -> int | None:
    size = frame_bytes(datagram, offset) if datagram[offset] == MAGIC else 0
    return offset + size if size and offset + size <= len(datagram) else None
