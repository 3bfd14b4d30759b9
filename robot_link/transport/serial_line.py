"""MAVLink on a serial line, ``serial:///dev/ttyUSB0?baud=57600``.

The wire: 8 data bits, no parity, one stop bit, at ``baud`` (57600 where the URI does not say);
with ``rtscts=1`` the RTS and CTS lines stop whoever is too fast. On it, nothing but MAVLink 2
frames (see ``mavlink_stream``). A cable to an autopilot, a telemetry radio, or a pair of XBees in
transparent mode look like this. Of a transparent radio pair nobody can say who speaks, whether a
frame arrived or how strong the signal is: it suits a single robot.

A pseudo-terminal serves as a line. Only one program at a time may have it open.
"""

from robot_link.mavlink.frame import LONGEST_FRAME_BYTES
from robot_link.transport.mavlink_stream import MavlinkStream
from robot_link.transport.port import Port, SerialPort
from robot_link.transport.uri import LinkUri

DEFAULT_BAUD = 57600
_BITS_PER_BYTE = 10
"""Start bit, eight data bits, stop bit."""
_TELEMETRY_SHARE = 0.5
"""The other half is for commands, transfers and what is repeated."""


def serial_line(uri: LinkUri) -> MavlinkStream:
    """Return the transport of a serial line.

    Raises:
        ValueError: If the URI names none.
    """
    path = uri.line()
    baud = uri.whole("baud", DEFAULT_BAUD, 300, 4_000_000)
    flow_control = uri.switch("rtscts")
    uri.finish()

    async def opened() -> Port:
        return await SerialPort.open(path, baud=baud, flow_control=flow_control)

    return MavlinkStream(
        "serial",
        opened,
        bytes_per_s=_TELEMETRY_SHARE * baud / _BITS_PER_BYTE,
        frame_bytes=LONGEST_FRAME_BYTES,
    )
