"""Two robots under one system id are noticed, by their radios or by the numbers of their frames."""

import asyncio
import random
import socket
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.clock import SystemClock
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.telemetry import state_message
from robot_link.messages import LinkReport, SystemId
from robot_link.service.duplicate import NumberWatch
from robot_link.station.link import RadioPath, RobotEndpoint, StationLink
from robot_link.transport import far_end
from robot_link.transport.datagram import FAR_END, Address
from robot_link.transport.opening import open_transport
from tests.free_port import free_port
from tests.robot_link.rig import HASTE, MINI, STATION, SYSTEMS, Heard, rig, running, state, until
from tests.tcp_peer import serving


def frame(codec: Codec) -> bytes:
    return codec.pack(state_message(state(SystemClock().now())))


async def test_another_radio_under_a_robots_system_id_is_told_with_its_links(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).frames_received)
        foreigner = Codec(SYSTEMS[MINI], ROBOT_COMPONENT)
        await it.air.transmit(Address(0xBAD), STATION, frame(foreigner))
        await until(lambda: any(report.conflict for report in heard.of(LinkReport)))
        report = station.link_report(MINI)
        assert "another radio (0000000000000BAD) speaks as system" in report.conflict
        assert report.conflict in report.trouble


@pytest.mark.parametrize("robots", [1, 2])
async def test_two_robots_on_a_line_without_addresses_are_told(robots: int):
    async def speak(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        codecs = [Codec(SYSTEMS[MINI], ROBOT_COMPONENT) for _ in range(robots)]
        for _ in range(100):
            frame(codecs[0])
        for number in range(60):
            writer.write(frame(codecs[number % robots]))
            await asyncio.sleep(0.005)

    async with serving(speak) as port:
        uri = f"tcp://127.0.0.1:{port}"
        heard = Heard()
        endpoint = RobotEndpoint(SYSTEMS[MINI], (RadioPath(uri),))
        station = StationLink(
            {uri: open_transport(uri)}, {MINI: endpoint}, SystemClock(), heard, HASTE
        )
        async with running(station.run):
            await until(lambda: station.link_report(MINI).frames_received >= 60)
            conflict = station.link_report(MINI).conflict
    assert bool(conflict) == (robots == 2)
    if robots == 2:
        assert f"two robots speak as system {SYSTEMS[MINI]} on {uri}" in conflict


async def test_a_second_one_on_a_udp_port_is_told_at_once_and_when_it_takes_the_place(
    monkeypatch: pytest.MonkeyPatch,
):
    at_s = [1000.0]
    monkeypatch.setattr(far_end, "monotonic_s", lambda: at_s[0])
    uri = f"udp://127.0.0.1:{free_port(socket.SOCK_DGRAM)}?listen=1"
    heard = Heard()
    endpoint = RobotEndpoint(SYSTEMS[MINI], (RadioPath(uri),))
    slow = replace(HASTE, report_s=3600.0)
    port = open_transport(uri)
    station = StationLink({uri: port}, {MINI: endpoint}, SystemClock(), heard, slow)
    called = uri.removesuffix("?listen=1")
    first, second = (open_transport(called) for _ in range(2))
    codecs = [Codec(SYSTEMS[MINI], ROBOT_COMPONENT) for _ in range(2)]
    stranger = Codec(SystemId(77), ROBOT_COMPONENT)

    def conflicts() -> list[str]:
        return [report.conflict for report in heard.of(LinkReport) if report.conflict]

    async with running(station.run), running(first.run), running(second.run):
        await until(lambda: port.max_payload and first.max_payload and second.max_payload)
        await first.send(FAR_END, frame(codecs[0]))
        await until(lambda: station.link_report(MINI).frames_received == 1)
        await second.send(FAR_END, stranger.pack(state_message(state(SystemClock().now()))))
        await until(lambda: station.link_report(MINI).frames_bad)
        assert not conflicts(), "another system is no second robot"
        await second.send(FAR_END, frame(codecs[1]))
        await until(conflicts)
        assert "it is not obeyed" in conflicts()[-1]
        assert station.link_report(MINI).frames_received == 1
        at_s[0] += 60.0
        await second.send(FAR_END, frame(codecs[1]))
        await until(lambda: "has taken the place" in conflicts()[-1])


@given(st.integers(0, 255), st.integers(1, 1000), st.sampled_from([0.0, 0.05, 0.3, 0.7]))
def test_one_robot_that_loses_frames_is_no_two(start: int, seed: int, loss: float):
    rng, watch = random.Random(seed), NumberWatch()
    for count in range(3000):
        if rng.random() >= loss:
            watch.note((start + count) % 256, count * 0.01)
        assert not watch.is_double(count * 0.01)


@given(st.integers(1, 255), st.integers(1, 1000), st.floats(0.1, 0.9))
def test_two_robots_are_two_however_far_apart_their_numbers(apart: int, seed: int, share: float):
    rng, watch = random.Random(seed), NumberWatch()
    numbers = [0, apart]
    news = 0
    for count in range(400):
        speaker = int(rng.random() < share)
        numbers[speaker] = (numbers[speaker] + 1) % 256
        news += watch.note(numbers[speaker], count * 0.05)
    assert news == 1, "it is told once"
    assert watch.is_double(20.0)
    assert not watch.is_double(500.0)


def test_a_robot_that_starts_again_is_no_two():
    watch = NumberWatch()
    for count in range(5000):
        watch.note(count % 37, count * 0.1)
    assert not watch.is_double(500.0)


def test_robot_whose_frames_a_router_brings_twice_is_one():
    watch = NumberWatch()
    for count in range(600):
        assert not watch.note(count // 2 % 256, count * 0.01)
