"""Standard commands to vehicles, and what a robot does for other makers' ground stations."""

import asyncio
import math
import random
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field, replace

import pytest

from onboard.link import service_desk
from onboard.link.operator_desk import OperatorDesk
from onboard.link.plan_desk import PlanDesk
from onboard.link.plan_store import MemoryPlanStore
from onboard.link.robot_link import RobotLink
from onboard.link.service_desk import ServiceDesk
from onboard.link.waypoint_mission import WaypointRules
from robot_link.clock import SystemClock
from robot_link.mavlink.codec import (
    ROBOT_COMPONENT,
    STATION_COMPONENT,
    STATION_SYSTEM,
    Codec,
    WireMessage,
)
from robot_link.mavlink.wire import grace
from robot_link.messages import CommandKind, LogId, SystemId
from robot_link.robot_program import CommandOutcome
from robot_link.sample_log import MemorySampleLog
from robot_link.service.file_store import NoFiles
from robot_link.service.parameter_table import Parameter, ParameterTable, ParameterType
from robot_link.station.command_client import CommandClient, StandardCommand
from robot_link.station.error import NoAnswerError, ServiceRefusedError
from robot_link.transport.datagram import Address
from simulator.xbee_network import XBeeNetwork
from tests.robot_link.rig import CALM, HASTE, Program, mission, running, state, until
from tests.robot_link.service_pair import HASTY, ROBOT, Wire

HOLD = StandardCommand(grace.MAV_CMD_DO_PAUSE_CONTINUE)
REBOOT = StandardCommand(grace.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, (1.0,))
RULES = WaypointRules(origin_latitude_deg=43.0, origin_longitude_deg=-84.0)
GUEST, OTHER = SystemId(245), SystemId(246)
OUR_RADIO, GUESTS_RADIO, ROBOTS_RADIO = Address(0xA1), Address(0xA2), Address(0xA3)
OTHERS_RADIO = Address(0xA4)
GCS = grace.MAVLink_heartbeat_message(grace.MAV_TYPE_GCS, 8, 0, 0, 4, 3)


def pair(*answers: list[int]) -> tuple[CommandClient, Wire]:
    """A vehicle that gives these results to the first, second... command that it hears."""
    left = list(answers)

    def answer(message: WireMessage) -> list[WireMessage]:
        results = left.pop(0) if left else []
        if results:  # what is answered is waited for, however late it comes
            client._exchange.patience = replace(HASTY, answer_s=60.0)
        return [grace.MAVLink_command_ack_message(message.command, one) for one in results]

    wire = Wire(answer)
    client = CommandClient(wire, patience=HASTY)
    wire.client = client.hear
    return client, wire


def confirmations(wire: Wire) -> list[int]:
    return [message.confirmation for message in wire.asked]


async def test_an_idempotent_command_is_repeated_with_a_growing_confirmation():
    client, wire = pair([], [], [grace.MAV_RESULT_ACCEPTED])
    await client.send(HOLD)
    assert confirmations(wire) == [0, 1, 2]


async def test_a_command_that_acts_twice_if_heard_twice_is_sent_once():
    client, wire = pair([], [grace.MAV_RESULT_ACCEPTED])
    with pytest.raises(NoAnswerError, match="did not answer the command"):
        await client.send(REBOOT)
    assert confirmations(wire) == [0]


async def test_work_in_progress_is_waited_for_and_not_repeated():
    client, wire = pair([grace.MAV_RESULT_IN_PROGRESS] * 3)
    work = asyncio.create_task(client.send(HOLD))
    await asyncio.sleep(5 * HASTY.answer_s)
    assert not work.done()
    done = grace.MAVLink_command_ack_message(HOLD.code, grace.MAV_RESULT_ACCEPTED)
    client.hear(wire.over_the_wire(done))
    await work
    assert confirmations(wire) == [0]


@pytest.mark.parametrize(
    ("result", "why"),
    [
        (grace.MAV_RESULT_DENIED, "refuses"),
        (grace.MAV_RESULT_UNSUPPORTED, "does not know"),
        (grace.MAV_RESULT_FAILED, "failed"),
        (77, "result 77"),
    ],
)
async def test_a_refusal_is_a_sentence(result: int, why: str):
    client, _ = pair([result])
    with pytest.raises(ServiceRefusedError, match=why):
        await client.send(HOLD)


