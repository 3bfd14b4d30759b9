"""Writes the MAVLink packets of the journal as a telemetry log that other ground stations open.

A ``.tlog`` is a row of records: the time in microseconds from the epoch as an unsigned big-endian
64-bit integer, then one MAVLink frame as it was on the wire. Here the time is the station's clock.
Packets of other wires (satellite records, sentences of an acoustic modem) are left out.
"""

import struct
from collections.abc import Collection, Generator, Iterable

from db.column import microseconds
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.messages import RawFrame

_TIME = struct.Struct(">Q")
_BLOCK_BYTES = 65536


def tlog_blocks(frames: Iterable[RawFrame], without: Collection[str] = ()) -> Generator[bytes]:
    """Yield the log in pieces; packets that are no valid frame of the dialect are left out.

    Those of the messages named by ``without`` are left out, too.
    """
    codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
    block = bytearray()
    for frame in frames:
        at = _TIME.pack(microseconds(frame.at))
        for message in codec.unpack(frame.data).messages:
            if message.get_type() in without:
                continue
            block += at + bytes(message.get_msgbuf())
        if len(block) >= _BLOCK_BYTES:
            yield bytes(block)
            block.clear()
    if block:
        yield bytes(block)
