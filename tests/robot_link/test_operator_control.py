"""Other ground stations see who is in control of a robot, ask for it, and get an answer."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from datetime import UTC, datetime

import pytest

from onboard.link import operator_desk, robot_link, service_desk
from robot_link.clock import monotonic_s
from robot_link.mavlink.codec import ROBOT_COMPONENT, STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.mavlink.operator_control import (
    ControlWish,
    answer,
    decision,
    passed_on,
    status_message,
    told,
    wish_of,
)
from robot_link.mavlink.wire import grace
from robot_link.messages import CommandKind, RobotId, SystemId
from robot_link.report import ControlAsked, ControlReport
from tests.robot_link.rig import HASTE, mission, running, until
from tests.robot_link.service_pair import ROBOT
from tests.robot_link.test_command_standard import (
    GCS,
    GUEST,
    OTHER,
    GroundStation,
    Scene,
    command,
    scene,
)

NOW = datetime(2026, 5, 1, tzinfo=UTC)
NAME = RobotId("mini-1")
REQUEST = grace.MAV_CMD_REQUEST_OPERATOR_CONTROL
ACCEPTED, DENIED = grace.MAV_RESULT_ACCEPTED, grace.MAV_RESULT_DENIED
IN_PROGRESS = grace.MAV_RESULT_IN_PROGRESS
NOT_NOW = grace.MAV_RESULT_TEMPORARILY_REJECTED


def test_status_is_the_one_of_mavlinks_development_dialect():
    """Bytes of CONTROL_STATUS (512), whose seed of the checksum is 21 there."""
    assert grace.MAVLink_control_status_message.crc_extra == 21
    assert REQUEST == 32100
    frame = Codec(ROBOT, ROBOT_COMPONENT).pack(status_message(STATION_SYSTEM, allows_takeover=True))
    assert frame.hex() == "fd02000000070100020003ff41df"
    checksum = grace.x25crc(frame[1:-2])
    checksum.accumulate(bytes((21,)))
    assert frame[-2:] == int(checksum.crc).to_bytes(2, "little")
    ((heard,), bad) = Codec(STATION_SYSTEM, STATION_COMPONENT).unpack(frame)
    assert bad == 0
    assert told(heard, NAME, NOW) == ControlReport(NAME, STATION_SYSTEM, True, NOW)


def test_status_of_a_part_of_a_system_says_nothing_of_the_whole():
    assert told(grace.MAVLink_control_status_message(0, 200, [0] * 10), NAME, NOW) is None


def test_wish_that_was_passed_on_names_who_asks():
    wish = ControlWish(True, False, 30.0, GUEST)
    assert told(passed_on(wish), NAME, NOW) == ControlAsked(NAME, GUEST, True, 30.0, NOW)
    for nobody in (0, STATION_SYSTEM):
        with pytest.raises(ValueError, match="names nobody"):
            told(passed_on(ControlWish(True, False, 30.0, SystemId(nobody))), NAME, NOW)


@pytest.mark.parametrize(
    "parameters",
    [(2, 0, 10, 0), (1, 0.5, 10, 0), (1, 0, 10, 256), (1, 0, 10, 1.5), (float("nan"), 0, 10, 0),
     (1, 0, 10, float("nan")), (1, 0, 10, -1)],
)  # fmt: skip
def test_wish_that_the_command_does_not_allow_is_none(parameters: tuple[float, ...]):
    with pytest.raises(ValueError, match="request for control"):
        wish_of(command(REQUEST, *parameters))


@pytest.mark.parametrize(
    ("asked_s", "stands_s"),
    [(0, 10), (-1, 10), (float("inf"), 10), (float("nan"), 10), (1, 3), (30, 30), (1e9, 60)],
)
def test_request_stands_for_as_long_as_is_sensible(asked_s: float, stands_s: float):
    assert wish_of(command(REQUEST, 1, 0, asked_s, 0)).stands_s == stands_s


def controls(station: GroundStation) -> list[int]:
    """Return whom the robot named as in control, one after another."""
    named = [message.gcs_main for message in station.of("CONTROL_STATUS")]
    return [one for one, before in zip(named, [None, *named], strict=False) if one != before]


def results(station: GroundStation) -> list[int]:
    return [one.result for one in station.of("COMMAND_ACK") if one.command == REQUEST]


def passed(it: Scene) -> list[tuple[int, int]]:
    """Return the requests that our own station was told of: action and who asks."""
    asked = [one for one in it.ours.of("COMMAND_LONG") if one.command == REQUEST]
    return [(int(one.param1), int(one.param4)) for one in asked]


@asynccontextmanager
async def held(silent: Sequence[GroundStation] = ()) -> AsyncIterator[Scene]:
    """A robot whose own station is heard, and two others that it knows, unless they are silent."""
    async with scene() as it:

        async def beat() -> None:
            while True:
                for station in (it.ours, it.guest, it.other):
                    if station not in silent:
                        await station.say(GCS)
                await until_later(0.1)

        async with running(beat):
            await until(lambda: controls(it.ours)[-1:] == [STATION_SYSTEM])
            await until(lambda: controls(it.guest)[-1:] == controls(it.other)[-1:] == [255])
            yield it


async def until_later(seconds: float) -> None:
    end_s = monotonic_s() + seconds
    await until(lambda: monotonic_s() >= end_s)


def grant(system: int, *, allows: bool = False) -> grace.MAVLink_command_long_message:
    return decision(ROBOT, ControlWish(True, allows, 3.0, SystemId(system)))


async def test_request_is_passed_on_and_granted_to_who_asked_alone():
    async with held() as it:
        await it.guest.say(command(REQUEST, 1, 0, 30, GUEST))
        await until(lambda: passed(it)[-1:] == [(1, GUEST)])
        assert set(results(it.guest)) == {IN_PROGRESS}
        assert it.guest.of("CONTROL_STATUS")[-1].gcs_main == STATION_SYSTEM
        await it.other.say(command(REQUEST, 1, 0, 30, OTHER))
        await until(lambda: results(it.other) == [NOT_NOW])
        await it.ours.say(answer(IN_PROGRESS, ROBOT, ROBOT_COMPONENT, GUEST), grant(GUEST))
        await until(lambda: results(it.guest)[-1] == ACCEPTED)
        await until(lambda: {controls(one)[-1] for one in (it.ours, it.guest, it.other)} == {GUEST})
        it.link.take_mission(mission(), start=False)
        await it.other.say(command(grace.MAV_CMD_MISSION_START))
        await until(lambda: it.other.results()[-1] == DENIED)
        await it.guest.say(command(grace.MAV_CMD_MISSION_START))
        await until(lambda: it.program.obeyed == [(CommandKind.START, mission().sha256()[:12])])
        await it.guest.say(command(REQUEST, 0, 0, 0, GUEST))
        await until(lambda: controls(it.guest)[-1] == STATION_SYSTEM)
        await it.guest.say(command(grace.MAV_CMD_DO_PAUSE_CONTINUE, 0))
        await until(lambda: it.guest.results()[-1] == DENIED)
        assert len(it.program.obeyed) == 1


async def test_refused_request_is_denied_and_nobody_answers_for_another():
    async with held() as it:
        await it.guest.say(command(REQUEST, 1, 0, 30, GUEST))
        await until(lambda: passed(it)[-1:] == [(1, GUEST)])
        await it.ours.say(answer(DENIED, ROBOT, ROBOT_COMPONENT, OTHER))
        await it.other.say(answer(ACCEPTED, ROBOT, ROBOT_COMPONENT, GUEST))
        await it.other.say(command(REQUEST, 1, 0, 30, GUEST))
        await until(lambda: results(it.other) == [DENIED])
        assert set(results(it.guest)) == {IN_PROGRESS}
        await it.ours.say(answer(DENIED, ROBOT, ROBOT_COMPONENT, GUEST))
        await until(lambda: results(it.guest)[-1] == DENIED)
        assert set(controls(it.guest)) <= {0, STATION_SYSTEM}


async def test_request_that_nobody_answers_ends_and_takes_nothing(monkeypatch: pytest.MonkeyPatch):
    passed_s = [0.0]
    monkeypatch.setattr(operator_desk, "monotonic_s", lambda: monotonic_s() + passed_s[0])
    async with held() as it:
        await it.guest.say(command(REQUEST, 1, 0, 60, GUEST))
        await until(lambda: len(passed(it)) > 1)  # our station did not say that it heard it
        assert set(results(it.guest)) == {IN_PROGRESS}
        passed_s[0] = 61.0
        await until(lambda: results(it.guest)[-1] == NOT_NOW)
        assert set(controls(it.guest)) <= {0, STATION_SYSTEM}


async def test_request_is_withdrawn_by_who_made_it():
    async with held() as it:
        await it.guest.say(command(REQUEST, 1, 0, 30, 0))
        await until(lambda: passed(it)[-1:] == [(1, GUEST)])
        await it.guest.say(command(REQUEST, 0, 0, 0, 0))
        await until(lambda: passed(it)[-1] == (0, GUEST))
        await until(lambda: results(it.guest)[-1] == ACCEPTED)
        await it.other.say(command(REQUEST, 0, 0, 0, 0))
        await until(lambda: results(it.other) == [DENIED])


async def test_who_is_in_control_and_falls_silent_is_so_no_more(monkeypatch: pytest.MonkeyPatch):
    silent: list[GroundStation] = []
    passed_s = [0.0]
    for module in (robot_link, service_desk):
        monkeypatch.setattr(module, "monotonic_s", lambda: monotonic_s() + passed_s[0])
    async with held(silent) as it:
        await it.ours.say(grant(GUEST))
        await until(lambda: controls(it.other)[-1] == GUEST)
        silent.append(it.guest)
        while controls(it.other)[-1] != STATION_SYSTEM:  # the others speak on meanwhile
            passed_s[0] += HASTE.stale_s
            await until(lambda: it.link.last_heard_station_s < HASTE.stale_s)
            await asyncio.sleep(0.1)
        silent.clear()
        seen = len(it.guest.of("CONTROL_STATUS"))
        await until(lambda: len(it.guest.of("CONTROL_STATUS")) > seen + 2)
        assert controls(it.guest)[-1] == STATION_SYSTEM


async def test_own_station_takes_a_robot_back_and_tells_that_it_may_be_taken():
    async with held() as it:
        await it.ours.say(grant(GUEST))
        await until(lambda: controls(it.guest)[-1] == GUEST)
        await it.ours.say(grant(STATION_SYSTEM, allows=True))
        await until(lambda: controls(it.guest)[-1] == STATION_SYSTEM)
        await until(lambda: it.guest.of("CONTROL_STATUS")[-1].flags == 3)
        await it.ours.say(grant(99))  # nobody is heard under that id
        await until(lambda: [one.result for one in it.ours.of("COMMAND_ACK")][-1] == DENIED)
        assert controls(it.guest)[-1] == STATION_SYSTEM


async def test_first_who_asks_has_a_robot_whose_own_station_is_silent_until_that_is_back():
    async with scene() as it:
        await it.guest.say(GCS)
        await it.other.say(GCS)
        await until(lambda: controls(it.guest) == controls(it.other) == [0])
        assert it.guest.of("CONTROL_STATUS")[-1].flags == 3
        await it.guest.say(command(REQUEST, 1, 0, 10, 0))
        await until(lambda: results(it.guest) == [ACCEPTED])
        await it.other.say(command(REQUEST, 1, 0, 10, 0))
        await it.other.say(command(grace.MAV_CMD_DO_PAUSE_CONTINUE, 0))
        await until(lambda: it.other.results() == [NOT_NOW, DENIED])
        await it.ours.say(GCS)
        await until(lambda: controls(it.guest)[-1] == STATION_SYSTEM)


async def test_surfacing_is_obeyed_whoever_is_in_control():
    async with held() as it:
        await it.ours.say(grant(GUEST))
        await until(lambda: controls(it.other)[-1] == GUEST)
        await it.other.say(command(grace.MAV_CMD_GRACE_SURFACE, 9, 106, 1))
        await until(lambda: it.program.obeyed[-1:] == [(CommandKind.SURFACE, "")])


@pytest.mark.parametrize(
    ("parameters", "zeroes"),
    [((0, 0, 1), True), ((1,), False), ((0, 0, 1, 1), False), ((0, 0, 2), False), ((), False)],
)
async def test_calibration_of_the_pressure_alone_zeroes_the_depth(
    parameters: tuple[float, ...], zeroes: bool
):
    async with scene() as it:
        await it.guest.say(GCS, command(grace.MAV_CMD_PREFLIGHT_CALIBRATION, *parameters))
        wanted = ACCEPTED if zeroes else grace.MAV_RESULT_UNSUPPORTED
        await until(lambda: it.guest.results() == [wanted])
        assert it.program.obeyed == ([(CommandKind.ZERO_DEPTH, "")] if zeroes else [])