@dataclass
class GroundStation:
    """Somebody with a radio who speaks under some system id."""

    air: XBeeNetwork
    codec: Codec
    radio: object
    heard: list[WireMessage] = field(default_factory=list)

    async def say(self, *messages: WireMessage) -> None:
        for message in messages:
            await (await self.radio.send(ROBOTS_RADIO, self.codec.pack(message)))

    async def listen(self) -> None:
        async for event in self.radio.events():
            if (data := getattr(event, "data", None)) is not None:
                self.heard += self.codec.unpack(data).messages

    def of(self, kind: str) -> list[WireMessage]:
        return [message for message in self.heard if message.get_type() == kind]

    def results(self) -> list[int]:
        return [message.result for message in self.of("COMMAND_ACK")]


@dataclass
class Scene:
    link: RobotLink
    program: Program
    ours: GroundStation
    guest: GroundStation
    other: GroundStation


@asynccontextmanager
async def scene(rules: WaypointRules | None = RULES) -> AsyncIterator[Scene]:
    air = XBeeNetwork(random.Random(1), CALM, lambda _a, _b: True)
    program = Program()
    link = RobotLink(
        ROBOT,
        air.robot_radio(ROBOTS_RADIO),
        SystemClock(),
        program,
        log=MemorySampleLog(LogId(1)),
        plans=MemoryPlanStore(),
        parameters=ParameterTable((Parameter("GAIN", ParameterType.INT8, 1, 0, 5),)),
        waypoints=rules,
        timing=HASTE,
    )
    link.report_state(state(SystemClock().now()))

    def station(system: SystemId, address: Address) -> GroundStation:
        return GroundStation(air, Codec(system, STATION_COMPONENT), air.robot_radio(address))

    stations = (
        station(STATION_SYSTEM, OUR_RADIO),
        station(GUEST, GUESTS_RADIO),
        station(OTHER, OTHERS_RADIO),
    )
    async with AsyncExitStack() as stack:
        for one in stations:
            await stack.enter_async_context(running(one.radio.run))
            await stack.enter_async_context(running(one.listen))
        await stack.enter_async_context(running(link.run))
        yield Scene(link, program, *stations)


def command(code: int, *parameters: float) -> WireMessage:
    return StandardCommand(code, parameters).message(ROBOT, ROBOT_COMPONENT, 0)


async def test_another_makers_ground_station_is_shown_the_robot_once_it_shows_itself():
    async with scene() as it:
        await it.guest.say(command(grace.MAV_CMD_REQUEST_MESSAGE, 30))
        await it.guest.say(GCS)
        await until(lambda: it.guest.of("ATTITUDE") and it.guest.of("GLOBAL_POSITION_INT"))
        await until(lambda: it.guest.of("HEARTBEAT"))
        assert it.guest.of("COMMAND_ACK") == []
        await it.guest.say(command(grace.MAV_CMD_SET_MESSAGE_INTERVAL, 30, -1))
        await it.guest.say(command(grace.MAV_CMD_GET_MESSAGE_INTERVAL, 30))
        await until(lambda: it.guest.of("MESSAGE_INTERVAL"))
        assert it.guest.of("MESSAGE_INTERVAL")[0].interval_us == -1
        await it.guest.say(command(grace.MAV_CMD_REQUEST_MESSAGE, 148))
        await until(lambda: it.guest.of("AUTOPILOT_VERSION"))
        await it.guest.say(command(grace.MAV_CMD_REQUEST_MESSAGE, float("nan")))
        await it.guest.say(command(grace.MAV_CMD_NAV_TAKEOFF))
        await until(lambda: it.guest.results()[-2:] == [grace.MAV_RESULT_UNSUPPORTED] * 2)
        integers = grace.MAVLink_command_int_message(ROBOT, 1, 6, 300, 0, 0, 0, 0, 0, 0, 0, 0, 0)
        await it.guest.say(integers)
        await until(lambda: it.guest.results()[-1] == grace.MAV_RESULT_COMMAND_LONG_ONLY)


