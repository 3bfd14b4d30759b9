"""The one place where a URI picks the transport."""

from typing import Final
from urllib.parse import parse_qsl, urlsplit

from robot_link.transport.datagram import DatagramTransport
from robot_link.transport.port import Port, SerialPort, TcpPort
from robot_link.transport.xbee import XBeeTransport

RADIO_SCHEMES: Final = ("xbee",)
"""Kinds of link that carry MAVLink."""


def is_radio(uri: str) -> bool:
    """Tell whether a link is of a kind that carries MAVLink."""
    return uri.partition("://")[0] in RADIO_SCHEMES


def open_transport(uri: str) -> DatagramTransport:
    """Return the transport that a URI names; ``run`` opens it.

    ``xbee:///dev/ttyUSB0?baud=115200`` is a serial line or pseudo-terminal,
    ``xbee://127.0.0.1:5000`` a TCP port. Options: ``ap`` 1 or 2 (the radio's API mode), for a
    serial line also ``baud`` and ``rtscts`` 0 or 1.

    Raises:
        ValueError: If the URI names no transport; the message says what is wrong with it.
    """
    parts = urlsplit(uri)
    if parts.scheme != "xbee":
        raise ValueError(f"{uri}: unknown kind of link {parts.scheme!r}; xbee is known")
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    mode = _choice(uri, options, "ap", 1)
    if mode not in (1, 2):
        raise ValueError(f"{uri}: ap must be 1 or 2")
    if parts.netloc:
        host, port = parts.hostname, parts.port
        if not host or not port:
            raise ValueError(f"{uri}: a TCP link needs host and port")

        async def connect() -> Port:
            return await TcpPort.open(host, port)

        opener = connect
    else:
        baud = _choice(uri, options, "baud", 115200)
        flow_control = bool(_choice(uri, options, "rtscts", 0))
        if not parts.path:
            raise ValueError(f"{uri}: a serial link needs the path of its line")

        async def open_line() -> Port:
            return await SerialPort.open(parts.path, baud=baud, flow_control=flow_control)

        opener = open_line
    if options:
        raise ValueError(f"{uri}: unknown option {', '.join(options)}")
    return XBeeTransport(opener, mode)


def _choice(uri: str, options: dict[str, str], name: str, default: int) -> int:
    """Take a whole number out of the options."""
    text = options.pop(name, str(default))
    if not text.isdecimal():
        raise ValueError(f"{uri}: {name} must be a whole number, not {text!r}")
    return int(text)
