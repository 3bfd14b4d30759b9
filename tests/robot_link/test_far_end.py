"""Where anybody may speak to a port, what is meant for a robot goes to the robot alone."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from robot_link.clock import SystemClock
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.signing import MemorySigningMemory, Signing
from robot_link.mavlink.telemetry import state_message
from robot_link.messages import LinkReport, LinkState
from robot_link.station.link import RadioPath, RobotEndpoint, StationLink
from robot_link.transport import far_end
from robot_link.transport.datagram import FAR_END, Address, DatagramTransport, Received
from robot_link.transport.far_end import FarEnd
from robot_link.transport.keeper import KeptTransport
from robot_link.transport.opening import open_transport
from tests.free_port import free_port
from tests.robot_link.far_end import running
from tests.robot_link.rig import (
    CALM,
    HASTE,
    MINI,
    STATION,
    SYSTEMS,
    Heard,
    rig,
    state,
    until,
)
from tests.robot_link.rig import running as tasks_running
from tests.tcp_peer import serving

KEY = bytes(range(32))
KIND = {"udp": socket.SOCK_DGRAM, "tcp": socket.SOCK_STREAM}


def signing() -> Signing:
    return Signing(KEY, MemorySigningMemory(), SystemClock())


def robot() -> Codec:
    return Codec(SYSTEMS[MINI], ROBOT_COMPONENT, signing())


def impostor() -> Codec:
    return Codec(SYSTEMS[MINI], ROBOT_COMPONENT)


def frame(codec: Codec) -> bytes:
    return codec.pack(state_message(state(SystemClock().now())))


class Case:
    """A station that listens, with the callers of one test."""

    def __init__(self, uri: str, clock_s: list[float]) -> None:
        self.uri, self.heard, self.clock_s = uri, Heard(), clock_s
        ashore = signing()
        self.port = open_transport(uri)
        self.station = StationLink(
            {uri: self.port},
            {MINI: RobotEndpoint(SYSTEMS[MINI], (RadioPath(uri),))},
            SystemClock(),
            self.heard,
            replace(HASTE, report_s=3600.0),
            signing=lambda _robot: ashore,
        )

    def conflicts(self) -> list[str]:
        return [report.conflict for report in self.heard.of(LinkReport) if report.conflict]

    def frames(self) -> int:
        return self.station.link_report(MINI).frames_received

    async def says(self, caller: DatagramTransport, codec: Codec) -> None:
        await until(lambda: caller.max_payload)
        await caller.send(FAR_END, frame(codec))


async def next_heard(caller: DatagramTransport) -> bytes:
    async with asyncio.timeout(60):
        async for event in caller.events():
            if isinstance(event, Received):
                return event.data
    raise AssertionError


def waiting(caller: DatagramTransport) -> list[bytes]:
    """Return what waits to be read: what was sent on loopback is there at once."""
    assert isinstance(caller, KeptTransport)
    return [event.data for event in caller._keeper._events._queue if isinstance(event, Received)]


@asynccontextmanager
async def case(kind: str, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Case]:
    clock_s = [1000.0]
    monkeypatch.setattr(far_end, "monotonic_s", lambda: clock_s[0])
    it = Case(f"{kind}://127.0.0.1:{free_port(KIND[kind])}?listen=1", clock_s)
    async with tasks_running(it.station.run):
        await until(lambda: kind == "tcp" or it.port.max_payload)  # a caller opens TCP
        yield it


@asynccontextmanager
async def caller(it: Case) -> AsyncIterator[DatagramTransport]:
    async with running(open_transport(it.uri.removesuffix("?listen=1"))) as transport:
        yield transport


@pytest.mark.parametrize("kind", KIND)
async def test_an_impostor_that_was_there_first_keeps_no_robot_out(
    kind: str, monkeypatch: pytest.MonkeyPatch
):
    async with case(kind, monkeypatch) as it, caller(it) as false, caller(it) as true:
        await it.says(false, impostor())
        await until(lambda: it.station.link_report(MINI).frames_bad)
        report = it.station.link_report(MINI)
        assert report.frames_received == 0
        assert report.state is not LinkState.LIVE, "only what is proved is contact"
        assert "is not signed with the key of" in report.trouble
        assert "127.0.0.1 port" in report.trouble
        assert report.conflict == "", "the robot itself may lack its key"
        await it.says(true, robot())
        await until(lambda: it.frames() == 1)


@pytest.mark.parametrize("kind", KIND)
@pytest.mark.parametrize("silence_s", [1.0, 3600.0])
async def test_what_proves_nothing_never_gets_what_is_meant_for_the_robot(
    kind: str, silence_s: float, monkeypatch: pytest.MonkeyPatch
):
    async with case(kind, monkeypatch) as it, caller(it) as true, caller(it) as false:
        await it.says(true, robot())
        await until(lambda: it.frames() == 1)
        it.clock_s[0] += silence_s
        await it.says(false, impostor())
        await until(it.conflicts)
        assert "127.0.0.1 port" in it.conflicts()[-1], "who it is has a name"
        assert "it is not obeyed" in it.conflicts()[-1]
        while waiting(false):  # heartbeats from before the robot was known
            await next_heard(false)
        for _ in range(3):
            await it.port.send(FAR_END, frame(impostor()))
            await next_heard(true)
        assert not waiting(false)
        assert it.frames() == 1


@pytest.mark.parametrize("kind", KIND)
async def test_a_robot_that_proves_itself_from_elsewhere_takes_its_place_after_a_silence(
    kind: str, monkeypatch: pytest.MonkeyPatch
):
    codec = robot()
    async with case(kind, monkeypatch) as it, caller(it) as first, caller(it) as second:
        await it.says(first, codec)
        await until(lambda: it.frames() == 1)
        await it.says(second, codec)
        await until(it.conflicts)
        assert it.frames() == 1, "while the first one speaks"
        it.clock_s[0] += 60.0
        await it.says(second, codec)
        await until(lambda: it.frames() == 2)
        await until(lambda: "has taken the place" in it.conflicts()[-1])
        await it.port.send(FAR_END, told := frame(impostor()))
        while told not in await next_heard(second):
            pass
        assert not any(told in data for data in waiting(first))


async def test_one_unsigned_frame_beside_a_signed_robot_on_one_line_is_told_at_once():
    second = asyncio.Event()

    async def speak(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(frame(robot()))
        await second.wait()
        writer.write(frame(impostor()))
        await asyncio.Event().wait()

    async with serving(speak) as number:
        uri = f"tcp://127.0.0.1:{number}"
        heard, ashore = Heard(), signing()
        station = StationLink(
            {uri: open_transport(uri)},
            {MINI: RobotEndpoint(SYSTEMS[MINI], (RadioPath(uri),))},
            SystemClock(),
            heard,
            replace(HASTE, report_s=3600.0),
            signing=lambda _robot: ashore,
        )
        async with tasks_running(station.run):
            await until(lambda: station.link_report(MINI).frames_received == 1)
            second.set()
            await until(lambda: any(report.conflict for report in heard.of(LinkReport)))
            conflict = station.link_report(MINI).conflict
    assert f"somebody on {uri} speaks as system" in conflict
    assert "without its key; it is not obeyed" in conflict


@pytest.mark.parametrize("kind", KIND)
async def test_an_impostor_on_another_link_of_the_robot_is_told_at_once(kind: str):
    async def speak(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(frame(robot()))
        await reader.read()

    async with serving(speak) as number:
        own = f"tcp://127.0.0.1:{number}"
        other = f"{kind}://127.0.0.1:{free_port(KIND[kind])}"
        uris = (own, f"{other}?listen=1")
        heard, ashore = Heard(), signing()
        ports = {uri: open_transport(uri) for uri in uris}
        station = StationLink(
            ports,
            {MINI: RobotEndpoint(SYSTEMS[MINI], tuple(RadioPath(uri) for uri in uris))},
            SystemClock(),
            heard,
            replace(HASTE, report_s=3600.0),
            signing=lambda _robot: ashore,
        )
        async with tasks_running(station.run), running(open_transport(other)) as false:
            await until(lambda: station.link_report(MINI).frames_received == 1)
            await until(lambda: kind == "tcp" or ports[uris[1]].max_payload)
            await until(lambda: false.max_payload)
            await false.send(FAR_END, frame(impostor()))
            await until(lambda: any(report.conflict for report in heard.of(LinkReport)))
            assert "127.0.0.1 port" in station.link_report(MINI).conflict
            reports = {report.uri: report for report in station.link_reports(MINI)}
            assert reports[uris[1]].frames_received == 0


async def test_another_radio_without_the_key_is_told_by_its_address(tmp_path: Path):
    on_board, ashore = signing(), signing()
    async with (
        rig(tmp_path, CALM, signing=on_board) as it,
        it.station(signing=lambda _robot: ashore) as (station, heard),
    ):
        await until(lambda: station.link_report(MINI).frames_received)
        await it.air.transmit(Address(0xBAD), STATION, frame(impostor()))
        await until(lambda: any(report.conflict for report in heard.of(LinkReport)))
        assert "0000000000000BAD" in station.link_report(MINI).conflict


def host_of(caller: tuple[str, int]) -> str:
    return caller[0]


def test_where_nothing_proves_who_speaks_another_host_waits_until_the_plug_was_pulled():
    now_s = [0.0]
    end = FarEnd[tuple[str, int]](10.0, host_of, lambda: now_s[0])
    first, again, other = ("10.0.0.2", 5000), ("10.0.0.2", 6000), ("10.0.0.9", 5000)
    assert end.accept(first, may_move=False)
    assert not end.accept(again, may_move=False)
    now_s[0] = 11.0
    assert end.admits(other)
    assert not end.accept(other, may_move=False)
    assert end.caller == first
    assert end.accept(again, may_move=False)
    end.forget()
    assert end.accept(other, may_move=False)
