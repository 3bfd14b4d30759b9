"""Who else is in the network: our transport, our emulator and Digi's library say the same."""

import asyncio
import random
from functools import partial
from pathlib import Path

import pytest
from digi.xbee.devices import DigiMeshDevice, RemoteDigiMeshDevice
from digi.xbee.exception import TransmitException
from digi.xbee.models.address import XBee16BitAddress, XBee64BitAddress
from digi.xbee.models.mode import OperatingMode
from digi.xbee.models.status import ATCommandStatus, TransmitStatus
from digi.xbee.packets.common import (
    ATCommResponsePacket,
    TransmitPacket,
    TransmitStatusPacket,
)
from digi.xbee.packets.common import ReceivePacket as DigiReceivePacket
from digi.xbee.packets.factory import build_frame
from hypothesis import given
from hypothesis import strategies as st

from robot_link.delivery import deliver
from robot_link.transport import xbee
from robot_link.transport.datagram import (
    Address,
    Fate,
    PortClosedError,
    Received,
)
from robot_link.transport.opening import open_transport
from robot_link.transport.xbee import BYTES_PER_S, XBeeTiming, XBeeTransport
from robot_link.transport.xbee_neighbour import (
    NeighbourRadio,
    neighbour_value,
    parse_neighbour,
)
from simulator.xbee_network import MAX_PAYLOAD, AirConditions, XBeeNetwork
from tests.robot_link.far_end import next_event, next_opening, running
from tests.robot_link.scripted_port import ScriptedPort, opener

STATION = Address(0x0013A20041F00001)
MINI = Address(0x0013A20041F00002)
GRACE = Address(0x0013A20041F00003)
CALM = AirConditions(delay_s=0.0, jitter_s=0.001)


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that stands still for seconds makes no radio silent."""
    patient = partial(XBeeTiming, status_timeout_s=60.0, question_timeout_s=20.0)
    monkeypatch.setattr(xbee, "XBeeTiming", patient)


def network(conditions: AirConditions = CALM, **options) -> XBeeNetwork:
    return XBeeNetwork(random.Random(1), conditions, discovery_s=0.3, **options)


@pytest.mark.parametrize("mode", [1, 2])
async def test_every_radio_in_reach_is_found_with_its_name_and_strength(tmp_path: Path, mode):
    air = network(in_reach=lambda first, second: 9 not in (first, second))
    air.robot_radio(MINI, "mini-1")
    air.robot_radio(GRACE)
    air.robot_radio(Address(9), "submerged")
    uri = f"xbee://{tmp_path}/xbee?ap={mode}"
    async with air.pty(STATION, tmp_path / "xbee", mode), running(open_transport(uri)) as transport:
        with pytest.raises(PortClosedError):
            await transport.discover()
        await next_opening(transport)
        for _ in range(10):  # asked again where a busy machine was late
            found = {radio.address: radio for radio in await transport.discover()}
            if len(found) == 2:
                break
        assert found == {
            MINI: NeighbourRadio(MINI, "mini-1", -52.0),
            GRACE: NeighbourRadio(GRACE, "ROBOT 0003", -52.0),
        }
        delivery = await (await transport.send(MINI, b"after"))
        assert delivery.fate is Fate.DELIVERED, "the radio serves on"


async def test_digis_library_finds_the_emulated_radios(tmp_path: Path):
    air = network()
    air.robot_radio(MINI, "mini-1")
    air.robot_radio(GRACE, "grace-1")
    async with air.pty(STATION, tmp_path / "xbee"):
        device = DigiMeshDevice(str(tmp_path / "xbee"), 115200)
        device.set_sync_ops_timeout(60)
        await asyncio.to_thread(device.open)
        try:
            found = await discovered(device)
            assert found == {MINI: "mini-1", GRACE: "grace-1"}
            remote = RemoteDigiMeshDevice(device, XBee64BitAddress(MINI.to_bytes(8, "big")))
            with pytest.raises(TransmitException) as refusal:
                await asyncio.to_thread(device.send_data, remote, bytes(MAX_PAYLOAD + 1))
            assert refusal.value.status is TransmitStatus.PAYLOAD_TOO_LARGE
        finally:
            await asyncio.to_thread(device.close)


async def discovered(device: DigiMeshDevice) -> dict[int, str]:
    """Return the radios that Digi's library finds, asked again where a busy machine was late."""
    fabric, found = device.get_network(), {}
    for _ in range(10):
        await asyncio.to_thread(fabric.start_discovery_process)
        async with asyncio.timeout(60):
            while fabric.is_discovery_running():  # noqa: ASYNC110 - it is a thread of theirs
                await asyncio.sleep(0.02)
        found = {
            int.from_bytes(bytes(one.get_64bit_addr().address), "big"): one.get_node_id()
            for one in fabric.get_devices()
        }
        if len(found) == 2:
            break
    return found


