"""Everything that takes bytes from outside, with the errors that it may answer with.

``make`` returns a fresh parser, for some keep what they were fed; ``captures`` are real messages
from which bit-flipped ones are made. Behind a code that only the right sender can make lies a
parser too: there the garbage is sealed with the right key.
"""

import contextlib
import json
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial

from robot_link.acoustic import nmea, sentence
from robot_link.mavlink import telemetry
from robot_link.mavlink.codec import ROBOT_COMPONENT, STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.mavlink.command import command_message, received_command
from robot_link.mavlink.decode import decoded, robot_time
from robot_link.mavlink.frame import MavlinkFrameReader
from robot_link.mavlink.mission_item import mission_from_items, mission_items
from robot_link.mavlink.target import target_message
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    CommandKind,
    CommandNumber,
    LogId,
    RobotId,
    SystemId,
)
from robot_link.sample_log import Measurement
from robot_link.satellite import blob as satellite_blob
from robot_link.satellite.chunk import cut, read_mobile_terminated
from robot_link.satellite.frame import WireError, sealed_down, sealed_up
from robot_link.satellite.order import pack_order
from robot_link.satellite.record import (
    MobileOriginatedContent,
    compose,
    read_mobile_originated,
)
from robot_link.service.file_wire import FileRequest, read_file_request, read_listing
from robot_link.station.gateway import cloudloop, directip_wire, rockblock
from robot_link.station.gateway.push import PushRefusal
from robot_link.transport.advice import byte_advice
from robot_link.transport.datagram import Address
from robot_link.transport.uri import LinkUri
from robot_link.transport.xbee_frame import (
    ApiMode,
    FrameReader,
    ReceivePacket,
    TransmitRequest,
    TransmitStatus,
    encode,
    parse_content,
)
from robot_link.transport.xbee_neighbour import (
    NeighbourRadio,
    neighbour_value,
    parse_neighbour,
)
from tests.robot_link.rig import mission
from tests.robot_link.signed_push import form_push, json_push, private_key
from tests.robot_link.target_case import track, tracking_mission
from tests.robot_link.test_cloudloop import lingo
from tests.server.fake_link import state_report

AT = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)
ROBOT, SYSTEM, KEY = RobotId("mini-1"), SystemId(1), bytes(range(32))
SEALED_MAX = 250


@dataclass(frozen=True, slots=True)
class Parser:
    """One way in."""

    name: str
    make: Callable[[], Callable[[bytes], object]]
    captures: tuple[bytes, ...]
    refusals: tuple[type[Exception], ...] = ()
    """What it raises for what it does not take; anything else is a fault."""
    longest: int = 4096
    """Bytes of one message at most; a stream takes any number."""


def catalogue() -> tuple[Parser, ...]:
    """Return every parser of the product."""
    return (*_radio(), *_satellite(), *_gateways(), _acoustic())


def _radio() -> tuple[Parser, ...]:
    robot = Codec(SYSTEM, ROBOT_COMPONENT)
    measurement = Measurement("blue_light", 0.4, (1.0, 0.5, 0.3), 0.05, AT)
    frames = (
        robot.pack(telemetry.state_message(state_report(ROBOT, at=AT))),
        robot.pack(telemetry.sample_message(LogId(1), 7, measurement)),
        *(robot.pack(item) for item in mission_items(mission(), SYSTEM)),
        robot.pack(
            command_message(SYSTEM, CommandKind.SURFACE, CommandNumber(7), AT, None, confirmation=0)
        ),
        robot.pack(command_message(SYSTEM, CommandKind.QUIET, CommandNumber(8), AT, None)),
        robot.pack(target_message(track())),
        b"".join(robot.pack(item) for item in mission_items(tracking_mission(), SYSTEM)),
    )
    packets = (
        ReceivePacket(Address(0x0013A20041F00001), frames[0]),
        TransmitRequest(1, Address(0x0013A20041F00001), frames[1]),
        TransmitStatus(1, 0, 0x21),
    )
    neighbour = NeighbourRadio(Address(0x0013A20041F00001), "mini-1", -52.0)
    file_request = FileRequest(1, 4, data=b"/log/dive-1.csv").octets()
    return (
        Parser("xbee_plain", lambda: _xbee(1), tuple(encode(p.content(), 1) for p in packets)),
        Parser("xbee_escaped", lambda: _xbee(2), tuple(encode(p.content(), 2) for p in packets)),
        Parser("xbee_neighbour", lambda: parse_neighbour, (neighbour_value(neighbour),)),
        Parser("strange_bytes", lambda: partial(byte_advice, LinkUri("xbee:///dev/x")), frames),
        Parser("mavlink_stream", lambda: MavlinkFrameReader().feed, frames),
        Parser("mavlink_datagram", lambda: _datagram, frames),
        Parser("mission_items", lambda: _items, frames, (ValueError,)),
        Parser("file_request", lambda: read_file_request, (file_request,), (ValueError,)),
        Parser("file_listing", lambda: read_listing, (b"Flog.csv\t120\0Dold\0",)),
    )


