"""The one place where a URI picks the transport.

=================================================  ================================================
``xbee:///dev/ttyUSB0?baud=115200&ap=1&rate=10k``  an XBee in API mode at a serial line
``xbee://host:port?ap=2``                          one behind a serial server or an emulated one
``serial:///dev/ttyUSB0?baud=57600``               MAVLink on a serial line
``udp://host:port``, ``udp://0.0.0.0:14550?listen=1``   MAVLink over UDP
``tcp://host:port``, ``tcp://0.0.0.0:5760?listen=1``    MAVLink over TCP
=================================================  ================================================
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, Protocol

from robot_link.transport.datagram import DatagramTransport
from robot_link.transport.serial_line import serial_line
from robot_link.transport.shelf import Place, Shelf
from robot_link.transport.tcp import tcp_link
from robot_link.transport.udp import udp_link
from robot_link.transport.uri import LinkUri
from robot_link.transport.xbee import xbee_radio

_OPENERS: Final[Mapping[str, Callable[[LinkUri], "PlacedTransport"]]] = MappingProxyType(
    {"xbee": xbee_radio, "serial": serial_line, "udp": udp_link, "tcp": tcp_link}
)
RADIO_SCHEMES: Final = tuple(_OPENERS)
"""Kinds of link that carry MAVLink."""


class PlacedTransport(DatagramTransport, Protocol):
    """A transport whose line may come from a shelf, and be left there."""

    place: Place


def is_radio(uri: str) -> bool:
    """Tell whether a link is of a kind that carries MAVLink."""
    return uri.partition(":")[0] in RADIO_SCHEMES


def open_transport(uri: str, shelf: Shelf | None = None) -> DatagramTransport:
    """Return the transport that a URI names; ``run`` opens it. Each kind's file says more.

    Args:
        uri: The link.
        shelf: Where its line may be open already, and where it is left when it is let go.

    Raises:
        ValueError: If the URI names no transport; the message says what is wrong with it.
    """
    link = LinkUri(uri)
    opener = _OPENERS.get(link.scheme)
    if opener is None:
        known = ", ".join(RADIO_SCHEMES)
        link.refuse(f"unknown kind of link {link.scheme!r}; known are {known}")
    transport = opener(link)
    transport.place = Place(uri, shelf)
    return transport
