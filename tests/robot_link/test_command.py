"""Commands: levels as they are proved, repetition at each contact, expiry, one action each."""

import asyncio
import dataclasses
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from onboard.link import robot_link as onboard
from onboard.link.command_desk import CommandDesk
from onboard.link.robot_link import CommandOutcome
from robot_link.clock import ScaledClock, SystemClock, monotonic_s
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.mavlink.command import ReceivedCommand, command_message, received_command
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    FIRST_EMERGENCY_NUMBER,
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    LinkState,
    PlanHash,
    PlanReport,
    RawFrame,
    RobotId,
    SystemId,
)
from robot_link.station.command_lane import Command, CommandLane
from robot_link.station.link import StationLink
from robot_link.transport.datagram import Address, Delivery
from simulator.xbee_network import AirConditions
from tests.robot_link.rig import (
    ADDRESSES,
    HASTE,
    MINI,
    ROUGH,
    Heard,
    Program,
    mission,
    rig,
    running,
    soon,
    until,
)

FIRST, SECOND, THIRD = CommandNumber(1), CommandNumber(2), CommandNumber(2**24 - 1)


async def live(station: StationLink) -> None:
    await until(lambda: station.link_report(MINI).state is LinkState.LIVE)


def levels(heard: Heard, number: CommandNumber) -> list[CommandLevel]:
    return [report.level for report in heard.of(CommandReport) if report.number == number]