def _satellite() -> tuple[Parser, ...]:
    blobs = [satellite_blob.Blob.of(one) for one in (mission(), tracking_mission())]
    plain = tuple(map(_plain, blobs))
    deflated = tuple(map(_deflated, plain))
    chunks = [
        chunk for one in blobs for chunk in cut(one, KEY, SYSTEM, 5, start=True, ack_seen=False)
    ]
    orders = [
        pack_order(kind, CommandNumber(9), AT, None, KEY, SYSTEM, 6)
        for kind in (CommandKind.SURFACE, CommandKind.QUIET)
    ]
    down = (*chunks, *orders)
    state = replace(state_report(ROBOT, at=AT))
    records = tuple(
        compose(MobileOriginatedContent(counter=3, state=state, target=one), KEY, SYSTEM, 340)
        for one in (None, track(true_ne_m=(1.5, 0.75)))
    )
    return (
        Parser("mobile_terminated", lambda: _down, down, (WireError,)),
        Parser("mobile_originated", lambda: _up, records, (WireError,)),
        Parser(
            "mobile_terminated_sealed",
            lambda: lambda data: _down(sealed_down(data[:SEALED_MAX], KEY, SYSTEM)),
            tuple(message[:-8] for message in down),
            (WireError,),
            SEALED_MAX,
        ),
        Parser(
            "mobile_originated_sealed",
            lambda: lambda data: _up(sealed_up(data[:SEALED_MAX], KEY, SYSTEM)),
            tuple(record[:-8] for record in records),
            (WireError,),
            SEALED_MAX,
        ),
        Parser("blob_raw", lambda: lambda data: _blob(data, 0), plain, (WireError,)),
        Parser("blob_packed", lambda: lambda data: _blob(data, 1), deflated, (WireError,)),
    )


def _gateways() -> tuple[Parser, ...]:
    message = directip_wire.DirectIpMessage(
        mo_header=directip_wire.MoHeader(7, "300234010753370", 0, 12, 3, int(AT.timestamp())),
        mo_payload=b"hello",
    )
    public_key = private_key().public_key()
    bodies = (form_push(), json_push())

    def push(data: bytes) -> object:
        return rockblock.read_push(data, "application/json", public_key, AT)

    return (
        Parser(
            "directip",
            lambda: lambda data: directip_wire.read_message(data, AT),
            (directip_wire.encode(message),),
            (directip_wire.WireError,),
        ),
        Parser(
            "cloudloop",
            lambda: lambda data: cloudloop.read_push(data, AT),
            (json.dumps(lingo()).encode(),),
            (PushRefusal,),
        ),
        Parser("rockblock", lambda: push, bodies, (PushRefusal,)),
    )


def _acoustic() -> Parser:
    sentences = (
        ("CAMPR", 2, 1, 0.0101),
        ("CAMUA", 1, 2, "1FFF"),
        ("SNTTA", 0.1, "", 0.3, "", "120000.00"),
        ("CAREV", "120000", "INIT", "0.94"),
        ("CAERR", "120000", "DATA_TIMEOUT", 3),
    )
    stream = b"".join(nmea.encode(fields) for fields in sentences)
    return Parser("acoustic", _sentences, (stream, *map(nmea.encode, sentences)))


def _sentences() -> Callable[[bytes], object]:
    reader = nmea.SentenceReader()

    def feed(data: bytes) -> object:
        heard = []
        for fields in reader.feed(data)[0]:
            with contextlib.suppress(ValueError):
                heard.append(sentence.meaning(fields))
        return heard

    return feed


def _xbee(mode: ApiMode) -> Callable[[bytes], object]:
    reader = FrameReader(mode)
    return lambda data: [parse_content(content) for content in reader.feed(data)]


def _datagram(data: bytes) -> object:
    messages = Codec(STATION_SYSTEM, STATION_COMPONENT).unpack(data).messages
    robot_time(messages)
    for message in messages:
        try:
            decoded(message, ROBOT, AT)
        except ValueError:
            continue
        if isinstance(message, grace.MAVLink_command_long_message):
            received_command(message)
    return messages


def _items(data: bytes) -> object:
    messages = Codec(STATION_SYSTEM, STATION_COMPONENT).unpack(data).messages
    return mission_from_items(
        [one for one in messages if isinstance(one, grace.MAVLink_mission_item_int_message)]
    )


def _down(data: bytes) -> object:
    return read_mobile_terminated(data, KEY, SYSTEM)


def _up(data: bytes) -> object:
    return read_mobile_originated(data, KEY, SYSTEM, ROBOT, AT)


def _plain(blob: satellite_blob.Blob) -> bytes:
    is_deflated = blob.codec == satellite_blob.BlobCodec.DEFLATE
    return zlib.decompress(blob.packed, -15) if is_deflated else blob.packed


def _deflated(plain: bytes) -> bytes:
    deflater = zlib.compressobj(9, zlib.DEFLATED, -15)
    return deflater.compress(plain) + deflater.flush()


def _blob(data: bytes, codec: int) -> object:
    return satellite_blob.mission_of(data, codec)
