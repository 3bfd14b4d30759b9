"""The robot's side of the standard services, for its own station and for other makers' ones."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime

from onboard.link.drive_desk import DRIVE, DriveDesk
from onboard.link.file_server import FileServer
from onboard.link.mission_server import Asker, MissionServer, MissionVerdict
from onboard.link.operator_desk import OperatorDesk
from onboard.link.parameter_server import ParameterServer
from onboard.link.plan_desk import PlanDesk
from onboard.link.standard_telemetry import (
    TelemetrySource,
    autopilot_version,
    telemetry_message,
)
from onboard.link.stream import StreamBudget, Streams
from onboard.link.waypoint_mission import (
    WaypointRefusal,
    WaypointRules,
    mission_of_waypoints,
    waypoints_of_mission,
)
from robot_link.clock import Clock, monotonic_s, set_or_after
from robot_link.mavlink.codec import STATION_SYSTEM, WireMessage
from robot_link.mavlink.command import PLAN_DIGITS, result_of
from robot_link.mavlink.wire import grace
from robot_link.messages import CommandKind, PlanHash, StateReport, SystemId
from robot_link.service.clock_sync import time_answer
from robot_link.service.file_store import FileStore
from robot_link.service.heartbeat import is_ground_station
from robot_link.service.parameter_table import ParameterTable
from robot_link.service.standard_item import StandardItem
from robot_link.transport.datagram import Address

_ASKERS = 4
_TICK_S = 0.02
_NO_MESSAGE = -1
_ZERO_DEPTH = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
"""Parameters of MAV_CMD_PREFLIGHT_CALIBRATION that mean the pressure at the surface alone."""


Send = Callable[[Address, WireMessage], Awaitable[None]]


@dataclass(slots=True)
class _AskerServices:
    """What is kept for one ground station while it is heard."""

    asker: Asker
    address: Address
    """Its radio."""
    heard_s: float
    parameters: ParameterServer
    files: FileServer
    missions: MissionServer
    streams: Streams = field(default_factory=Streams)

    @property
    def system(self) -> SystemId:
        """Its system id."""
        return self.asker.system


class ServiceDesk:
    """Parameters, files, time, streams, standard missions and commands; on one event loop.

    Other makers' ground stations are served once they have shown themselves by a heartbeat. They
    may read at any time; they may change something only while they are in control of the robot, or
    nobody is, for a robot obeys one master.

    Args:
        system: The robot's system id.
        clock: The robot's clock.
        plan: Its plan on board.
        drive: Who drives it by hand.
        operators: Who is in control of it.
        parameters: Its parameters.
        files: Its files.
        rules: How it flies waypoints; without, other makers' ground stations are not served.
        answer_s: Time after which a question to a ground station is repeated.
        master_s: Silence after which a ground station counts as gone.
        reply: Called with each answer, which goes out before anything else.
        channel_pages: Returns the pages of the table of channels.
    """

    def __init__(
        self,
        system: SystemId,
        clock: Clock,
        plan: PlanDesk,
        drive: DriveDesk,
        operators: OperatorDesk,
        *,
        parameters: ParameterTable,
        files: FileStore,
        rules: WaypointRules | None,
        answer_s: float,
        master_s: float,
        reply: Callable[[Address, WireMessage], None],
        channel_pages: Callable[[], Sequence[WireMessage]],
    ) -> None:
        self._system = system
        self._clock = clock
        self._plan = plan
        self._drive = drive
        self._operators = operators
        self._parameters = parameters
        self._files = files
        self._rules = rules
        self._answer_s = answer_s
        self._master_s = master_s
        self._reply = reply
        self._channel_pages = channel_pages
        self._began_at: datetime = clock.now()
        self._askers: dict[tuple[SystemId, int], _AskerServices] = {}
        self._stirred = asyncio.Event()
        self._uploaded: tuple[PlanHash, tuple[StandardItem, ...]] | None = None
        self.state: StateReport | None = None
        """What the robot last said of itself."""

    def guests(self) -> dict[Asker, Address]:
        """Return the other makers' ground stations that are heard, with their radios."""
        now_s = monotonic_s()
        return {
            one.asker: one.address
            for one in self._askers.values()
            if one.system != STATION_SYSTEM and self._is_heard(one, now_s)
        }

    def welcomes(self, message: WireMessage, address: Address) -> bool:
        """Tell whether another maker's ground station is served; its heartbeat introduces it."""
        if self._rules is None:
            return False
        key = (SystemId(message.get_srcSystem()), message.get_srcComponent())
        known = self._askers.get(key)
        now_s = monotonic_s()
        if known is not None and self._is_heard(known, now_s):
            return known.address == address
        if not is_ground_station(message):
            return False
        self._services(message, address, now_s).streams.begin_default()
        self._stirred.set()
        return True

    def hear(self, message: WireMessage, address: Address) -> None:
        """Answer what is of these services; the rest is not theirs."""
        now_s = monotonic_s()
        one = self._services(message, address, now_s)
        match message:
            case grace.MAVLink_timesync_message():
                if (answer := time_answer(message, self._clock)) is not None:
                    self._reply(address, answer)
            case grace.MAVLink_command_long_message():
                self._command(one, message)
            case grace.MAVLink_command_ack_message(
                command=grace.MAV_CMD_REQUEST_OPERATOR_CONTROL
            ) if one.system == STATION_SYSTEM:
                self._operators.answered(message)
            case grace.MAVLink_command_int_message():
                self._acknowledge(one, message.command, grace.MAV_RESULT_COMMAND_LONG_ONLY)
            case grace.MAVLink_file_transfer_protocol_message():
                for answer in one.files.hear(message):
                    self._reply(
                        address,
                        grace.MAVLink_file_transfer_protocol_message(
                            0, one.asker.system, one.asker.component, answer.octets()
                        ),
                    )
            case _:
                self._reply_all(one, one.parameters.hear(message))
                self._reply_all(one, one.missions.hear(message, now_s))
        self._stirred.set()

    async def run(self, budget: Callable[[], float], send: Send) -> None:
        """Send lists, streams and repeated questions until cancelled.

        Args:
            budget: Returns the bytes per second that telemetry may take now.
            send: Sends one message and returns when the radio took it.
        """
        while True:
            self._stirred.clear()
            now_s = monotonic_s()
            for key, one in list(self._askers.items()):
                if not self._is_heard(one, now_s):
                    self._askers.pop(key, None)  # another may have taken its place meanwhile
                    continue
                self._reply_all(one, one.missions.tick(now_s))
                for message in one.parameters.owed():
                    await send(one.address, message)
                await self._send_streams(one, StreamBudget(budget() / len(self._askers)), send)
            is_streaming = any(one.streams.is_wanted for one in self._askers.values())
            idle_s = self._answer_s / 4 if self._askers else None
            await set_or_after(self._stirred, _TICK_S if is_streaming else idle_s)

    async def _send_streams(self, one: _AskerServices, budget: StreamBudget, send: Send) -> None:
        if self.state is None or self._rules is None:
            return
        source = TelemetrySource(self.state, self._began_at, self._rules)
        for message_id in one.streams.due(monotonic_s(), budget):
            if (message := telemetry_message(message_id, source)) is not None:
                await send(one.address, message)

    def _services(self, message: WireMessage, address: Address, now_s: float) -> _AskerServices:
        key = (SystemId(message.get_srcSystem()), message.get_srcComponent())
        one = self._askers.get(key)
        if one is None:
            while len(self._askers) >= _ASKERS:
                del self._askers[min(self._askers, key=lambda old: self._askers[old].heard_s)]
            asker = Asker(*key)
            one = self._askers[key] = _AskerServices(
                asker,
                address,
                now_s,
                ParameterServer(self._parameters, lambda: self._operators.refusal(asker.system)),
                FileServer(self._files),
                MissionServer(
                    asker,
                    lambda items: self._take_waypoints(asker, items),
                    self._waypoints,
                    answer_s=self._answer_s,
                ),
            )
        one.address, one.heard_s = address, now_s
        return one

    def _is_heard(self, one: _AskerServices, now_s: float) -> bool:
        return now_s - one.heard_s <= self._master_s

    def _reply_all(self, one: _AskerServices, messages: Sequence[WireMessage]) -> None:
        for message in messages:
            self._reply(one.address, message)

    def _take_waypoints(self, asker: Asker, items: Sequence[StandardItem]) -> MissionVerdict:
        if refusal := self._operators.refusal(asker.system):
            return MissionVerdict(grace.MAV_MISSION_DENIED, refusal)
        if self._rules is None or self.state is None:
            reason = "the robot takes missions from its own station only"
            return MissionVerdict(grace.MAV_MISSION_DENIED, reason)
        try:
            notes: list[str] = []
            here = self.state.position_ned
            mission = mission_of_waypoints(items, here, self._rules, notes.append)
        except WaypointRefusal as error:
            return MissionVerdict(error.result, str(error))
        if refusal := self._plan.take_mission(mission, start=False):
            return MissionVerdict(grace.MAV_MISSION_ERROR, refusal)
        self._uploaded = (mission.sha256(), tuple(items))
        return MissionVerdict(reason="; ".join(notes))

    def _waypoints(self) -> Sequence[StandardItem]:
        """Return the plan on board as it was uploaded, or as the ends of its legs."""
        if self._uploaded is not None and self._uploaded[0] == self._plan.plan_hash:
            return self._uploaded[1]
        mission = self._plan.mission()
        if mission is None or self._rules is None:
            return ()
        return waypoints_of_mission(mission, self._rules)

    def _command(self, one: _AskerServices, message: grace.MAVLink_command_long_message) -> None:
        message_id = int(message.param1) if math.isfinite(message.param1) else _NO_MESSAGE
        match message.command:
            case grace.MAV_CMD_REQUEST_MESSAGE:
                result = self._send_requested(one, message_id)
            case grace.MAV_CMD_SET_MESSAGE_INTERVAL:
                known = one.streams.set_interval(message_id, message.param2)
                result = grace.MAV_RESULT_ACCEPTED if known else grace.MAV_RESULT_DENIED
            case grace.MAV_CMD_GET_MESSAGE_INTERVAL:
                interval_us = one.streams.interval_us(message_id)
                told = grace.MAVLink_message_interval_message(message_id % 2**16, interval_us)
                self._reply(one.address, told)
                result = grace.MAV_RESULT_ACCEPTED
            case grace.MAV_CMD_MISSION_START:
                result = self._obey(one, CommandKind.START)
            case grace.MAV_CMD_DO_PAUSE_CONTINUE:
                kind = CommandKind.RESUME if message.param1 else CommandKind.HOLD
                result = self._obey(one, kind)
            case grace.MAV_CMD_REQUEST_OPERATOR_CONTROL:
                result = self._operators.command(one.asker, message)
            case grace.MAV_CMD_PREFLIGHT_CALIBRATION if _parameters(message) == _ZERO_DEPTH:
                result = self._obey(one, CommandKind.ZERO_DEPTH)
            case command if command == DRIVE:
                driver = (one.system, one.asker.component, one.address)
                refusal = self._operators.refusal(one.system)
                result = self._drive.command(message.param1, driver, refusal)
            case _:
                result = grace.MAV_RESULT_UNSUPPORTED
        self._acknowledge(one, message.command, result)

    def _acknowledge(self, one: _AskerServices, command: int, result: int) -> None:
        self._reply(
            one.address,
            grace.MAVLink_command_ack_message(
                command=command,
                result=result,
                target_system=one.asker.system,
                target_component=one.asker.component,
            ),
        )

    def _send_requested(self, one: _AskerServices, message_id: int) -> int:
        if message_id == grace.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            self._reply(one.address, autopilot_version(self._system))
            return grace.MAV_RESULT_ACCEPTED
        if message_id == grace.MAVLINK_MSG_ID_GRACE_CHANNELS:
            pages = self._channel_pages()
            self._reply_all(one, pages)
            return grace.MAV_RESULT_ACCEPTED if pages else grace.MAV_RESULT_TEMPORARILY_REJECTED
        if self.state is None or self._rules is None:
            return grace.MAV_RESULT_TEMPORARILY_REJECTED
        source = TelemetrySource(self.state, self._began_at, self._rules)
        message = telemetry_message(message_id, source)
        if message is None:
            return grace.MAV_RESULT_UNSUPPORTED
        self._reply(one.address, message)
        return grace.MAV_RESULT_ACCEPTED

    def _obey(self, one: _AskerServices, kind: CommandKind) -> int:
        """Act on a command that has no number: each kind means the same if heard twice."""
        if self._operators.refusal(one.system):
            return grace.MAV_RESULT_DENIED
        digits = ""
        if kind is CommandKind.START:
            sha256 = self._plan.plan_hash
            if sha256 is None:
                return grace.MAV_RESULT_TEMPORARILY_REJECTED
            digits = sha256[:PLAN_DIGITS]
        return result_of(self._plan.obey(kind, digits))


def _parameters(message: grace.MAVLink_command_long_message) -> tuple[float, ...]:
    return tuple(float(getattr(message, f"param{number}")) for number in range(1, 8))
