"""A link's URI picks its transport, or says what is wrong with it."""

import math

import pytest

from robot_link.station.path import RadioPath
from robot_link.transport.mavlink_stream import MavlinkStream
from robot_link.transport.opening import is_radio, open_transport
from robot_link.transport.tcp import TcpListener
from robot_link.transport.udp import UdpTransport
from robot_link.transport.xbee import XBeeTransport


@pytest.mark.parametrize(
    ("uri", "kind", "carrier"),
    [
        ("xbee:///dev/ttyUSB0?baud=9600&ap=2&rtscts=1&rate=10k", XBeeTransport, "xbee"),
        ("xbee://127.0.0.1:5000?rate=200k", XBeeTransport, "xbee"),
        ("xbee:///dev/ttyUSB0#0013A20041F00002", XBeeTransport, "xbee"),
        ("serial:///dev/ttyUSB0?baud=57600&rtscts=0", MavlinkStream, "serial"),
        ("udp://127.0.0.1:14550", UdpTransport, "udp"),
        ("udp://0.0.0.0:14550?listen=1", UdpTransport, "udp"),
        ("tcp://[::1]:5760", MavlinkStream, "tcp"),
        ("tcp://127.0.0.1:5760?listen=1", TcpListener, "tcp"),
    ],
)
def test_every_kind_of_radio_is_opened_by_its_uri(uri: str, kind: type, carrier: str):
    transport = open_transport(uri)
    assert isinstance(transport, kind)
    assert transport.carrier == carrier
    assert transport.max_payload == 0, "a port is closed until it runs"
    assert transport.is_enabled
    assert is_radio(uri)


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("rockblock://300234010753370", "unknown kind of link 'rockblock'"),
        ("", "unknown kind of link ''"),
        ("/dev/ttyUSB0", "unknown kind of link ''"),
        ("serial://", "needs the path of its line"),
        ("serial:///", "needs the path of its line"),
        ("serial://dev/ttyUSB0", "three slashes"),
        ("serial:///dev/ttyUSB0?baud=57k", "baud must be a whole number, not '57k'"),
        ("serial:///dev/ttyUSB0?baud=1", "baud must be 300 to 4000000, not 1"),
        ("serial:///dev/ttyUSB0?baud=²", "whole number"),
        (f"serial:///dev/ttyUSB0?baud={'9' * 5000}", "baud must be 300"),
        ("serial:///dev/ttyUSB0?baud=9600&baud=57600", "baud is given twice"),
        ("serial:///dev/ttyUSB0?rtscts=yes", "rtscts must be 0 or 1, not 'yes'"),
        ("serial:///dev/ttyUSB0?ap=1", "unknown option ap"),
        ("udp://127.0.0.1", "a UDP link needs host and port"),
        ("udp://:14550", "a UDP link needs host and port"),
        ("udp://127.0.0.1:99999", "[Pp]ort"),
        ("tcp://grace..local:5760", "cannot be the name of a machine"),
        (f"udp://{'a' * 70}.local:5760", "cannot be the name of a machine"),
        ("xbee://grace..local:5760", "cannot be the name of a machine"),
        ("tcp://grace\0local:5760", "spaces and control characters"),
        ("serial:///dev/tty USB0", "spaces and control characters"),
        ("udp://127.0.0.1:port", "[Pp]ort"),
        ("udp://127.0.0.1:1/x", "a UDP link has no path"),
        ("udp://127.0.0.1:1?listen=2", "listen must be 0 or 1"),
        ("udp://127.0.0.1:1#2", "only a radio of an XBee network"),
        ("tcp://me@127.0.0.1:1", "no user name"),
        ("tcp://[::1:5760", "IPv6"),
        ("tcp:///dev/ttyUSB0", "a TCP link needs host and port"),
        ("xbee:///dev/ttyUSB0?rate=9600", "rate must be 10k or 200k, not '9600'"),
        ("xbee:///dev/ttyUSB0#robot", "1 to 16 hexadecimal digits, not 'robot'"),
        ("xbee:///dev/ttyUSB0#00000013A20041F00002", "1 to 16 hexadecimal digits"),
    ],
)
def test_a_wrong_uri_is_refused_with_what_is_wrong(uri: str, complaint: str):
    with pytest.raises(ValueError, match=complaint) as refusal:
        open_transport(uri)
    assert str(refusal.value).startswith(uri[:20])


def test_what_a_link_carries_follows_from_its_speed():
    assert open_transport("xbee:///dev/x?rate=10k").bytes_per_s == 300
    assert open_transport("xbee:///dev/x?rate=200k").bytes_per_s > 300
    slow = open_transport("serial:///dev/x?baud=1200").bytes_per_s
    assert 0 < slow < 1200 / 10
    assert open_transport("serial:///dev/x?baud=57600").bytes_per_s == pytest.approx(48 * slow)
    assert open_transport("udp://127.0.0.1:1").bytes_per_s == math.inf
    assert open_transport("tcp://127.0.0.1:1").bytes_per_s == math.inf


def test_radios_of_one_network_share_the_port_and_keep_their_names():
    first = RadioPath.of("xbee:///dev/x?rate=10k#0013A20041F00001")
    second = RadioPath.of("xbee:///dev/x?rate=10k#2")
    assert first.transport_uri == second.transport_uri == "xbee:///dev/x?rate=10k"
    assert (first.address, second.address) == (0x0013A20041F00001, 2)
    assert RadioPath.of("udp://127.0.0.1:1").address is None
    with pytest.raises(ValueError, match="only a radio of an XBee network"):
        RadioPath.of("udp://127.0.0.1:1#1")


def test_satellite_links_are_no_radios():
    assert not is_radio("rockblock://300234010753370")
    assert not is_radio("micromodem:///dev/ttyUSB1?us=1&peer=2")