class DigiRadio:
    """A radio at our transport's port that reads and writes with Digi's library alone."""

    def __init__(self, statuses: list[TransmitStatus]) -> None:
        self.sent: list[TransmitPacket] = []
        self._statuses = statuses

    def __call__(self, data: bytes) -> bytes:
        packet = build_frame(bytearray(data), OperatingMode.API_MODE)
        if isinstance(packet, TransmitPacket):
            self.sent.append(packet)
            return bytes(
                TransmitStatusPacket(
                    packet.frame_id,
                    XBee16BitAddress.UNKNOWN_ADDRESS,
                    0,
                    transmit_status=self._statuses[len(self.sent) - 1],
                ).output()
            )
        value = {"NP": b"\x00\x40", "DB": b"\x47", "BR": b"\x00"}.get(
            packet.command, b"\x41\xf0\x00\x01"
        )
        answer = ATCommResponsePacket(
            packet.frame_id, packet.command, ATCommandStatus.OK, bytearray(value)
        )
        return bytes(answer.output())


async def test_a_radio_of_digis_library_serves_our_transport():
    radio = DigiRadio([TransmitStatus.SUCCESS])
    port = ScriptedPort(radio)
    timing = xbee.XBeeTiming(signal_period_s=0.01)
    async with running(XBeeTransport(opener(port), timing=timing)) as transport:
        await next_opening(transport)
        assert transport.max_payload == 0x40, "as the radio says, and no constant"
        fits, too_large = (
            await transport.send(MINI, bytes(64)),
            await transport.send(MINI, bytes(65)),
        )
        assert (await fits).fate is Fate.DELIVERED
        assert (await too_large).fate is Fate.TOO_LARGE
        assert [bytes(one.rf_data) for one in radio.sent] == [bytes(64)]
        assert int.from_bytes(bytes(radio.sent[0].x64bit_dest_addr.address), "big") == MINI
        packet = DigiReceivePacket(
            XBee64BitAddress(MINI.to_bytes(8, "big")),
            XBee16BitAddress.UNKNOWN_ADDRESS,
            0,
            rf_data=b"hello",
        )
        strengths: list[float | None] = []
        async with asyncio.timeout(60.0):
            while not strengths or strengths[-1] is None:
                port.bring(bytes(packet.output()))
                event = await next_event(transport, Received)
                assert (event.address, event.data) == (MINI, b"hello")
                strengths.append(event.rssi_dbm)
                await asyncio.sleep(0.02)
        assert strengths[0] is None
        assert strengths[-1] == -71.0


async def test_a_missing_network_acknowledgement_leads_to_another_attempt():
    failed = TransmitStatus.NETWORK_ACK_FAILURE
    radio = DigiRadio([failed, failed, TransmitStatus.SUCCESS])
    async with running(XBeeTransport(opener(ScriptedPort(radio)))) as transport:
        await next_opening(transport)
        delivery = await deliver(transport, MINI, b"again", attempts=3)
        assert delivery.fate is Fate.DELIVERED
        assert [bytes(one.rf_data) for one in radio.sent] == [b"again"] * 3

    given_up = DigiRadio([failed] * 3)
    async with running(XBeeTransport(opener(ScriptedPort(given_up)))) as transport:
        await next_opening(transport)
        delivery = await deliver(transport, MINI, b"again", attempts=3)
        assert delivery.fate is Fate.NOT_ACKNOWLEDGED
        assert len(given_up.sent) == 3


@pytest.mark.parametrize(
    ("bit_rate", "option", "expected"),
    [
        (0.0, "", BYTES_PER_S[200]),
        (10_000.0, "", BYTES_PER_S[10]),
        (10_000.0, "?rate=200k", BYTES_PER_S[200]),
        (200_000.0, "?rate=10k", BYTES_PER_S[10]),
    ],
)
async def test_the_rate_in_the_air_is_the_radios_unless_the_uri_says_it(
    tmp_path: Path, bit_rate: float, option: str, expected: float
):
    air = network(AirConditions(delay_s=0.0, bit_rate=bit_rate))
    async with (
        air.pty(STATION, tmp_path / "xbee"),
        running(open_transport(f"xbee://{tmp_path}/xbee{option}")) as transport,
    ):
        await next_opening(transport)
        assert transport.bytes_per_s == expected


@given(
    st.integers(0, 2**64 - 1).map(Address),
    st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=20),
    st.one_of(st.none(), st.integers(-255, 0).map(float)),
)
def test_an_answer_that_names_a_radio_is_read_as_it_was_written(
    address: Address, name: str, strength: float | None
):
    radio = NeighbourRadio(address, name, strength)
    value = neighbour_value(radio)
    assert parse_neighbour(value) == radio
    for length in range(len(value) - 1):
        assert parse_neighbour(value[:length]) != radio


@given(st.binary(max_size=60))
def test_no_answer_however_garbled_does_harm(value: bytes):
    found = parse_neighbour(value)
    assert found is None or len(found.node_id) <= len(value)
