"""The station's side of the standard services of one robot."""

import asyncio
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from robot_link.clock import monotonic_s
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.messages import LinkState, SystemId
from robot_link.service.clock_sync import ClockWatch
from robot_link.station.command_client import CommandClient, StandardCommand
from robot_link.station.control_speaker import ControlSpeaker
from robot_link.station.drive_client import DriveClient
from robot_link.station.error import NoAnswerError, OutOfContactError
from robot_link.station.exchange import Patience
from robot_link.station.file_client import FileClient
from robot_link.station.fix_sender import FixPace, FixSender
from robot_link.station.metadata_client import MetadataClient
from robot_link.station.mission_client import MissionClient
from robot_link.station.parameter_client import ParameterClient
from robot_link.station.peer import Peer
from robot_link.station.table_watch import TableWatch

_CLOCK_PERIOD_S = 30.0
_CLOCK_LOOK_S = 1.0

_STREAM_PATIENCE_S = 3.0
_STREAM_US = 500_000
_TELEMETRY: Final = (
    grace.MAVLINK_MSG_ID_ATTITUDE,
    grace.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    grace.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
)
"""Any of them says that the vehicle was asked already."""
_ASKED_FOR: Final = (
    *_TELEMETRY,
    grace.MAVLINK_MSG_ID_SYS_STATUS,
    grace.MAVLINK_MSG_ID_GPS_RAW_INT,
    grace.MAVLINK_MSG_ID_SCALED_PRESSURE,
    grace.MAVLINK_MSG_ID_SCALED_PRESSURE2,
    grace.MAVLINK_MSG_ID_BATTERY_STATUS,
    grace.MAVLINK_MSG_ID_MISSION_CURRENT,
    grace.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    grace.MAVLINK_MSG_ID_ESC_STATUS,
    grace.MAVLINK_MSG_ID_ESC_INFO,
    grace.MAVLINK_MSG_ID_RPM,
)

_HEARERS: Final[Mapping[int, tuple[str, ...]]] = MappingProxyType(
    {
        grace.MAVLINK_MSG_ID_HEARTBEAT: ("parameters",),
        grace.MAVLINK_MSG_ID_AUTOPILOT_VERSION: ("parameters",),
        grace.MAVLINK_MSG_ID_PARAM_VALUE: ("parameters",),
        grace.MAVLINK_MSG_ID_PARAM_ERROR: ("parameters",),
        grace.MAVLINK_MSG_ID_COMMAND_ACK: ("parameters", "commands", "metadata"),
        grace.MAVLINK_MSG_ID_COMPONENT_METADATA: ("metadata",),
        grace.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: ("files",),
        grace.MAVLINK_MSG_ID_TIMESYNC: ("clock",),
        grace.MAVLINK_MSG_ID_GRACE_CHANNELS: ("tables",),
        grace.MAVLINK_MSG_ID_GRACE_DRIVE: ("drive",),
        grace.MAVLINK_MSG_ID_MISSION_ACK: ("missions",),
        grace.MAVLINK_MSG_ID_MISSION_COUNT: ("missions",),
        grace.MAVLINK_MSG_ID_MISSION_ITEM_INT: ("missions",),
        grace.MAVLINK_MSG_ID_MISSION_REQUEST: ("missions",),
        grace.MAVLINK_MSG_ID_MISSION_REQUEST_INT: ("missions",),
    }
)
"""Which client each message may be an answer for; most messages are of none of them."""


