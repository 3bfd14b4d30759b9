"""The submarine's end of its UDP link: one ground station, as an autopilot answers it."""

import asyncio
import math
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import Final

from onboard.link.file_server import FileServer
from onboard.link.mission_server import Asker, MissionServer
from onboard.link.parameter_server import ParameterServer
from onboard.link.status_text import status_texts
from robot_link.clock import Clock, monotonic_s
from robot_link.mavlink.codec import ROBOT_COMPONENT, STATION_COMPONENT, Codec, WireMessage, packets
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from robot_link.service.heartbeat import is_ground_station
from robot_link.service.parameter_table import ParameterTable
from robot_link.service.parameter_wire import IntegerEncoding
from robot_link.service.standard_item import StandardItem
from robot_link.transport.datagram import FAR_END, DatagramTransport, PortClosedError, Received
from simulator.fault import (
    CAUSED_FAULTS,
    FLAT_FRACTION,
    FaultKind,
    RobotFaults,
    begin_of,
    caused_at,
)
from simulator.sub.autopilot import MODES, SubAutopilot
from simulator.sub.definition import SubDefinition
from simulator.sub.parameter import GENERAL, PARAMETERS, MetadataFiles
from simulator.sub.plant import Demand, SubPlant
from simulator.sub.telemetry import FIX_DEPTH_M, PERIODS_S, SubTelemetry

PERIOD_S: Final = 0.1
"""A step of the plant."""
_WALL_S: Final = 0.05
_STEPS_AT_ONCE: Final = 200
_STICK: Final = 1000.0
_CAPABILITIES: Final = (
    grace.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | grace.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | grace.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
    | grace.MAV_PROTOCOL_CAPABILITY_FTP
    | grace.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)
_ACCEPTED, _DENIED = grace.MAV_RESULT_ACCEPTED, grace.MAV_RESULT_DENIED
_PARAMETERS_AT_ONCE: Final = 8
_LEAK_EVERY_S: Final = 20.0
"""As long as there is water inside, it says so again and again, as ArduSub does."""


