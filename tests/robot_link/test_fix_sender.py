"""Fixes over the emulated radio: the newest, once, signed, within a small part of the radio."""

import asyncio
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from datetime import timedelta

import pytest

from robot_link.clock import SystemClock, monotonic_s
from robot_link.mavlink.codec import Codec
from robot_link.mavlink.fix import fix_message
from robot_link.mavlink.signing import MemorySigningMemory, Signing
from robot_link.mavlink.wire import grace
from robot_link.messages import LinkState, RawFrame, SystemId
from robot_link.report import VehicleWord
from robot_link.service.clock_sync import ClockOffset, ClockSource
from robot_link.station import fix_sender
from robot_link.station.error import NoAnswerError
from robot_link.station.fix_sender import CLOCK_UNSURE_S, PERIOD_S, FixPace, FixSender
from robot_link.transport.xbee import BYTES_PER_S
from simulator.xbee_network import AirConditions
from tests.robot_link.fix_case import FIX
from tests.robot_link.rig import GRACE, MINI, ROUGH, pass_time, rig, settled, until

NOW = SystemClock().now
KEY = bytes(range(32))


def fresh(**changes):
    return replace(FIX, measured_at=NOW(), **changes)


def signing():
    return Signing(KEY, MemorySigningMemory(), SystemClock())


async def compared(services):
    """Wait until a clock is known, and compare again where the machine stood still meanwhile."""
    await until(lambda: services.clock.offset is not None)
    while services.clock.offset.uncertainty_s > CLOCK_UNSURE_S / 2.0:
        with suppress(NoAnswerError):
            await services.clock.measure()


@asynccontextmanager
async def on_the_road(tmp_path, **conditions):
    """A robot in contact whose clock is known."""
    equipment = {"signing": signing()}
    async with (
        rig(tmp_path, **conditions, **equipment) as world,
        world.station(signing=lambda _: signing()) as (link, heard),
    ):
        services = link.services(MINI)
        await until(lambda: services.is_live)
        await compared(services)
        yield world, link, heard


async def sent_for(link, fixes, period_s):
    """Hand over fixes as cameras find them; return when the radio took one."""
    taken = []
    for number in range(fixes):
        fix = fresh(ned_m=(number / 100.0, 0.7, 0.5))
        assert link.send_fix(fix, taken.append) == ""
        await asyncio.sleep(period_s)
    return taken


def frames_of(heard):
    """Return the fixes that left the station."""
    reader = Codec(SystemId(1), 1)
    for event in heard.of(RawFrame):
        if event.outgoing:
            for message in reader.unpack(event.data).messages:
                if isinstance(message, grace.MAVLink_grace_fix_message):
                    yield event.data


async def test_newest_fix_arrives_signed_and_its_sender_is_told_when_it_left(tmp_path, monkeypatch):
    monkeypatch.setattr(fix_sender, "AGE_MAX_S", 60.0)
    async with on_the_road(tmp_path) as (world, link, heard):
        program = world.robots[MINI].program
        left = []
        fix = fresh()
        assert link.send_fix(fix, left.append) == ""
        await until(lambda: program.fixes)
        assert program.fixes[0].ned_m == pytest.approx(fix.ned_m)
        assert abs(program.fixes[0].measured_at - fix.measured_at) < timedelta(seconds=0.2)
        (at,) = left
        assert fix.measured_at <= at <= NOW()
        (frame,) = frames_of(heard)
        assert len(frame) == 77


async def test_fixes_that_come_faster_are_replaced_by_the_newest_and_never_resent(tmp_path):
    async with on_the_road(tmp_path, conditions=ROUGH) as (world, link, heard):
        program = world.robots[MINI].program
        began_s = monotonic_s()
        taken = await sent_for(link, 100, 0.02)
        await until(lambda: program.fixes)
        frames = list(frames_of(heard))
        assert len(frames) == len(set(frames)) <= len(taken) + 1
        # 5 Hz: 385 bytes a second at most
        assert len(frames) <= 1 + (monotonic_s() - began_s) / PERIOD_S


async def test_slow_radio_carries_a_fix_a_second_at_most_for_all_its_robots(tmp_path):
    async with (
        rig(tmp_path, robots=(MINI, GRACE)) as world,
        world.station() as (link, heard),
    ):
        for robot in (MINI, GRACE):
            await compared(link.services(robot))
        link._transports[world.uri].bytes_per_s = BYTES_PER_S[10]
        began_s = monotonic_s()
        programs = [world.robots[robot].program for robot in (MINI, GRACE)]
        while monotonic_s() - began_s < 3.0 or not all(program.fixes for program in programs):
            for robot in (MINI, GRACE):
                link.send_fix(fresh(robot=robot), lambda _: None)
            await asyncio.sleep(0.05)
        frames = list(frames_of(heard))
        assert 2 <= len(frames) <= 1 + (monotonic_s() - began_s)