class RobotServices:
    """Parameters, files, missions, commands and clock of one robot; on one event loop."""

    def __init__(self, peer: Peer, pace: FixPace, *, is_standard: bool) -> None:
        patience = Patience(answer_s=peer.timing.answer_s)
        self._peer = peer
        self._telemetry_s = -math.inf
        """When telemetry came last, by the wall."""
        self.parameters = ParameterClient(peer, patience=patience)
        self.files = FileClient(peer, patience=patience)
        self.missions = MissionClient(peer, patience=patience)
        """Standard missions, for vehicles of other makers."""
        self.commands = CommandClient(peer, patience=patience)
        """Standard commands: orders to vehicles of other makers, and driving by hand."""
        self.drive = DriveClient(peer, self.commands, has_throttle=is_standard)
        """Driving by hand."""
        self.control = ControlSpeaker(peer)
        """Who is to be in control of it."""
        self.clock = ClockWatch(peer, peer.clock, patience=patience)
        self.fixes = FixSender(peer, lambda: self.clock.offset, pace)
        """Where cameras see it."""
        self.metadata = MetadataClient(peer, self.files, patience=patience)
        """What a vehicle says of its own parameters."""
        self.tables = TableWatch(peer, lambda: self.is_live, answer_s=peer.timing.answer_s)
        """What is still missing of the robot's table of channels."""
        self._clients = {
            "tables": self.tables,
            "metadata": self.metadata,
            "parameters": self.parameters,
            "files": self.files,
            "missions": self.missions,
            "commands": self.commands,
            "drive": self.drive,
            "clock": self.clock,
        }

    def hear(self, message: WireMessage) -> None:
        """Pass on what may answer one of the clients."""
        if message.get_msgId() in _TELEMETRY:
            self._telemetry_s = monotonic_s()
        for name in _HEARERS.get(message.get_msgId(), ()):
            self._clients[name].hear(message)

    async def run(self) -> None:
        """Compare clocks, ask for missing pages, tell control and fixes, until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._compare_clocks(), name=f"{self._peer.robot} clock")
            group.create_task(self.tables.run(), name=f"{self._peer.robot} channels")
            group.create_task(self.control.run(), name=f"{self._peer.robot} control")
            group.create_task(self.fixes.run(), name=f"{self._peer.robot} fixes")

    async def _compare_clocks(self) -> None:
        """Compare the clocks now and then while the robot is in contact."""
        pause_s = _CLOCK_LOOK_S
        while True:
            if self.is_live:
                try:
                    await self.clock.measure()
                    pause_s = _CLOCK_PERIOD_S
                except NoAnswerError:  # not every vehicle answers, and a robot may have dived
                    pause_s = min(2 * pause_s, _CLOCK_PERIOD_S)
                await asyncio.sleep(pause_s)
            else:
                pause_s = _CLOCK_LOOK_S
                await asyncio.sleep(_CLOCK_LOOK_S)

    async def ask_for_streams(self) -> None:
        """Ask a standard vehicle for its telemetry, again and again until it comes, or cancelled.

        Autopilots send little but heartbeats to a station that did not ask.
        """
        while True:
            if self.is_live and monotonic_s() - self._telemetry_s > _STREAM_PATIENCE_S:
                await self._peer.deliver(_stream_requests(self._peer.system))
            await asyncio.sleep(_STREAM_PATIENCE_S)

    @property
    def is_live(self) -> bool:
        """Whether the robot is in radio contact."""
        return self._peer.link_report().state is LinkState.LIVE

    def check_live(self) -> None:
        """Refuse to ask a robot that cannot answer.

        Raises:
            OutOfContactError: If the robot is not in radio contact.
        """
        if not self.is_live:
            raise OutOfContactError(f"{self._peer.robot} is not in radio contact")


def _stream_requests(system: SystemId) -> list[WireMessage]:
    """Return the requests for telemetry twice a second, in the old way and in the new one."""
    component = grace.MAV_COMP_ID_AUTOPILOT1
    rate_hz, start = round(1e6 / _STREAM_US), 1
    asked: list[WireMessage] = [
        grace.MAVLink_request_data_stream_message(
            system, component, grace.MAV_DATA_STREAM_ALL, rate_hz, start
        )
    ]
    interval = grace.MAV_CMD_SET_MESSAGE_INTERVAL
    for number in _ASKED_FOR:
        command = StandardCommand(interval, (float(number), float(_STREAM_US)))
        asked.append(command.message(system, component, 0))
    return asked
