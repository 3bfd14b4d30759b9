"""MAVLink over serial lines, TCP and UDP: real pseudo-terminals and loopback sockets."""

import asyncio
import os
import random
import socket
import termios
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path

import pytest

from robot_link.transport import far_end, mavlink_stream
from robot_link.transport.datagram import (
    BROADCAST,
    FAR_END,
    Address,
    Fate,
    Garbled,
    PortChanged,
    PortClosedError,
    Received,
    Stranger,
)
from robot_link.transport.keeper import DISABLED
from robot_link.transport.mavlink_stream import MavlinkStream, StreamTiming
from robot_link.transport.opening import open_transport
from robot_link.transport.port import SerialPort
from robot_link.transport.udp import UdpTiming, UdpTransport
from simulator.xbee_network import AirConditions, XBeeNetwork
from tests.free_port import free_port
from tests.robot_link.far_end import heartbeat, line, next_event, next_opening, running
from tests.robot_link.scripted_port import ScriptedPort

LOCAL = "127.0.0.1"


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that stands still for seconds makes no far side quiet."""
    patient = partial(StreamTiming, quiet_s=60.0)
    monkeypatch.setattr(mavlink_stream, "StreamTiming", patient)


async def test_frames_cross_a_serial_line_in_both_directions(tmp_path: Path):
    uri = f"serial://{tmp_path}/line?baud=57600"
    with line(tmp_path / "line") as far:
        async with running(open_transport(uri)) as transport:
            await next_opening(transport)
            delivery = await (await transport.send(FAR_END, heartbeat(1)))
            assert delivery.fate is Fate.UNCONFIRMED
            assert await far.read() == heartbeat(1)
            far.write(b"noise" + heartbeat(2) + heartbeat(3)[:9])
            event = await next_event(transport, Received)
            assert (event.address, event.data, event.rssi_dbm) == (FAR_END, heartbeat(2), None)
            garbled = await next_event(transport, Garbled)
            assert (garbled.frames, garbled.data) == (1, b"noise")
            far.write(heartbeat(3)[9:])
            assert (await next_event(transport, Received)).data == heartbeat(3)
        assert transport.max_payload == 0


async def test_a_line_takes_the_speed_of_its_uri(tmp_path: Path):
    with line(tmp_path / "line") as far:
        async with running(open_transport(f"serial://{tmp_path}/line?baud=9600")) as transport:
            await next_opening(transport)
            assert termios.tcgetattr(far.descriptor)[4] == termios.B9600


async def test_a_line_that_vanishes_is_opened_again_when_it_is_back(tmp_path: Path):
    async with running(open_transport(f"serial://{tmp_path}/line")) as transport:
        absent = await next_event(transport, PortChanged)
        assert not absent.is_open
        assert "No such file" in absent.reason
        for number in range(2):
            with line(tmp_path / "line") as far:
                await next_opening(transport)
                far.write(heartbeat(number))
                assert (await next_event(transport, Received)).data == heartbeat(number)
            assert not (await next_event(transport, PortChanged)).is_open
            with pytest.raises(PortClosedError):
                await transport.send(FAR_END, b"nobody")


async def test_a_line_whose_name_leads_elsewhere_is_given_up_for_the_one_it_names(tmp_path: Path):
    path = tmp_path / "line"
    with line(tmp_path / "other") as stranger, line(tmp_path / "own") as far:
        path.symlink_to((tmp_path / "other").readlink())
        async with running(open_transport(f"serial://{path}")) as transport:
            await next_opening(transport)
            path.unlink()
            path.symlink_to((tmp_path / "own").readlink())
            closed = await next_event(transport, PortChanged)
            assert (closed.is_open, closed.reason) == (False, f"{path} leads to another line now")
            await next_opening(transport)
            stranger.write(heartbeat(1))
            far.write(heartbeat(2))
            assert (await next_event(transport, Received)).data == heartbeat(2)


async def test_half_a_frame_is_given_up_when_the_line_falls_silent():
    ours, theirs = os.openpty()

    async def opened() -> SerialPort:
        return await SerialPort.open(os.ttyname(theirs), baud=57600, flow_control=False)

    timing = StreamTiming(quiet_s=0.05)
    stream = MavlinkStream("serial", opened, bytes_per_s=1.0, frame_bytes=280, timing=timing)
    async with running(stream) as transport:
        await next_opening(transport)
        os.write(ours, b"\xfd\xff\x00\x00" + heartbeat(1))
        assert (await next_event(transport, Received)).data == heartbeat(1)
    os.close(theirs)
    os.close(ours)


async def test_a_far_side_that_takes_no_bytes_is_given_up_and_tried_again(tmp_path: Path):
    with line(tmp_path / "line"):

        async def opened() -> SerialPort:
            return await SerialPort.open(str(tmp_path / "line"), baud=57600, flow_control=False)

        timing = StreamTiming(write_timeout_s=0.1, reopen_s=0.01)
        stream = MavlinkStream("serial", opened, bytes_per_s=1.0, frame_bytes=280, timing=timing)
        async with running(stream) as transport:
            await next_opening(transport)
            with pytest.raises(PortClosedError, match="takes no bytes"):
                await transport.send(FAR_END, bytes(100_000))
            closed = await next_event(transport, PortChanged)
            assert (closed.is_open, closed.reason) == (False, "the far side takes no bytes")
            await next_opening(transport)


async def test_a_line_that_closes_while_somebody_writes_is_watched_no_more():
    ours, theirs = os.openpty()
    port = await SerialPort.open(os.ttyname(theirs), baud=57600, flow_control=False)
    writing = asyncio.create_task(port.write(bytes(1_000_000)))
    while not port.is_awaited:  # noqa: ASYNC110 - the buffer of the system is to be full
        await asyncio.sleep(0)
    descriptor, _ = port.release()
    assert not asyncio.get_running_loop().remove_writer(descriptor)
    os.close(descriptor)
    with pytest.raises(OSError, match="Bad file"):
        await writing
    os.close(theirs)
    os.close(ours)


@pytest.mark.parametrize("scheme", ["serial", "xbee"])
async def test_a_pulled_plug_closes_the_port_until_it_is_put_back(tmp_path: Path, scheme: str):
    """The line itself stays: another program may have it meanwhile."""

    @asynccontextmanager
    async def far_side() -> AsyncIterator[None]:
        if scheme == "xbee":
            air = XBeeNetwork(random.Random(1), AirConditions())
            async with air.pty(Address(1), tmp_path / "line"):
                yield
        else:
            with line(tmp_path / "line"):
                yield

    async with far_side(), running(open_transport(f"{scheme}://{tmp_path}/line")) as transport:
        await next_opening(transport)
        transport.set_enabled(False)
        closed = await next_event(transport, PortChanged)
        assert (closed.is_open, closed.reason) == (False, DISABLED)
        assert not transport.is_enabled
        assert transport.max_payload == 0
        with pytest.raises(PortClosedError):
            await transport.send(FAR_END, heartbeat())
        other = await SerialPort.open(str(tmp_path / "line"), baud=57600, flow_control=False)
        other.close()
        transport.set_enabled(True)
        await next_opening(transport)


async def test_a_plug_may_be_out_before_the_link_runs_and_while_it_waits(tmp_path: Path):
    transport = open_transport(f"serial://{tmp_path}/line")
    transport.set_enabled(False)
    async with running(transport):
        assert (await next_event(transport, PortChanged)).reason == DISABLED
        transport.set_enabled(True)
        assert "No such file" in (await next_event(transport, PortChanged)).reason
        transport.set_enabled(False)
        assert (await next_event(transport, PortChanged)).reason == DISABLED


async def test_frames_cross_a_tcp_connection_from_both_ends():
    port = free_port()
    robot = open_transport(f"tcp://{LOCAL}:{port}?listen=1")
    station = open_transport(f"tcp://{LOCAL}:{port}")
    async with running(robot), running(station):
        await next_opening(station)
        await next_opening(robot)
        await station.send(BROADCAST, heartbeat(1))
        assert (await next_event(robot, Received)).data == heartbeat(1)
        await robot.send(FAR_END, b"junk" + heartbeat(2))
        assert (await next_event(station, Received)).data == heartbeat(2)


async def test_who_listens_serves_one_believed_caller_after_another():
    port = free_port()
    robot = open_transport(f"tcp://{LOCAL}:{port}?listen=1")
    async with running(robot):
        for number in range(2):
            async with running(open_transport(f"tcp://{LOCAL}:{port}")) as station:
                await next_opening(station)
                await next_opening(robot)
                await station.send(FAR_END, heartbeat(number))
                heard = await next_event(robot, Received)
                assert (heard.data, heard.accept(False)) == (heartbeat(number), True)
                async with running(open_transport(f"tcp://{LOCAL}:{port}")) as other:
                    await next_opening(other)
                    await other.send(FAR_END, heartbeat(7))
                    stranger = await next_event(robot, Stranger)
                    assert (stranger.data, stranger.took_over) == (heartbeat(7), False)
                    await robot.send(FAR_END, heartbeat(9))
                    assert (await next_event(station, Received)).data == heartbeat(9)
            assert "hung up" in (await next_event(robot, PortChanged)).reason


async def test_a_tcp_far_end_that_is_not_there_yet_is_called_until_it_is():
    port = free_port()
    async with running(open_transport(f"tcp://{LOCAL}:{port}")) as station:
        assert "Connect call failed" in (await next_event(station, PortChanged)).reason
        async with running(open_transport(f"tcp://{LOCAL}:{port}?listen=1")):
            await next_opening(station)


async def test_a_port_that_another_program_listens_at_is_named():
    with socket.create_server((LOCAL, 0)) as taken:
        port = taken.getsockname()[1]
        async with running(open_transport(f"tcp://{LOCAL}:{port}?listen=1")) as robot:
            assert "in use" in (await next_event(robot, PortChanged)).reason


async def test_packets_cross_udp_once_the_caller_has_spoken():
    port = free_port(socket.SOCK_DGRAM)
    robot = open_transport(f"udp://{LOCAL}:{port}?listen=1")
    station = open_transport(f"udp://{LOCAL}:{port}")
    async with running(robot), running(station):
        await next_opening(robot)
        await next_opening(station)
        early = await (await robot.send(FAR_END, heartbeat(0)))
        assert early.fate is Fate.REFUSED
        assert "nobody has spoken" in early.detail
        assert (await (await station.send(FAR_END, heartbeat(1)))).fate is Fate.UNCONFIRMED
        assert (await next_event(robot, Received)).data == heartbeat(1)
        await robot.send(BROADCAST, heartbeat(2))
        assert (await next_event(station, Received)).data == heartbeat(2)
        huge = await (await station.send(FAR_END, bytes(station.max_payload + 1)))
        assert huge.fate is Fate.TOO_LARGE


async def test_strangers_at_a_udp_port_are_counted_until_the_far_end_has_gone(
    monkeypatch: pytest.MonkeyPatch,
):
    at_s = [1000.0]
    monkeypatch.setattr(far_end, "monotonic_s", lambda: at_s[0])
    port = free_port(socket.SOCK_DGRAM)
    robot = UdpTransport(LOCAL, port, listens=True, timing=UdpTiming(faithful_s=0.2))
    first, second = (open_transport(f"udp://{LOCAL}:{port}") for _ in range(2))
    async with running(robot), running(first), running(second):
        for one in (robot, first, second):
            await next_opening(one)
        await first.send(FAR_END, heartbeat(1))
        heard = await next_event(robot, Received)
        assert (heard.data, heard.accept(False)) == (heartbeat(1), True)
        await second.send(FAR_END, heartbeat(2))
        stranger = await next_event(robot, Garbled)
        assert (stranger.frames, stranger.data) == (1, heartbeat(2))
        at_s[0] += 0.25
        await second.send(FAR_END, heartbeat(3))
        heard = await next_event(robot, Received)
        assert (heard.data, heard.accept(False)) == (heartbeat(3), True)
        await robot.send(FAR_END, heartbeat(4))
        assert (await next_event(second, Received)).data == heartbeat(4)


async def test_a_udp_far_end_that_is_not_there_is_no_failure_but_is_told():
    transport = UdpTransport(LOCAL, free_port(socket.SOCK_DGRAM), listens=False)
    async with running(transport):
        await next_opening(transport)
        await transport.send(Address(5), heartbeat())
        async with asyncio.timeout(60):
            while not transport.trouble:  # noqa: ASYNC110 - nothing tells of it
                await asyncio.sleep(0.005)
        assert "refused" in transport.trouble
        assert transport.max_payload


async def test_a_udp_socket_can_be_unplugged_and_plugged_in():
    port = free_port(socket.SOCK_DGRAM)
    transport = open_transport(f"udp://{LOCAL}:{port}?listen=1")
    async with running(transport):
        await next_opening(transport)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            with pytest.raises(OSError, match="in use"):
                other.bind((LOCAL, port))
            transport.set_enabled(False)
            assert (await next_event(transport, PortChanged)).reason == DISABLED
            other.bind((LOCAL, port))
        transport.set_enabled(True)
        await next_opening(transport)


async def test_a_fault_in_one_transport_is_told_and_does_not_end_the_others(caplog):
    attempts = 0

    async def opened() -> ScriptedPort:
        nonlocal attempts
        attempts += 1
        if attempts == 1:
            raise RuntimeError("never foreseen")
        return ScriptedPort()

    stream = MavlinkStream(
        "tcp", opened, bytes_per_s=1e3, frame_bytes=280, timing=StreamTiming(reopen_s=0.01)
    )
    async with running(stream):
        events = stream.events()
        closed = await anext(events)
        assert closed == PortChanged(
            is_open=False, reason="a fault of this program (RuntimeError); its log says more"
        )
        assert await anext(events) == PortChanged(is_open=True, reason="")
    assert "never foreseen" in caplog.text