async def test_each_robot_is_told_its_own_place_and_counts_those_of_others(tmp_path):
    async with rig(tmp_path, robots=(MINI, GRACE)) as world, world.station() as (link, _):
        await compared(link.services(GRACE))
        for number in range(5):
            fix = fresh(robot=GRACE, ned_m=(1.0, 0.1 * number, 0.0))
            assert link.send_fix(fix, lambda _: None) == ""
            await asyncio.sleep(0.2)
        await until(lambda: world.robots[GRACE].program.fixes)
        assert world.robots[MINI].program.fixes == []


async def test_a_fix_for_everybody_is_for_nobody(tmp_path):
    async with on_the_road(tmp_path) as (world, link, _):
        program, peer = world.robots[MINI].program, link.services(MINI)._peer

        await peer.say_once(fix_message(fresh(), SystemId(0), 0.0), lambda _: None)
        await until(lambda: program.refused_fixes)
        assert program.refused_fixes[0] == "the fix is for system 0"
        assert program.fixes == []


async def test_why_a_robot_takes_no_fix_is_heard_at_the_station(tmp_path):
    why = "Fixes are not taken: the robot is 0.30 m deep; fixes count to 0.05 m"
    async with on_the_road(tmp_path) as (world, _, heard):
        world.robots[MINI].link.say(why)
        await until(lambda: heard.of(VehicleWord))
        words = heard.of(VehicleWord)
        assert [(word.robot, word.severity, word.text) for word in words] == [(MINI, 4, why)]


async def test_fix_is_not_sent_before_the_clocks_were_compared_or_while_they_are_unsure(tmp_path):
    async with rig(tmp_path) as world, world.station() as (link, _):
        services = link.services(MINI)
        await until(lambda: services.is_live)

        def answer_with(offset):
            sender = FixSender(services._peer, lambda: offset, FixPace())
            return sender.send(fresh(), lambda _: None)

        assert "not compared" in answer_with(None)
        assert "not compared" in answer_with(ClockOffset(0.0, 0.0, ClockSource.FRAMES, NOW()))
        unsure = ClockOffset(0.0, 0.3, ClockSource.TIMESYNC, NOW())
        assert "0.3 s" in answer_with(unsure)
        assert answer_with(replace(unsure, uncertainty_s=0.1)) == ""


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"measured_at": NOW() - timedelta(seconds=60)}, "old"),
        ({"quality": "refused", "reason": "rms 5.4"}, "rms 5.4"),
        ({"ned_m": (float("nan"), 0.0, 0.0)}, "finite"),
    ],
)
async def test_fix_that_no_robot_would_take_is_not_sent_and_the_reason_told(
    tmp_path, change, reason
):
    async with on_the_road(tmp_path) as (_, link, _heard):
        fix = replace(fresh(), **change)
        assert reason in link.send_fix(fix, lambda _: pytest.fail("it was sent"))


async def test_robot_out_of_contact_is_told_no_fix(tmp_path, monkeypatch):
    async with on_the_road(tmp_path) as (world, link, _):
        world.reachable.clear()
        await settled(lambda: link.link_report(MINI).frames_received)
        pass_time(monkeypatch, 100.0)
        await until(lambda: link.link_report(MINI).state is not LinkState.LIVE)
        assert "contact" in link.send_fix(fresh(), lambda _: pytest.fail("it was sent"))


async def test_fixes_on_a_rough_late_radio_are_lost_doubled_or_late_and_never_changed(tmp_path):
    late = AirConditions(loss=0.2, duplication=0.3, delay_s=0.01, jitter_s=0.05, mac_retries=0)
    async with on_the_road(tmp_path, conditions=late) as (world, link, _):
        program, sent = world.robots[MINI].program, set()
        while len(program.fixes) < 8:
            sent.add(len(sent) / 100.0)
            fix = fresh(ned_m=(max(sent), 0.7, 0.5))
            assert link.send_fix(fix, lambda _: None) == ""
            await asyncio.sleep(0.2)
        assert {round(fix.ned_m[0], 4) for fix in program.fixes} <= sent
