"""The XBee at the station's port: API frames on one side, the air on the other."""

import asyncio
from collections.abc import Callable
from typing import Final

from robot_link.transport.datagram import Address, Delivery, Fate
from robot_link.transport.xbee_frame import (
    ApiMode,
    AtCommand,
    AtReply,
    AtStatus,
    Frame,
    FrameReader,
    ReceivePacket,
    TransmitCode,
    TransmitRequest,
    TransmitStatus,
    encode,
    parse_content,
)
from robot_link.transport.xbee_neighbour import (
    REPORT_STRENGTH,
    NeighbourRadio,
    neighbour_value,
)
from simulator.xbee_air import MAX_PAYLOAD, Air

STATION_NODE_ID = "STATION"

_ANSWER_S: Final = 0.002
"""Time of the radio to answer an AT command; digi-xbee misses sooner answers."""
_SLOW_BIT_RATE: Final = 10_000
_STATUS_OF: Final = {
    Fate.DELIVERED: TransmitCode.SUCCESS,
    Fate.NOT_ACKNOWLEDGED: TransmitCode.NETWORK_ACK_FAILURE,
    Fate.TOO_LARGE: TransmitCode.PAYLOAD_TOO_LARGE,
}


class StationModule:
    """Answers as an XBee-PRO 900HP does. Belongs to one event loop."""

    def __init__(
        self,
        address: Address,
        mode: ApiMode,
        air: Air,
        write: Callable[[bytes], None],
        discovery_s: float,
    ) -> None:
        self._address = address
        self._mode: ApiMode = mode
        self._air = air
        self._write = write
        self._discovery_s = discovery_s
        self._reader = FrameReader(mode)
        octets = address.to_bytes(8, "big")
        self._parameters = {
            b"AP": bytes((mode,)),
            b"AO": b"\x00",
            b"CE": b"\x00",
            b"HV": b"\x23\x4b",
            b"N?": round(1000 * discovery_s).to_bytes(4, "big"),
            b"NI": STATION_NODE_ID.encode("ascii"),
            b"NO": b"\x00",
            b"NP": MAX_PAYLOAD.to_bytes(2, "big"),
            b"NT": round(10 * discovery_s).to_bytes(2, "big"),
            b"SH": octets[:4],
            b"SL": octets[4:],
            b"VR": b"\x80\x75",
        }

    def feed(self, data: bytes) -> None:
        """Take bytes from the port."""
        for content in self._reader.feed(data):
            match parse_content(content):
                case AtCommand(command=command) as question if command.upper() == b"ND":
                    self._discover(question)
                case AtCommand() as question:
                    self._answer(question)
                case TransmitRequest() as request:
                    self._transmit(request)
                case _:
                    pass

    def hear(self, source: Address, data: bytes) -> None:
        """Take a packet from the air."""
        self._say(ReceivePacket(source, data))

    def _say(self, frame: Frame) -> None:
        self._write(encode(frame.content(), self._mode))

    def _answer(self, question: AtCommand) -> None:
        name = question.command.upper()
        status, value = AtStatus.OK, b""
        if name == b"DB":
            value = bytes((round(-self._air.conditions.rssi_dbm),))
        elif name == b"BR":
            value = b"\x00" if 0 < self._air.conditions.bit_rate <= _SLOW_BIT_RATE else b"\x01"
        elif name not in self._parameters:
            status = AtStatus.BAD_COMMAND
        elif question.value:
            self._parameters[name] = question.value
        else:
            value = self._parameters[name]
        if question.frame_id:
            self._reply(question, status, value, _ANSWER_S)

    def _discover(self, question: AtCommand) -> None:
        """Tell of each radio that answers, when its answer comes; the end is not told."""
        strength = self._air.conditions.rssi_dbm
        tells_strength = self._parameters[b"NO"][-1] & REPORT_STRENGTH
        for share, address, node_id in self._air.neighbours(self._address):
            radio = NeighbourRadio(address, node_id, strength if tells_strength else None)
            after_s = _ANSWER_S + share * 0.9 * self._discovery_s
            self._reply(question, AtStatus.OK, neighbour_value(radio), after_s)

    def _reply(self, question: AtCommand, status: AtStatus, value: bytes, after_s: float) -> None:
        reply = AtReply(question.frame_id, question.command, status, value)
        asyncio.get_running_loop().call_later(after_s, self._say, reply)

    def _transmit(self, request: TransmitRequest) -> None:
        def tell(fate: asyncio.Future[Delivery]) -> None:
            delivery = fate.result()
            status = _STATUS_OF[delivery.fate]
            self._say(TransmitStatus(request.frame_id, delivery.retries, status))

        fate = self._air.transmit(self._address, request.address, request.data)
        if request.frame_id:
            fate.add_done_callback(tell)