class SubVehicle:
    """A whole submarine behind a transport. Belongs to one event loop.

    Args:
        definition: Which one it is.
        transport: Where ground stations call it.
        clock: The time that it lives by.
    """

    def __init__(
        self, definition: SubDefinition, transport: DatagramTransport, clock: Clock
    ) -> None:
        site = definition.site
        self._definition = definition
        self._transport = transport
        self._clock = clock
        self.plant = SubPlant(
            definition.start_ne_m,
            definition.heading_rad,
            lambda north, east: float(site.floor_m(north, east)),
        )
        self.autopilot = SubAutopilot(site, self.plant)
        self._telemetry = SubTelemetry(definition, self.plant, self.autopilot)
        self._codec = Codec(definition.system_id, ROBOT_COMPONENT)
        values = {"SYSID_THISMAV": float(definition.system_id)}
        rows = [row.parameter for row in PARAMETERS]
        self._table = ParameterTable(rows, values=values, on_change=self._changed)
        self._parameters = ParameterServer(self._table, encoding=IntegerEncoding.C_CAST)
        self._metadata = MetadataFiles()
        self._files = FileServer(self._metadata)
        self._missions = MissionServer(
            Asker(SystemId(255), STATION_COMPONENT), self.autopilot.take, self._held
        )
        self._due_s: dict[str, float] = {}
        self._is_asked = False
        self._leak_told_s = -math.inf
        for name in ("WPNAV_SPEED", "WPNAV_RADIUS", "FS_LEAK_ENABLE"):
            self._changed(name, self._table.read(name).value)

    async def run(self) -> None:
        """Live, listen and speak until cancelled."""
        async with asyncio.TaskGroup() as group:
            name = self._definition.robot
            group.create_task(self._transport.run(), name=f"{name} port")
            group.create_task(self._listen(), name=f"{name} ear")
            await self._live()

    def step(self) -> None:
        """Live one period."""
        self.plant.step(PERIOD_S, self.autopilot.demand())
        time_s, faults = self.plant.time_s, self.faults
        if time_s >= faults.battery_flat_s:
            self.plant.charge = min(self.plant.charge, FLAT_FRACTION)
        if time_s >= faults.leak_s and time_s >= self._leak_told_s + _LEAK_EVERY_S:
            self._leak_told_s = time_s
            self.autopilot.leak()

    @property
    def faults(self) -> RobotFaults:
        """What is wrong with it, and from when of its life on."""
        return self._telemetry.faults

    @property
    def fault_kinds(self) -> Mapping[str, FaultKind]:
        """Which of ``CAUSED_FAULTS`` it can have."""
        return {name: CAUSED_FAULTS[name] for name in self._definition.fault_names}

    def begin_s(self, name: str) -> float:
        """Return when a fault comes, of its life; infinity if it does not."""
        return begin_of(self.faults, name)

    @property
    def lived_s(self) -> float:
        """Seconds that it has lived."""
        return self.plant.time_s

    @property
    def is_in_reach_of_hands(self) -> bool:
        """Whether it lies at the surface."""
        return self.plant.depth_m <= FIX_DEPTH_M

    def cause(self, name: str) -> None:
        """Let a fault come now."""
        self._telemetry.faults = caused_at(self.faults, name, self.plant.time_s)

    def mend(self, name: str) -> None:
        """Undo a fault; a battery that went flat is changed for a full one."""
        if name == "battery" and self.plant.time_s >= self.faults.battery_flat_s:
            self.plant.charge = 1.0
        if name == "leak":
            self.autopilot.is_leaking = False
            self._leak_told_s = -math.inf
        self._telemetry.faults = caused_at(self.faults, name, math.inf)

    async def _live(self) -> None:
        began = self._clock.now()
        while True:
            behind = (self._clock.now() - began).total_seconds() - self.plant.time_s
            for _ in range(min(int(behind / PERIOD_S), _STEPS_AT_ONCE)):
                self.step()
            await self._say(self._spoken(monotonic_s()))
            await asyncio.sleep(_WALL_S)

    def _spoken(self, now_s: float) -> list[WireMessage]:
        """Return what is due by the wall's clock."""
        said: list[WireMessage] = []
        periods: dict[str, float] = {"heartbeat": 1.0}
        if self._is_asked:
            periods |= PERIODS_S
        for name, period_s in periods.items():
            if now_s >= self._due_s.get(name, 0.0):
                self._due_s[name] = now_s + period_s
                is_beat = name == "heartbeat"
                told = self._telemetry
                said += [told.heartbeat()] if is_beat else told.messages(name)
        for severity, text in self.autopilot.words:
            said += status_texts(text, severity)
        self.autopilot.words.clear()
        said += islice(self._parameters.owed(), _PARAMETERS_AT_ONCE)
        return said + self._missions.tick(now_s)

    async def _say(self, messages: Iterable[WireMessage]) -> None:
        frames = [self._codec.pack(message) for message in messages]
        if not self._transport.max_payload:
            return
        for packet in packets(frames, self._transport.max_payload):
            try:
                await self._transport.send(FAR_END, packet)
            except PortClosedError:
                return

    async def _listen(self) -> None:
        async for event in self._transport.events():
            if not isinstance(event, Received):
                continue
            messages = self._codec.unpack(event.data).messages
            if messages and event.accept(False):
                for message in messages:
                    await self._say(self._answers(message))

    def _answers(self, message: WireMessage) -> list[WireMessage]:
        match message:
            case grace.MAVLink_heartbeat_message() if is_ground_station(message):
                return []
            case grace.MAVLink_command_long_message():
                return self._obey(message.command, _parameters(message))
            case grace.MAVLink_command_int_message():
                return self._obey(message.command, _parameters(message))
            case grace.MAVLink_set_mode_message():
                self.autopilot.enter(message.custom_mode)
                return []
            case grace.MAVLink_request_data_stream_message():
                self._is_asked = bool(message.start_stop)
                return []
            case grace.MAVLink_manual_control_message():
                self.autopilot.steer(
                    Demand(
                        message.x / _STICK,
                        message.y / _STICK,
                        -(message.z - 500) / 500.0,
                        message.r / _STICK,
                    )
                )
                return []
            case grace.MAVLink_mission_set_current_message():
                self.autopilot.item = min(message.seq, max(0, len(self.autopilot.items) - 1))
                return []
            case grace.MAVLink_mission_clear_all_message():
                self.autopilot.take([])
                return [grace.MAVLink_mission_ack_message(255, STATION_COMPONENT, 0)]
            case grace.MAVLink_file_transfer_protocol_message():
                return [
                    grace.MAVLink_file_transfer_protocol_message(
                        0, message.get_srcSystem(), message.get_srcComponent(), one.octets()
                    )
                    for one in self._files.hear(message)
                ]
            case grace.MAVLink_timesync_message(tc1=0):
                now_ns = round(1e9 * self.plant.time_s)
                return [grace.MAVLink_timesync_message(now_ns, message.ts1)]
            case _:
                return [
                    *self._parameters.hear(message),
                    *self._missions.hear(message, monotonic_s()),
                ]

    def _obey(self, command: int, parameters: tuple[float, ...]) -> list[WireMessage]:
        more: list[WireMessage] = []
        result = _ACCEPTED
        pilot = self.autopilot
        match command:
            case grace.MAV_CMD_COMPONENT_ARM_DISARM:
                result = _ACCEPTED if pilot.arm(parameters[0] >= 0.5) else _DENIED
            case grace.MAV_CMD_DO_SET_MODE:
                result = _ACCEPTED if pilot.enter(int(parameters[1])) else _DENIED
            case grace.MAV_CMD_MISSION_START:
                result = _ACCEPTED if pilot.enter(MODES["AUTO"]) else _DENIED
            case grace.MAV_CMD_SET_MESSAGE_INTERVAL:
                self._is_asked = True
            case grace.MAV_CMD_REQUEST_MESSAGE:
                told = self._told(int(parameters[0]))
                result = _DENIED if told is None else _ACCEPTED
                more = [] if told is None else [told]
            case _:
                result = grace.MAV_RESULT_UNSUPPORTED
        return [grace.MAVLink_command_ack_message(command, result), *more]

    def _told(self, number: int) -> WireMessage | None:
        """Return a message that was asked for, None where it has no such one."""
        if number == grace.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            return grace.MAVLink_autopilot_version_message(
                _CAPABILITIES, 4 << 24 | 5 << 16, 0, 0, 0, bytes(8), bytes(8), bytes(8), 0, 0, 0
            )
        if number == grace.MAVLINK_MSG_ID_COMPONENT_METADATA:
            uri = f"mftp:///{GENERAL}".encode()
            return grace.MAVLink_component_metadata_message(0, self._metadata.crc, uri)
        return None

    def _held(self) -> tuple[StandardItem, ...]:
        return self.autopilot.items or (self.autopilot.home,)

    def _changed(self, name: str, value: float) -> None:
        pilot = self.autopilot
        setters: Mapping[str, tuple[str, float]] = {
            "WPNAV_SPEED": ("speed_m_s", value / 100.0),
            "WPNAV_RADIUS": ("radius_m", value / 100.0),
        }
        if name in setters:
            setattr(pilot, *setters[name])
        elif name == "FS_LEAK_ENABLE":
            pilot.surfaces_on_leak = value == 2
        elif name == "SIM_LEAK":
            if value and not pilot.is_leaking:
                pilot.leak()
            pilot.is_leaking = bool(value)


def _parameters(
    message: grace.MAVLink_command_long_message | grace.MAVLink_command_int_message,
) -> tuple[float, ...]:
    return message.param1, message.param2, message.param3, message.param4
