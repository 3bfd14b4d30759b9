"""Station and robot through the emulated air: telemetry, health of the road, foreign frames."""

import asyncio
import dataclasses
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from robot_link.clock import SystemClock
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec, packets
from robot_link.mavlink.telemetry import (
    SAMPLE_FRAME_BYTES,
    acknowledged_sequences,
    sample_message,
    state_message,
)
from robot_link.messages import (
    LinkReport,
    LinkState,
    LogId,
    OnboardPlanState,
    PlanReport,
    RawFrame,
    RobotMode,
    Sample,
    StateReport,
)
from robot_link.report import LinkEvent
from robot_link.sample_log import Measurement
from robot_link.station.link import RadioPath, RobotEndpoint, StationLink
from robot_link.timing import LinkTiming
from robot_link.transport.datagram import (
    BROADCAST,
    Address,
    Delivery,
    Fate,
    PortChanged,
    TransportEvent,
)
from robot_link.transport.opening import open_transport
from robot_link.transport.xbee import XBeeTransport
from robot_link.transport.xbee_frame import ReceivePacket, encode
from simulator.xbee_network import AirConditions
from tests.robot_link.rig import (
    ADDRESSES,
    CALM,
    GRACE,
    HASTE,
    MINI,
    ROUGH,
    STATION,
    SYSTEMS,
    pass_time,
    rig,
    running,
    settled,
    state,
    until,
)
from tests.robot_link.scripted_port import ScriptedPort, answering_questions, opener