async def test_a_command_is_queued_then_at_the_radio_then_applied(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        station.send_command(MINI, CommandKind.HOLD, THIRD, soon())
        await until(lambda: CommandLevel.APPLIED in levels(heard, THIRD))
        told = levels(heard, THIRD)
        assert told == sorted(told, key=list(CommandLevel).index)
        assert told[0] is CommandLevel.QUEUED
        assert it.robots[MINI].program.obeyed == [(CommandKind.HOLD, "")]


async def test_start_carries_the_first_digits_of_its_plan(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        plan = mission().sha256()
        station.send_command(MINI, CommandKind.START, FIRST, soon(), plan)
        await until(lambda: CommandLevel.APPLIED in levels(heard, FIRST))
        assert it.robots[MINI].program.obeyed == [(CommandKind.START, plan[:12])]


@pytest.mark.parametrize(
    ("outcome", "reason"),
    [
        (CommandOutcome.NOT_NOW, "the robot cannot do this now"),
        (CommandOutcome.WRONG_PLAN, "the robot holds another plan"),
        (CommandOutcome.UNSUPPORTED, "the robot does not know this command"),
    ],
)
async def test_a_refusal_says_why(tmp_path: Path, outcome: CommandOutcome, reason: str):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        it.robots[MINI].program.outcome = outcome
        station.send_command(MINI, CommandKind.RESUME, FIRST, soon())
        await until(lambda: CommandLevel.REFUSED in levels(heard, FIRST))
        assert heard.of(CommandReport)[-1].reason == reason


async def test_surface_reaches_a_submerged_robot_at_its_next_contact(tmp_path: Path):
    patient = dataclasses.replace(HASTE, retry_s=600.0)
    async with rig(tmp_path) as it, it.station(patient) as (station, heard):
        await live(station)
        it.reachable.clear()
        station.send_command(MINI, CommandKind.SURFACE, FIRST, soon())
        await until(lambda: levels(heard, FIRST))
        await asyncio.sleep(0.5)
        assert levels(heard, FIRST) == [CommandLevel.QUEUED]
        it.reachable.add(MINI)
        await until(lambda: CommandLevel.APPLIED in levels(heard, FIRST))
        assert it.robots[MINI].program.obeyed == [(CommandKind.SURFACE, "")]


async def test_calling_a_robot_that_was_never_heard_proves_nothing(tmp_path: Path):
    async with rig(tmp_path) as it:
        it.reachable.clear()
        async with it.station() as (station, heard):
            station.send_command(MINI, CommandKind.SURFACE, FIRST, soon())
            await until(lambda: levels(heard, FIRST))
            await asyncio.sleep(0.5)
            assert levels(heard, FIRST) == [CommandLevel.QUEUED]


async def test_a_robot_listens_to_one_station_until_it_is_silent_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    patient, passed_s = dataclasses.replace(HASTE, stale_s=120.0), [0.0]
    monkeypatch.setattr(onboard, "monotonic_s", lambda: monotonic_s() + passed_s[0])
    async with rig(tmp_path, timing=patient) as it:
        codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
        surface = command_message(SystemId(1), CommandKind.SURFACE, FIRST, soon(), None)
        async with it.station() as (_station, heard):
            await until(lambda: heard.of(PlanReport))  # the robot has heard the station
            await it.air.transmit(Address(0xBAD), ADDRESSES[MINI], codec.pack(surface))
            await until(lambda: it.robots[MINI].link.frames_bad == 1)
        obeyed = it.robots[MINI].program.obeyed
        assert obeyed == []
        while not obeyed:
            passed_s[0] += 3.5 * patient.stale_s  # a word of the first may still be under way
            await it.air.transmit(Address(0x600D), ADDRESSES[MINI], codec.pack(surface))
            await asyncio.sleep(0.05)
        assert obeyed == [(CommandKind.SURFACE, "")]


@dataclasses.dataclass
class ClockSetAhead:
    """The system's clock, which a test sets ahead."""

    ahead: timedelta = timedelta()
    speed: float = 1.0

    def now(self) -> datetime:
        return SystemClock().now() + self.ahead


async def test_a_command_that_expires_is_never_sent_late(tmp_path: Path):
    clock = ClockSetAhead()
    async with rig(tmp_path) as it, it.station(clock=clock) as (station, heard):
        await live(station)
        it.reachable.clear()
        station.send_command(MINI, CommandKind.RESUME, FIRST, soon(600.0))
        station.send_command(MINI, CommandKind.HOLD, SECOND, soon(-1.0))
        await until(lambda: levels(heard, FIRST) and levels(heard, SECOND))
        clock.ahead = timedelta(seconds=601.0)
        await until(lambda: len(heard.of(CommandReport)) >= 3)
        assert levels(heard, FIRST)[-1] is CommandLevel.EXPIRED
        assert levels(heard, SECOND) == [CommandLevel.EXPIRED]
        reasons = {report.number: report.reason for report in heard.of(CommandReport)}
        assert reasons[FIRST] == "the robot was not in reach in time"
        assert reasons[SECOND] == "the command could not leave the station in time"
        it.reachable.add(MINI)
        before = station.link_report(MINI).frames_received
        await until(lambda: station.link_report(MINI).frames_received > before + 5)
        assert it.robots[MINI].program.obeyed == []


async def test_each_command_acts_once_in_a_rough_air(tmp_path: Path):
    async with rig(tmp_path, ROUGH) as it, it.station() as (station, heard):
        await live(station)
        kinds = [CommandKind.HOLD, CommandKind.RESUME] * 5
        for number, kind in enumerate(kinds, start=1):
            station.send_command(MINI, kind, CommandNumber(number), soon())
        await until(lambda: CommandLevel.APPLIED in levels(heard, CommandNumber(10)))
        assert [kind for kind, _ in it.robots[MINI].program.obeyed] == kinds


async def test_a_restarted_station_sends_a_command_again_and_the_robot_acts_once(tmp_path: Path):
    async with rig(tmp_path) as it:
        expires = soon()
        for _ in range(2):
            async with it.station() as (station, heard):
                await live(station)
                station.send_command(MINI, CommandKind.HOLD, FIRST, expires)
                await until(lambda heard=heard: CommandLevel.APPLIED in levels(heard, FIRST))
        assert len(it.robots[MINI].program.obeyed) == 1


async def test_the_same_number_of_another_day_is_another_command(tmp_path: Path):
    async with rig(tmp_path) as it:
        for expires in (soon(60), soon(120)):
            async with it.station() as (station, heard):
                await live(station)
                station.send_command(MINI, CommandKind.SURFACE, FIRST, expires)
                await until(lambda heard=heard: CommandLevel.APPLIED in levels(heard, FIRST))
        assert len(it.robots[MINI].program.obeyed) == 2


async def test_surface_drops_what_was_commanded_before(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        it.reachable.clear()
        station.send_command(MINI, CommandKind.RESUME, FIRST, soon())
        station.send_command(MINI, CommandKind.START, SECOND, soon(), mission().sha256())
        station.send_command(MINI, CommandKind.SURFACE, THIRD, soon())
        assert levels(heard, FIRST)[-1] is CommandLevel.EXPIRED
        assert levels(heard, SECOND) == [CommandLevel.EXPIRED]
        it.reachable.add(MINI)
        await until(lambda: CommandLevel.APPLIED in levels(heard, THIRD))
        assert it.robots[MINI].program.obeyed == [(CommandKind.SURFACE, "")]


async def test_a_command_that_surface_dropped_is_not_handed_to_the_radio_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    slow = AirConditions(delay_s=0.03, jitter_s=0.0, mac_retries=0)
    async with rig(tmp_path, slow) as it, it.station() as (station, heard):
        await live(station)
        it.reachable.clear()
        transmit, flights = it.air.air.transmit, list[asyncio.Future[Delivery]]()

        def noted(source: Address, destination: Address, data: bytes) -> asyncio.Future[Delivery]:
            fate = transmit(source, destination, data)
            if destination == ADDRESSES[MINI]:
                flights.append(fate)
            return fate

        monkeypatch.setattr(it.air.air, "transmit", noted)
        station.send_command(MINI, CommandKind.START, FIRST, soon(), mission().sha256())
        await until(lambda: levels(heard, FIRST) == [CommandLevel.QUEUED])
        station.send_command(MINI, CommandKind.SURFACE, SECOND, soon())
        heard.events.clear()
        # The radio sends one after the other: attempts of before have flown, and are lost.
        later = len(flights) + 4
        await until(lambda: len(flights) >= later and all(fate.done() for fate in flights))
        it.reachable.add(MINI)
        await until(lambda: CommandLevel.APPLIED in levels(heard, SECOND))
        await asyncio.sleep(0.3)
        assert it.robots[MINI].program.obeyed == [(CommandKind.SURFACE, "")]
        assert not levels(heard, FIRST)


def received(kind: CommandKind, number: int, expiry_s: int = 100) -> ReceivedCommand:
    return ReceivedCommand(kind, CommandNumber(number), expiry_s, "")


def test_a_command_that_surface_overtook_in_the_air_is_not_obeyed():
    program = Program()
    desk = CommandDesk(program)
    assert desk.take(received(CommandKind.SURFACE, 7), 0.0) is CommandOutcome.DONE
    assert desk.take(received(CommandKind.START, 6), 1.0) is CommandOutcome.NOT_NOW
    assert desk.take(received(CommandKind.RESUME, 8), 2.0) is CommandOutcome.DONE
    assert desk.take(received(CommandKind.SURFACE, 5), 3.0) is CommandOutcome.DONE
    assert desk.take(received(CommandKind.START, 1), 90.0) is CommandOutcome.DONE
    kinds = [CommandKind.SURFACE, CommandKind.RESUME, CommandKind.SURFACE, CommandKind.START]
    assert [kind for kind, _ in program.obeyed] == kinds


def test_a_ping_that_comes_after_a_later_order_to_be_quiet_is_not_obeyed():
    program = Program()
    desk = CommandDesk(program)
    assert desk.take(received(CommandKind.QUIET, 7), 0.0) is CommandOutcome.DONE
    assert desk.take(received(CommandKind.PING, 6), 7000.0) is CommandOutcome.NOT_NOW
    assert desk.take(received(CommandKind.PING, 8), 7001.0) is CommandOutcome.DONE
    assert [kind for kind, _ in program.obeyed] == [CommandKind.QUIET, CommandKind.PING]


def test_an_order_to_surface_that_was_not_written_down_is_newer_than_every_other():
    program = Program()
    desk = CommandDesk(program)
    assert desk.take(received(CommandKind.SURFACE, 2**24 - 1), 0.0) is CommandOutcome.DONE
    assert desk.take(received(CommandKind.START, 12), 1.0) is CommandOutcome.NOT_NOW
    assert desk.take(received(CommandKind.START, 13), 90.0) is CommandOutcome.DONE
    assert [kind for kind, _ in program.obeyed] == [CommandKind.SURFACE, CommandKind.START]


def test_a_robot_with_a_full_memory_obeys_all_the_same(caplog):
    class FullMemory:
        def load(self):
            return ()

        def save(self, outcomes):
            raise OSError(28, "No space left on device")

    program = Program()
    desk = CommandDesk(program, FullMemory())
    for _ in range(2):
        assert desk.take(received(CommandKind.SURFACE, 7), 0.0) is CommandOutcome.DONE
    assert program.obeyed == [(CommandKind.SURFACE, "")]
    assert "No space left" in caplog.text


@dataclasses.dataclass
class Radios:
    """Takes by one radio and is confirmed by another; knows what was sent."""

    robot = MINI
    system = SystemId(1)
    clock = SystemClock()
    timing = HASTE
    taken_by = confirmed_by = heard_by = ""
    sent: int = 0

    async def deliver(self, messages, on_taken, is_wanted, *, on_every_path):
        del messages, on_every_path
        assert is_wanted()
        self.sent += 1
        self.taken_by = "serial"
        on_taken()
        self.confirmed_by, self.heard_by = "xbee", "udp"
        return True


def answer(result: int, number: int, kind: CommandKind) -> grace.MAVLink_command_ack_message:
    code = command_message(SystemId(1), kind, FIRST, soon(), None).command
    return grace.MAVLink_command_ack_message(code, result, 0, number)


@pytest.fixture
async def lane():
    told: list[CommandReport] = []
    lane = CommandLane(Radios(), told.append)
    async with running(lane.run):
        yield lane, told


async def test_each_level_names_the_radio_that_proved_it(lane):
    lane, told = lane
    lane.submit(Command(CommandKind.HOLD, FIRST, soon(), None))
    await until(lambda: len(told) == 2)
    lane.answered(answer(grace.MAV_RESULT_ACCEPTED, FIRST, CommandKind.HOLD))
    assert [(one.level, one.carrier) for one in told] == [
        (CommandLevel.QUEUED, "serial"),
        (CommandLevel.RADIO, "xbee"),
        (CommandLevel.APPLIED, "udp"),
    ]


async def test_an_answer_about_another_command_settles_nothing(lane):
    lane, told = lane
    lane.submit(Command(CommandKind.HOLD, FIRST, soon(), None))
    await until(lambda: len(told) == 2)
    lane.answered(answer(grace.MAV_RESULT_ACCEPTED, FIRST, CommandKind.RESUME))
    lane.answered(answer(grace.MAV_RESULT_ACCEPTED, SECOND, CommandKind.HOLD))
    assert len(told) == 2
    lane.answered(answer(grace.MAV_RESULT_UNSUPPORTED, 0, CommandKind.HOLD))
    assert told[-1].level is CommandLevel.REFUSED, "a vehicle that knows no numbers"
    assert told[-1].reason == "the robot does not know this command"


def test_numbers_that_begin_again_are_newer_than_those_before():
    program = Program()
    desk = CommandDesk(program)
    desk.take(received(CommandKind.SURFACE, FIRST_EMERGENCY_NUMBER - 1), 0.0)
    assert desk.take(received(CommandKind.START, 1), 1.0) is CommandOutcome.DONE


def test_the_robot_remembers_the_newest_commands_only():
    program = Program()
    desk = CommandDesk(program)
    for number in [1, *range(1, 80), 79, 1]:
        desk.take(received(CommandKind.HOLD, number), 0.0)
    assert len(program.obeyed) == 80


async def test_surface_leaves_the_port_at_once_and_before_what_was_commanded_earlier(
    tmp_path: Path,
):
    """At most the attempt that is under way with another command goes before it."""
    air = AirConditions(delay_s=0.02, jitter_s=0.01)
    patient = dataclasses.replace(HASTE, retry_s=600.0, answer_s=600.0)
    async with rig(tmp_path, air) as it, it.station(patient) as (station, heard):
        await live(station)
        it.reachable.clear()
        for number in range(1, 6):
            station.send_command(MINI, CommandKind.HOLD, CommandNumber(number), soon())
        await until(lambda: CommandLevel.QUEUED in levels(heard, FIRST))
        heard.events.clear()
        station.send_command(MINI, CommandKind.SURFACE, CommandNumber(9), soon())
        await until(lambda: CommandLevel.QUEUED in levels(heard, CommandNumber(9)))
        sent = numbers_sent(heard)
        assert set(sent) <= {FIRST, 9}
        assert sent.count(FIRST) <= 1


def numbers_sent(heard: Heard) -> list[int]:
    """Return the numbers of the commands that the station's radios took, in order."""
    codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
    messages = [m for raw in heard.of(RawFrame) if raw.outgoing for m in codec.unpack(raw.data)[0]]
    commands = [received_command(m) for m in messages if m.get_type() == "COMMAND_LONG"]
    return [command.number for command in commands if command is not None]


async def test_a_number_submitted_twice_is_carried_once(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        for _ in range(2):
            station.send_command(MINI, CommandKind.HOLD, FIRST, soon())
        await until(lambda: CommandLevel.APPLIED in levels(heard, FIRST))
        await asyncio.sleep(0.1)
        assert levels(heard, FIRST).count(CommandLevel.QUEUED) == 1
        assert len(it.robots[MINI].program.obeyed) == 1


async def test_an_unknown_robot_is_a_key_error(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, _heard):
        with pytest.raises(KeyError):
            station.send_command(RobotId("nobody"), CommandKind.HOLD, FIRST, soon())
        assert it.robots


def test_a_command_keeps_number_expiry_and_digits_on_the_wire():
    plan = PlanHash("00ff01" + "abcdef" + "0" * 52)
    expires = datetime(2106, 2, 7, tzinfo=UTC)
    message = command_message(SystemId(1), CommandKind.START, THIRD, expires, plan)
    command = received_command(message)
    assert command is not None
    assert (command.number, command.plan_digits) == (THIRD, plan[:12])
    assert command.expiry_s == int(expires.timestamp())


def test_parameters_that_are_no_whole_numbers_are_refused():
    message = command_message(SystemId(1), CommandKind.HOLD, FIRST, soon(), None)
    message.param1 = 0.5
    with pytest.raises(ValueError, match="whole number"):
        received_command(message)
    message.command = 400
    assert received_command(message) is None


def test_a_scaled_clock_runs_as_fast_as_told():
    wall = datetime.now(UTC) - timedelta(seconds=10)
    anchor = datetime(2026, 11, 21, tzinfo=UTC)
    clock = ScaledClock(wall, anchor, 20.0)
    before, now, after = datetime.now(UTC), clock.now(), datetime.now(UTC)
    assert anchor + 20.0 * (before - wall) <= now <= anchor + 20.0 * (after - wall)
