"""Sentences for people who watch a robot through another maker's ground station."""

import zlib

from robot_link.mavlink.wire import grace

_CHUNK_BYTES = 50


def status_texts(
    text: str, severity: int = grace.MAV_SEVERITY_WARNING
) -> list[grace.MAVLink_statustext_message]:
    """Return the messages that carry a sentence; a long one is cut into numbered pieces."""
    octets = text.encode("ascii", errors="replace")
    pieces = [octets[at : at + _CHUNK_BYTES] for at in range(0, len(octets), _CHUNK_BYTES)]
    identity = zlib.crc32(octets) % 65535 + 1 if len(pieces) > 1 else 0
    messages = [
        grace.MAVLink_statustext_message(severity, piece, identity, number)
        for number, piece in enumerate(pieces)
    ]
    if len(pieces) > 1 and len(pieces[-1]) == _CHUNK_BYTES:
        messages.append(grace.MAVLink_statustext_message(severity, b"", identity, len(pieces)))
    return messages