async def test_a_guest_commands_only_while_our_own_station_is_silent():
    async with scene() as it:
        refusal = it.link.take_mission(mission(), start=False)
        assert refusal == ""
        await it.guest.say(GCS, command(grace.MAV_CMD_MISSION_START))
        await until(lambda: it.guest.results() == [grace.MAV_RESULT_ACCEPTED])
        digits = mission().sha256()[:12]
        assert it.program.obeyed == [(CommandKind.START, digits)]
        await it.ours.say(GCS)
        await until(lambda: it.link.last_heard_station_s < math.inf)
        await it.guest.say(
            GCS,
            command(grace.MAV_CMD_DO_PAUSE_CONTINUE, 0),
            grace.MAVLink_param_set_message(ROBOT, 1, b"GAIN", 4.2e-45, ParameterType.INT8),
            grace.MAVLink_mission_count_message(ROBOT, 1, 1, 0),
        )
        await until(lambda: len(it.guest.results()) == 2)
        assert it.guest.results()[-1] == grace.MAV_RESULT_DENIED
        await until(lambda: it.guest.of("PARAM_ERROR"))
        assert it.link.parameters.read("GAIN").value == 1
        await it.guest.say(command(grace.MAV_CMD_GRACE_SURFACE, 9, 106, 1))
        await until(lambda: it.program.obeyed[-1][0] is CommandKind.SURFACE)


async def test_a_robot_that_welcomes_no_guests_answers_none():
    async with scene(rules=None) as it:
        await it.guest.say(GCS, command(grace.MAV_CMD_REQUEST_MESSAGE, 148))
        await until(lambda: it.link.frames_bad == 2)
        assert it.guest.of("COMMAND_ACK") == it.guest.of("ATTITUDE") == []


async def test_our_own_station_is_not_crowded_by_standard_streams():
    async with scene() as it:
        await it.ours.say(GCS)
        await until(lambda: it.ours.of("GRACE_STATE"))
        await until(lambda: len(it.ours.of("HEARTBEAT")) > 3)
        assert it.ours.of("ATTITUDE") == []


async def test_a_second_robot_under_our_system_id_is_told_of_and_not_obeyed():
    async with scene() as it:
        double = Codec(ROBOT, ROBOT_COMPONENT)
        it.guest.codec = double
        await it.guest.say(GCS)
        await until(lambda: it.link.conflict)
        assert "another radio (00000000000000A2) speaks as system 7" in it.link.conflict
        assert it.link.frames_bad == 1


async def test_a_plan_from_another_road_is_taken_once_and_started():
    async with scene() as it:
        assert it.link.take_mission(mission(), start=True) == ""
        assert it.link.take_mission(mission(), start=False) == ""
        assert it.program.taken == [mission()]
        assert it.link.plan_report().sha256 == mission().sha256()
        it.program.outcome = CommandOutcome.NOT_NOW
        assert "cannot start it now" in it.link.take_mission(mission(), start=True)
        it.program.refusal = "the robot is coming up"
        assert it.link.take_mission(mission(3), start=False) == "the robot is coming up"
        assert it.link.plan_report().sha256 == mission().sha256()


def spoken(system: int, message: WireMessage) -> WireMessage:
    """Return a message as it is heard from a ground station."""
    codec = Codec(SystemId(system), STATION_COMPONENT)
    ((heard,), _) = codec.unpack(codec.pack(message))
    return heard


async def test_a_ground_station_that_makes_room_for_another_ends_nobodys_service(
    monkeypatch: pytest.MonkeyPatch,
):
    clock, program, sent, at_s = SystemClock(), Program(), [], [1000.0]
    monkeypatch.setattr(service_desk, "monotonic_s", lambda: at_s[0])
    plan = PlanDesk(MemoryPlanStore(), program, clock, HASTE, lambda _message: None)
    desk = ServiceDesk(
        ROBOT,
        clock,
        program,
        plan,
        OperatorDesk(lambda: False, dict, lambda _address, _message: None, 1.0),
        parameters=ParameterTable([Parameter("GAIN", ParameterType.REAL32, 1.0, 0.0, 2.0)]),
        files=NoFiles(),
        rules=None,
        answer_s=HASTE.answer_s,
        master_s=5.0,
        reply=lambda _address, _message: None,
        channel_pages=list,
    )
    wish = grace.MAVLink_param_request_list_message(ROBOT, 1)
    time = grace.MAVLink_timesync_message(0, 1)
    for system in (1, 2, 3, 4):
        desk.hear(spoken(system, time), GUESTS_RADIO)
    at_s[0] += 6.0  # all have fallen silent, and one of them speaks again
    desk.hear(spoken(1, wish), GUESTS_RADIO)

    async def send(_address: Address, message: WireMessage) -> None:
        sent.append(message)
        desk.hear(spoken(5 + len(sent), wish if len(sent) == 1 else time), GUESTS_RADIO)

    async with running(lambda: desk.run(lambda: 0.0, send)) as task:
        await until(lambda: len(sent) >= 2)
        assert not task.done()
