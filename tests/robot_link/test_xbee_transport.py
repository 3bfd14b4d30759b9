"""The XBee transport against the emulated network: delivery, strength, and ports that vanish."""

import asyncio
import os
import random
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from functools import partial
from pathlib import Path

import pytest
from digi.xbee.devices import DigiMeshDevice, RemoteDigiMeshDevice
from digi.xbee.exception import TransmitException
from digi.xbee.models.address import XBee64BitAddress

from robot_link.transport import xbee
from robot_link.transport.datagram import (
    BROADCAST,
    Address,
    DatagramTransport,
    Fate,
    Garbled,
    PortChanged,
    PortClosedError,
    Received,
)
from robot_link.transport.opening import open_transport
from robot_link.transport.port import SerialPort
from robot_link.transport.xbee import XBeeTiming, XBeeTransport
from robot_link.transport.xbee_frame import ReceivePacket, encode
from simulator.xbee_network import MAX_PAYLOAD, AirConditions, RobotRadio, XBeeNetwork
from tests.robot_link.scripted_port import ScriptedPort, answering_questions, opener
from tests.tcp_peer import connected

STATION = Address(0x0013A20041F00001)
ROBOT = Address(0x0013A20041F00002)
CALM = AirConditions(delay_s=0.0, jitter_s=0.001)


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that stands still for seconds makes no radio silent."""
    patient = partial(XBeeTiming, status_timeout_s=60.0, question_timeout_s=20.0)
    monkeypatch.setattr(xbee, "XBeeTiming", patient)


def network(conditions: AirConditions = CALM, **options) -> XBeeNetwork:
    return XBeeNetwork(random.Random(1), conditions, **options)


@asynccontextmanager
async def running(transport: DatagramTransport) -> AsyncIterator[DatagramTransport]:
    task = asyncio.create_task(transport.run())
    try:
        yield transport
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def next_event(transport: DatagramTransport, kind: type):
    async with asyncio.timeout(60):
        async for event in transport.events():
            if isinstance(event, kind):
                return event
    raise AssertionError


async def next_opening(transport: DatagramTransport) -> None:
    while not (await next_event(transport, PortChanged)).is_open:
        pass


@pytest.mark.parametrize("mode", [1, 2])
async def test_datagrams_cross_in_both_directions_on_a_pseudo_terminal(tmp_path: Path, mode):
    air = network()
    radio = air.robot_radio(ROBOT)
    async with (
        air.pty(STATION, tmp_path / "xbee", mode),
        running(open_transport(f"xbee://{tmp_path}/xbee?ap={mode}")) as transport,
    ):
        await next_opening(transport)
        payload = bytes(range(256))
        fate = await transport.send(ROBOT, payload)
        heard = await next_event(radio, Received)
        assert (heard.address, heard.data) == (STATION, payload)
        assert (await fate).fate is Fate.DELIVERED

        await radio.send(STATION, b"}~\x11\x13")
        assert (await next_event(transport, Received)).data == b"}~\x11\x13"


async def test_datagrams_cross_over_tcp():
    air = network()
    radio = air.robot_radio(ROBOT)
    async with (
        air.tcp(STATION, "127.0.0.1") as port,
        running(open_transport(f"xbee://127.0.0.1:{port}")) as transport,
    ):
        await next_opening(transport)
        await transport.send(ROBOT, b"hello")
        assert (await next_event(radio, Received)).data == b"hello"


async def test_the_radio_itself_tells_how_much_it_carries(tmp_path: Path):
    air = network()
    air.robot_radio(ROBOT)
    async with (
        air.pty(STATION, tmp_path / "xbee"),
        running(open_transport(f"xbee://{tmp_path}/xbee")) as transport,
    ):
        assert transport.max_payload == 0
        await next_opening(transport)
        assert transport.max_payload == MAX_PAYLOAD
        fits = await transport.send(ROBOT, bytes(MAX_PAYLOAD))
        too_large = await transport.send(ROBOT, bytes(MAX_PAYLOAD + 1))
        assert (await fits).fate is Fate.DELIVERED
        assert (await too_large).fate is Fate.TOO_LARGE


async def test_silence_of_a_submerged_robot_is_told_after_the_radios_own_retries(tmp_path: Path):
    air = network(in_reach=lambda _a, _b: False)
    air.robot_radio(ROBOT)
    async with (
        air.pty(STATION, tmp_path / "xbee"),
        running(open_transport(f"xbee://{tmp_path}/xbee")) as transport,
    ):
        await next_opening(transport)
        delivery = await (await transport.send(ROBOT, b"up"))
        assert delivery.fate is Fate.NOT_ACKNOWLEDGED
        assert delivery.retries == CALM.mac_retries
        broadcast = await (await transport.send(BROADCAST, b"all"))
        assert broadcast.fate is Fate.DELIVERED


async def test_signal_strength_belongs_to_the_last_sender(tmp_path: Path):
    air = network(AirConditions(delay_s=0.0, jitter_s=0.0, rssi_dbm=-71.0))
    radio, other = air.robot_radio(ROBOT), air.robot_radio(Address(ROBOT + 1))
    port = XBeeTransport(
        partial(SerialPort.open, f"{tmp_path}/xbee", baud=115200, flow_control=False),
        timing=xbee.XBeeTiming(signal_period_s=0.02),
    )
    async with air.pty(STATION, tmp_path / "xbee"), running(port) as transport:
        await next_opening(transport)
        strengths: list[float | None] = []
        async with asyncio.timeout(60.0):
            while not strengths or strengths[-1] is None:
                await radio.send(STATION, b"1")
                strengths.append((await next_event(transport, Received)).rssi_dbm)
                await asyncio.sleep(0.01)
        assert strengths[0] is None
        assert strengths[-1] == -71.0
        await other.send(STATION, b"2")
        assert (await next_event(transport, Received)).rssi_dbm is None


async def test_a_pulled_plug_is_told_and_the_port_opened_again_when_it_returns(tmp_path: Path):
    air = network()
    radio = air.robot_radio(ROBOT)
    async with running(open_transport(f"xbee://{tmp_path}/xbee")) as transport:
        for payload in (b"first", b"second"):
            async with air.pty(STATION, tmp_path / "xbee"):
                await next_opening(transport)
                await transport.send(ROBOT, payload)
                assert (await next_event(radio, Received)).data == payload
            closed = await next_event(transport, PortChanged)
            assert not closed.is_open
            assert closed.reason
            with pytest.raises(PortClosedError):
                await transport.send(ROBOT, b"nobody")


async def test_what_was_under_way_when_the_plug_was_pulled_is_of_unknown_fate(tmp_path: Path):
    air = network(AirConditions(delay_s=30.0))
    async with running(open_transport(f"xbee://{tmp_path}/xbee")) as transport:
        async with air.pty(STATION, tmp_path / "xbee"):
            await next_opening(transport)
            fate = await transport.send(ROBOT, b"lost")
        assert (await fate).fate is Fate.UNKNOWN


async def test_no_more_datagrams_are_handed_over_than_the_window_holds():
    port = ScriptedPort(answering_questions)
    async with running(XBeeTransport(opener(port), timing=xbee.XBeeTiming(window=2))) as transport:
        await next_opening(transport)
        for _ in range(2):
            await transport.send(ROBOT, b"x")
        third = asyncio.create_task(transport.send(ROBOT, b"x"))
        await asyncio.sleep(0.05)
        assert not third.done()
        sent = [frame for frame in port.written if frame[3] == 0x10]
        assert len(sent) == 2
        port.bring(encode(bytes((0x8B, sent[0][4], 0xFF, 0xFE, 0, 0x75, 0)), 1))
        refused = await third
        assert not refused.done()


async def test_a_status_without_a_meaning_of_its_own_is_a_refusal_that_names_it():
    port = ScriptedPort(answering_questions)
    async with running(XBeeTransport(opener(port))) as transport:
        await next_opening(transport)
        fate = await transport.send(ROBOT, b"x")
        frame = port.written[-1]
        port.bring(encode(bytes((0x8B, frame[4], 0xFF, 0xFE, 0, 0x32, 0)), 1))
        delivery = await fate
        assert delivery.fate is Fate.REFUSED
        assert "0x32" in delivery.detail


async def test_a_radio_that_never_says_is_of_unknown_fate():
    port = ScriptedPort(answering_questions)
    timing = XBeeTiming(status_timeout_s=0.05)
    async with running(XBeeTransport(opener(port), timing=timing)) as transport:
        await next_opening(transport)
        assert (await (await transport.send(ROBOT, b"x"))).fate is Fate.UNKNOWN


async def test_a_device_that_is_no_xbee_is_named_as_such():
    timing = XBeeTiming(question_timeout_s=0.02)
    async with running(XBeeTransport(opener(ScriptedPort()), timing=timing)) as transport:
        closed = await next_event(transport, PortChanged)
        assert not closed.is_open
        assert "no XBee in API mode 1 answers" in closed.reason
        assert transport.is_mute


async def test_a_radio_whose_process_is_stopped_is_mute_and_not_unplugged():
    runs = [True]
    port = ScriptedPort(lambda data: answering_questions(data) if runs else b"")
    timing = XBeeTiming(question_timeout_s=0.02, signal_period_s=0.02, reopen_s=0.01)
    ports = iter((port, ScriptedPort()))

    async def open_port():
        if (found := next(ports, None)) is None:
            raise OSError("no such port")
        return found

    async with running(XBeeTransport(open_port, timing=timing)) as transport:
        await next_opening(transport)
        assert not transport.is_mute
        runs.clear()
        assert not (await next_event(transport, PortChanged)).is_open
        assert transport.is_mute
        closed = await next_event(transport, PortChanged)
        assert (closed.reason, transport.is_mute) == ("no such port", False)


async def test_a_radio_that_does_not_tell_its_packet_size_is_not_called_open():
    def silent_of_size(data: bytes) -> bytes:
        if data[5:7] == b"NP":
            return encode(bytes((0x88, data[4])) + b"NP\x02", 1)
        return answering_questions(data)

    async with running(XBeeTransport(opener(ScriptedPort(silent_of_size)))) as transport:
        closed = await next_event(transport, PortChanged)
        assert not closed.is_open
        assert "how many bytes a packet carries" in closed.reason


async def test_a_question_is_repeated_when_its_answer_is_lost():
    asked: list[bytes] = []

    def forgetful(data: bytes) -> bytes:
        asked.append(data)
        return answering_questions(data) if len(asked) > 1 else b""

    timing = XBeeTiming(question_timeout_s=0.05)
    async with running(XBeeTransport(opener(ScriptedPort(forgetful)), timing=timing)) as transport:
        await next_opening(transport)
        assert transport.max_payload == 256


async def test_a_sender_that_waits_for_the_window_is_told_when_the_port_closes():
    port = ScriptedPort(answering_questions)
    async with running(XBeeTransport(opener(port), timing=xbee.XBeeTiming(window=1))) as transport:
        await next_opening(transport)
        first = await transport.send(ROBOT, b"x")
        second = asyncio.create_task(transport.send(ROBOT, b"x"))
        await asyncio.sleep(0.01)
        port.bring(b"")
        with pytest.raises(PortClosedError):
            await second
        assert (await first).fate is Fate.UNKNOWN


async def test_a_port_that_fails_in_a_write_is_closed_to_its_sender():
    def failing(data: bytes) -> bytes:
        if data[3] == 0x10:
            raise OSError("cable cut")
        return answering_questions(data)

    async with running(XBeeTransport(opener(ScriptedPort(failing)))) as transport:
        await next_opening(transport)
        with pytest.raises(PortClosedError, match="cable cut"):
            await transport.send(ROBOT, b"x")


async def test_a_full_line_is_written_to_as_it_drains():
    ours, theirs = os.openpty()
    port = await SerialPort.open(os.ttyname(theirs), baud=115200, flow_control=False)
    try:
        payload = bytes(100_000)
        writing = asyncio.create_task(port.write(payload))
        await asyncio.sleep(0.01)
        assert not writing.done()
        taken = 0
        while taken < len(payload):
            taken += len(await asyncio.to_thread(os.read, ours, 65536))
        await writing
    finally:
        port.close()
        os.close(theirs)
        os.close(ours)


async def test_a_line_has_one_owner_and_a_possible_speed():
    ours, theirs = os.openpty()
    path = os.ttyname(theirs)
    port = await SerialPort.open(path, baud=115200, flow_control=False)
    try:
        with pytest.raises(OSError, match="lock"):
            await SerialPort.open(path, baud=115200, flow_control=False)
    finally:
        port.close()
    with pytest.raises(OSError, match=path):
        await SerialPort.open(path, baud=10**12, flow_control=False)
    os.close(theirs)
    os.close(ours)


async def test_a_second_client_of_a_tcp_radio_is_turned_away():
    air = network()
    async with (
        air.tcp(STATION, "127.0.0.1") as port,
        connected(port) as (reader, writer),
        connected(port) as (second, _),
    ):
        assert await second.read() == b""
        writer.write(encode(b"\x08\x01NP", 1))
        assert len(await reader.readexactly(11)) == 11


async def test_a_radio_whose_answers_are_late_behind_its_packets_is_not_gone():
    packet = encode(ReceivePacket(ROBOT, b"state").content(), 1)
    timing = XBeeTiming(question_timeout_s=0.02, signal_period_s=0.01)
    is_busy = True

    def busy(data: bytes) -> bytes:
        if data[5:7] != b"DB":
            return answering_questions(data)
        return packet if is_busy else b""

    async with running(XBeeTransport(opener(ScriptedPort(busy)), timing=timing)) as transport:
        await next_opening(transport)
        async with asyncio.timeout(60):
            events = transport.events()
            assert [type(await anext(events)) for _ in range(8)] == [Received] * 8
            is_busy = False
            while not isinstance(event := await anext(events), PortChanged):
                pass
        assert "no XBee in API mode 1 answers" in event.reason


async def test_the_beginning_of_a_long_frame_does_not_hide_those_that_follow_it():
    """Noise can look like a frame of 512 bytes, which in a quiet sea come after minutes."""
    packet = encode(ReceivePacket(Address(0x77), b"hello").content(), 1)
    port = ScriptedPort()
    async with running(XBeeTransport(opener(port))) as transport:
        port.bring(b"\x7e\x02\x00" + packet + packet)
        first = await next_event(transport, Received)
        assert (first.address, first.data) == (Address(0x77), b"hello")
        assert (await next_event(transport, Received)).data == b"hello"


async def test_garbage_at_the_port_is_counted():
    port = ScriptedPort(answering_questions)
    async with running(XBeeTransport(opener(port))) as transport:
        port.bring(b"\r\nboot v1.2\r\n")
        assert (await next_event(transport, Garbled)).frames == 1


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("telnet://127.0.0.1:1", "unknown kind of link 'telnet'; known are xbee, serial, udp, tcp"),
        ("xbee://", "needs the path"),
        ("xbee://127.0.0.1", "needs host and port"),
        ("xbee:///dev/ttyS0?ap=3", "ap must be 1 or 2, not '3'"),
        ("xbee:///dev/ttyS0?baud=fast", "whole number"),
        ("xbee:///dev/ttyS0?speed=1", "unknown option speed"),
    ],
)
def test_a_uri_that_names_no_transport_is_refused_with_a_reason(uri: str, complaint: str):
    with pytest.raises(ValueError, match=complaint):
        open_transport(uri)


async def test_digis_library_talks_to_the_emulated_network(tmp_path: Path):
    reachable = True
    air = network(AirConditions(), in_reach=lambda _a, _b: reachable)
    radio = air.robot_radio(ROBOT)
    async with air.pty(STATION, tmp_path / "xbee"):
        device = DigiMeshDevice(str(tmp_path / "xbee"), 115200)
        device.set_sync_ops_timeout(60)
        remote = RemoteDigiMeshDevice(device, XBee64BitAddress(ROBOT.to_bytes(8, "big")))
        await asyncio.to_thread(device.open)
        try:
            assert int.from_bytes(bytes(device.get_64bit_addr().address), "big") == STATION
            await asyncio.to_thread(device.send_data, remote, b"over")
            assert (await next_event(radio, Received)).data == b"over"
            await radio.send(STATION, b"and out")
            message = await asyncio.to_thread(device.read_data, 60)
            assert bytes(message.data) == b"and out"
            reachable = False
            with pytest.raises(TransmitException):
                await asyncio.to_thread(device.send_data, remote, b"gone")
        finally:
            await asyncio.to_thread(device.close)


async def test_two_radios_cannot_share_an_address():
    air = network()
    assert isinstance(air.robot_radio(ROBOT), RobotRadio)
    with pytest.raises(ValueError, match="two radios"):
        air.robot_radio(ROBOT)


async def test_duplicated_packets_arrive_twice_and_are_confirmed_once(tmp_path: Path):
    air = network(AirConditions(delay_s=0.0, jitter_s=0.001, duplication=1.0))
    radio = air.robot_radio(ROBOT)
    delivery = await air.transmit(STATION, ROBOT, b"twice")
    assert delivery.fate is Fate.DELIVERED
    assert [(await next_event(radio, Received)).data for _ in range(2)] == [b"twice"] * 2


async def test_the_same_seed_loses_the_same_packets():
    async def fates() -> list[Fate]:
        air = network(AirConditions(loss=0.5, delay_s=0.0, jitter_s=0.0, mac_retries=0))
        air.robot_radio(ROBOT)
        return [(await air.transmit(STATION, ROBOT, b"x")).fate for _ in range(40)]

    first = await fates()
    assert first == await fates()
    assert set(first) == {Fate.DELIVERED, Fate.NOT_ACKNOWLEDGED}


RADIO_ALONE = """
import asyncio, random, sys
from pathlib import Path
from simulator.xbee_network import AirConditions, XBeeNetwork

async def serve():
    air = XBeeNetwork(random.Random(1), AirConditions())
    async with air.pty(1, Path(sys.argv[1])):
        await asyncio.get_running_loop().create_future()

asyncio.run(serve())
"""


@pytest.mark.process
async def test_a_radio_whose_process_is_killed_is_found_again_when_it_is_back(tmp_path: Path):
    link = tmp_path / "xbee"
    async with running(open_transport(f"xbee://{link}")) as transport:
        for _ in range(2):
            process = await asyncio.create_subprocess_exec(
                sys.executable, "-c", RADIO_ALONE, str(link)
            )
            try:
                await next_opening(transport)
            finally:
                process.kill()
                await process.wait()
            assert not (await next_event(transport, PortChanged)).is_open
            assert link.is_symlink(), "a killed process leaves its link behind"
            link.unlink()  # its terminal's number may soon be that of another test's