async def test_a_state_arrives_as_it_was_measured(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        sent = state(SystemClock().now())
        it.robots[MINI].link.report_state(sent)
        await until(lambda: heard.of(StateReport))
        (report,) = heard.of(StateReport)
        assert report.measured_at == sent.measured_at
        assert report.received_at >= sent.measured_at
        for name in StateReport.__dataclass_fields__:
            if name not in ("measured_at", "received_at"):
                assert getattr(report, name) == getattr(sent, name), name


async def test_newer_states_replace_those_that_a_busy_radio_did_not_take(tmp_path: Path):
    async with rig(tmp_path, AirConditions(delay_s=0.05)) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        at = SystemClock().now()
        for mode in RobotMode:
            it.robots[MINI].link.report_state(state(at, mode))
        await until(lambda: heard.of(StateReport))
        assert heard.of(StateReport)[-1].mode is list(RobotMode)[-1]
        assert len(heard.of(StateReport)) < len(RobotMode)


async def test_the_road_is_never_heard_then_live_then_stale(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    async with rig(tmp_path) as it:
        it.reachable.clear()
        async with it.station() as (station, heard):
            await until(lambda: station.link_report(MINI).state is LinkState.NEVER_HEARD)
            it.reachable.add(MINI)
            await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
            it.reachable.clear()
            await settled(lambda: station.link_report(MINI).frames_received)
            pass_time(monkeypatch, 100.0)
            await until(lambda: station.link_report(MINI).state is LinkState.STALE)
            told = [report.state for report in heard.of(LinkReport)]
            assert LinkState.NEVER_HEARD in told
            assert told.index(LinkState.LIVE) < len(told)
            assert station.link_report(MINI).heard_at is not None


async def test_silence_after_an_announced_dive_is_no_loss(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    async with rig(tmp_path) as it, it.station() as (station, _heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        it.robots[MINI].link.set_mode(RobotMode.DIVING)
        await until(lambda: station._roster[MINI].peer.mode is RobotMode.DIVING)
        it.reachable.clear()
        await settled(lambda: station.link_report(MINI).frames_received)
        pass_time(monkeypatch, 100.0)
        await until(lambda: station.link_report(MINI).state is LinkState.SUBMERGED)
        pass_time(monkeypatch, 1000.0)
        assert station.link_report(MINI).state is LinkState.SUBMERGED
        it.reachable.add(MINI)
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)


async def test_strength_of_the_signal_is_told(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, _heard):
        await until(lambda: station.link_report(MINI).rssi_dbm == it.air.conditions.rssi_dbm)


async def test_a_pulled_plug_is_told_and_healed_without_a_restart(tmp_path: Path):
    async with (
        AsyncExitStack() as cable,
        rig(tmp_path, cable=cable) as it,
        it.station() as (station, heard),
    ):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        await cable.aclose()
        await until(lambda: station.link_report(MINI).state is LinkState.PORT_CLOSED)
        await until(lambda: heard.of(LinkReport)[-1].state is LinkState.PORT_CLOSED)
        async with it.air.pty(STATION, tmp_path / "xbee"):
            await until(lambda: station.link_report(MINI).state is LinkState.LIVE)


async def test_what_the_robot_says_of_its_plan_is_repeated_until_it_changes(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (_station, heard):
        await until(lambda: len(heard.of(PlanReport)) >= 2)
        assert {report.state for report in heard.of(PlanReport)} == {OnboardPlanState.NONE}
        assert heard.of(PlanReport)[0].sha256 is None
        it.robots[MINI].link.report_plan(
            OnboardPlanState.FAILED, leg=2, energy_used=3.5, reason="floor too near"
        )
        await until(lambda: heard.of(PlanReport)[-1].state is OnboardPlanState.FAILED)
        last = heard.of(PlanReport)[-1]
        assert (last.leg, last.energy_used, last.reason) == (2, 3.5, "floor too near")


async def test_a_foreign_radio_under_a_known_system_id_is_dropped_and_counted(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        foreigner = Address(0xBAD)
        frame = Codec(SYSTEMS[MINI], ROBOT_COMPONENT).pack(
            state_message(state(SystemClock().now()))
        )
        await it.air.transmit(foreigner, STATION, frame)
        await until(lambda: station.link_report(MINI).frames_bad == 1)
        assert not heard.of(StateReport)
        assert any(raw.robot is None and raw.data == frame for raw in heard.of(RawFrame))


async def test_a_robots_radio_cannot_speak_for_another_robot(tmp_path: Path):
    async with rig(tmp_path, robots=(MINI, GRACE)) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(GRACE).state is LinkState.LIVE)
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        frame = Codec(SYSTEMS[GRACE], ROBOT_COMPONENT).pack(
            state_message(state(SystemClock().now()))
        )
        await it.air.transmit(ADDRESSES[MINI], STATION, frame)
        await until(lambda: station.link_report(MINI).frames_bad == 1)
        assert station.link_report(GRACE).frames_bad == 0
        assert not heard.of(StateReport)


async def test_what_is_not_understood_is_no_contact(tmp_path: Path):
    async with rig(tmp_path) as it:
        it.reachable.clear()
        async with it.station() as (station, _heard):
            await until(lambda: station.link_report(MINI).state is LinkState.NEVER_HEARD)
            impossible = state_message(state(SystemClock().now()))
            impossible.x = float("nan")
            frame = Codec(SYSTEMS[MINI], ROBOT_COMPONENT).pack(impossible)
            await it.air.transmit(Address(0xBAD), STATION, frame)
            await until(lambda: station.link_report(MINI).frames_bad == 1)
            assert station.link_report(MINI).state is LinkState.NEVER_HEARD
            assert station.link_report(MINI).radio == ""


async def test_garbage_from_the_air_and_impossible_content_are_counted(tmp_path: Path):
    async with rig(tmp_path) as it, it.station(bind=True) as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        codec = Codec(SYSTEMS[MINI], ROBOT_COMPONENT)
        impossible = state_message(state(SystemClock().now()))
        impossible.x = float("nan")
        frames = codec.pack(impossible) + b"garbage"
        await it.air.transmit(ADDRESSES[MINI], STATION, frames)
        await until(lambda: station.link_report(MINI).frames_bad == 2)
        await it.air.transmit(ADDRESSES[MINI], STATION, b"")
        await it.air.transmit(STATION, ADDRESSES[MINI], b"\xfd" * 40)
        await until(lambda: it.robots[MINI].link.frames_bad > 0)
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        assert not heard.of(StateReport)


async def test_raw_frames_are_kept_in_both_directions(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        await until(lambda: {raw.outgoing for raw in heard.of(RawFrame)} == {True, False})
        assert all(raw.data and raw.carrier == "xbee" for raw in heard.of(RawFrame))


async def test_samples_are_told_once_though_acknowledgements_are_lost(tmp_path: Path):
    async with rig(tmp_path, ROUGH) as it, it.station() as (_station, heard):
        robot = it.robots[MINI].link
        at = SystemClock().now()
        for number in range(300):
            robot.record_sample("blue_light", number / 2, (1.0, 2.0, 0.25), 0.125, at)
        await until(lambda: not robot.unacknowledged_samples)
        samples = heard.of(Sample)
        assert sorted(sample.sequence for sample in samples) == list(range(300))
        assert all(sample.value == sample.sequence / 2 for sample in samples)
        assert (samples[0].variable, samples[0].position_ned) == ("blue_light", (1.0, 2.0, 0.25))


async def test_samples_that_nobody_stores_come_again(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        heard.stores = False
        robot = it.robots[MINI].link
        robot.record_sample("blue_light", 1.0, (0.0, 0.0, 0.0), 0.1, SystemClock().now())
        await until(lambda: len(heard.of(Sample)) >= 3)
        assert robot.unacknowledged_samples == 1
        first = heard.of(Sample)[0]
        station.acknowledge_samples(MINI, first.log, [first.sequence])
        await until(lambda: not robot.unacknowledged_samples)


async def test_an_acknowledgement_of_another_log_changes_nothing(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        heard.stores = False
        robot = it.robots[MINI].link
        robot.record_sample("blue_light", 1.0, (0.0, 0.0, 0.0), 0.1, SystemClock().now())
        await until(lambda: heard.of(Sample))
        station.acknowledge_samples(MINI, LogId(heard.of(Sample)[0].log + 1), [0])
        await asyncio.sleep(0.2)
        assert robot.unacknowledged_samples == 1


async def test_a_submerged_robot_does_not_talk_to_itself(tmp_path: Path):
    """After a few datagrams without an answer, samples wait for the station's next word."""
    patient = dataclasses.replace(HASTE, stale_s=30.0)
    async with rig(tmp_path, timing=patient) as it, it.station():
        robot = it.robots[MINI].link
        robot.record_sample("blue_light", 0.0, (0.0, 0.0, 1.0), 0.1, SystemClock().now())
        await until(lambda: not robot.unacknowledged_samples)
        it.reachable.clear()
        attempts: list[bytes] = []
        transmit = it.air.air.transmit

        def counted(source: Address, destination: Address, data: bytes):
            if len(data) >= SAMPLE_FRAME_BYTES:
                attempts.append(data)
            return transmit(source, destination, data)

        it.air.air.transmit = counted
        for number in range(100):
            robot.record_sample("blue_light", number, (0.0, 0.0, 1.0), 0.1, SystemClock().now())
        await until(lambda: attempts)
        await asyncio.sleep(0.5)
        assert len(attempts) <= 20


async def test_samples_of_a_dive_are_filled_in_order_after_it(tmp_path: Path):
    """In order up to what the radio has under way at once, and what it lost on the way."""
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        it.reachable.clear()
        robot = it.robots[MINI].link
        for number in range(400):
            robot.record_sample("blue_light", number, (0.0, 0.0, 1.0), 0.1, SystemClock().now())
        await asyncio.sleep(0.3)
        assert not heard.of(Sample)
        it.reachable.add(MINI)
        await until(lambda: not robot.unacknowledged_samples)
        sequences = [sample.sequence for sample in heard.of(Sample)]
        assert sorted(sequences) == list(range(400))
        assert max(abs(place - number) for place, number in enumerate(sequences)) <= 100


async def test_bursts_of_two_robots_cost_little(tmp_path: Path):
    """Twenty-fold time: what a dive gathered must cross in one short surfacing."""
    calm = AirConditions(delay_s=0.005, jitter_s=0.005)
    async with (
        rig(tmp_path, calm, robots=(MINI, GRACE), timing=LinkTiming()) as it,
        it.station(LinkTiming()) as (station, heard),
    ):
        for robot in it.robots:
            await until(lambda robot=robot: station.link_report(robot).state is LinkState.LIVE)
        began_s = time.process_time()
        for robot in it.robots.values():
            for number in range(500):
                robot.link.record_sample(
                    "chlorophyll", number, (0.0, 0.0, 1.0), 0.1, SystemClock().now()
                )
        await until(
            lambda: not any(robot.link.unacknowledged_samples for robot in it.robots.values())
        )
        assert time.process_time() - began_s < 3.0
        assert len(heard.of(Sample)) == 1000


async def test_a_number_that_is_not_finite_is_no_sample(tmp_path: Path):
    async with rig(tmp_path, CALM) as it:
        with pytest.raises(ValueError, match="not finite"):
            it.robots[MINI].link.record_sample(
                "blue_light", float("nan"), (0.0, 0.0, 0.0), 0.1, SystemClock().now()
            )
        with pytest.raises(KeyError):
            it.robots[MINI].link.record_sample(
                "unheard_of", 1.0, (0.0, 0.0, 0.0), 0.1, SystemClock().now()
            )
        assert it.robots[MINI].link.unacknowledged_samples == 0


async def test_garbage_at_the_port_is_shown_for_every_robot_of_that_port():
    port = ScriptedPort(answering_questions)
    transport = XBeeTransport(opener(port))
    robots = {
        robot: RobotEndpoint(SYSTEMS[robot], (RadioPath("port", ADDRESSES[robot]),))
        for robot in (MINI, GRACE)
    }
    station = StationLink({"port": transport}, robots, SystemClock(), lambda _: None, HASTE)
    async with running(station.run):
        port.bring(b"\xff" * 20)
        await until(lambda: station.link_report(MINI).frames_bad == 1)
        assert station.link_report(GRACE).frames_bad == 1


async def test_two_thousand_messages_a_second_are_far_from_filling_a_core():
    port = ScriptedPort(answering_questions)
    values: list[Sample] = []

    def keep(event: LinkEvent) -> None:
        if isinstance(event, Sample):
            values.append(event)

    transport = XBeeTransport(opener(port))
    endpoint = RobotEndpoint(SYSTEMS[MINI], (RadioPath("port", ADDRESSES[MINI]),))
    station = StationLink({"port": transport}, {MINI: endpoint}, SystemClock(), keep)
    codec = Codec(SYSTEMS[MINI], ROBOT_COMPONENT)
    measurement = Measurement("chlorophyll", 1.5, (1.0, 2.0, 3.0), 0.1, SystemClock().now())
    frames = [codec.pack(sample_message(LogId(1), n, measurement)) for n in range(4000)]
    async with running(station.run):
        await until(lambda: transport.max_payload)
        began_s = time.process_time()
        for packet in packets(frames, 256):
            port.bring(encode(ReceivePacket(ADDRESSES[MINI], packet).content(), 1))
        await until(lambda: len(values) == len(frames))
        assert time.process_time() - began_s < len(frames) / 2000


async def test_a_failing_listener_ends_the_link_for_all_to_see(tmp_path: Path):
    """What the owner does wrong with a value is no bad frame."""

    def fails(event: LinkEvent) -> None:
        if isinstance(event, StateReport):
            raise ValueError("the listener is broken")  # noqa: TRY004 - as bad content would

    async with rig(tmp_path) as it:
        station = StationLink(
            {it.uri: open_transport(it.uri)},
            {MINI: RobotEndpoint(SYSTEMS[MINI], (RadioPath(it.uri),))},
            SystemClock(),
            fails,
            HASTE,
        )
        it.robots[MINI].link.report_state(state(SystemClock().now()))
        with pytest.raises(ExceptionGroup) as failure:
            await station.run()
        assert failure.group_contains(ValueError, match="the listener is broken")


class SlowRadio:
    """Takes a datagram and says nothing of it until it is told to."""

    carrier = "slow"
    max_payload = 256
    bytes_per_s = 300.0
    is_enabled = True

    def __init__(self) -> None:
        self.under_way: list[asyncio.Future[Delivery]] = []
        self.sent: list[bytes] = []

    async def run(self) -> None:
        await asyncio.Event().wait()

    def set_enabled(self, is_enabled: bool) -> None:
        self.is_enabled = is_enabled

    async def send(self, address: Address, data: bytes) -> asyncio.Future[Delivery]:
        fate: asyncio.Future[Delivery] = asyncio.get_running_loop().create_future()
        if address == BROADCAST:  # a heartbeat
            fate.set_result(Delivery(Fate.DELIVERED))
        else:
            self.sent.append(data)
            self.under_way.append(fate)
        return fate

    async def events(self) -> AsyncIterator[TransportEvent]:
        await asyncio.Event().wait()
        yield PortChanged(is_open=True, reason="")


async def test_acknowledgements_that_wait_for_a_slow_radio_go_together():
    """They leave room for an order; each would otherwise stand in line before it."""
    radio, far = SlowRadio(), Address(7)
    station = StationLink(
        {"slow": radio},
        {MINI: RobotEndpoint(SYSTEMS[MINI], (RadioPath("slow", far),))},
        SystemClock(),
        lambda _event: None,
        dataclasses.replace(HASTE, acknowledge_s=0.0),
    )
    robot = Codec(SYSTEMS[MINI], ROBOT_COMPONENT)
    async with running(station.run):
        for number in range(40):
            station.acknowledge_samples(MINI, LogId(1), [number])
            await asyncio.sleep(0)
        await until(lambda: radio.sent)
        for number in range(40, 80):
            station.acknowledge_samples(MINI, LogId(1), [number])
            await asyncio.sleep(0.001)
        assert len(radio.under_way) == 1
        radio.under_way[0].set_result(Delivery(Fate.DELIVERED))
        await until(lambda: len(radio.sent) == 2)
        told = [m for data in radio.sent for m in robot.unpack(data).messages]
        stored = {number for message in told for number in acknowledged_sequences(message)}
        assert stored == set(range(80))
