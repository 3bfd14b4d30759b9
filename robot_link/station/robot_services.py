"""The station's side of the standard services of one robot."""

import asyncio
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.messages import LinkState
from robot_link.service.clock_sync import ClockWatch
from robot_link.station.command_client import CommandClient
from robot_link.station.error import NoAnswerError, OutOfContactError
from robot_link.station.exchange import Patience
from robot_link.station.file_client import FileClient
from robot_link.station.mission_client import MissionClient
from robot_link.station.parameter_client import ParameterClient
from robot_link.station.peer import Peer

_CLOCK_PERIOD_S = 30.0
_CLOCK_LOOK_S = 1.0

_HEARERS: Final[Mapping[int, tuple[str, ...]]] = MappingProxyType(
    {
        grace.MAVLINK_MSG_ID_HEARTBEAT: ("parameters",),
        grace.MAVLINK_MSG_ID_AUTOPILOT_VERSION: ("parameters",),
        grace.MAVLINK_MSG_ID_PARAM_VALUE: ("parameters",),
        grace.MAVLINK_MSG_ID_PARAM_ERROR: ("parameters",),
        grace.MAVLINK_MSG_ID_COMMAND_ACK: ("parameters", "commands"),
        grace.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: ("files",),
        grace.MAVLINK_MSG_ID_TIMESYNC: ("clock",),
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

    def __init__(self, peer: Peer) -> None:
        patience = Patience(answer_s=peer.timing.answer_s)
        self._peer = peer
        self.parameters = ParameterClient(peer, patience=patience)
        self.files = FileClient(peer, patience=patience)
        self.missions = MissionClient(peer, patience=patience)
        """Standard missions, for vehicles of other makers."""
        self.commands = CommandClient(peer, patience=patience)
        """Standard commands, for vehicles of other makers."""
        self.clock = ClockWatch(peer, peer.clock, patience=patience)
        self._clients = {
            "parameters": self.parameters,
            "files": self.files,
            "missions": self.missions,
            "commands": self.commands,
            "clock": self.clock,
        }

    def hear(self, message: WireMessage) -> None:
        """Pass on what may answer one of the clients."""
        for name in _HEARERS.get(message.get_msgId(), ()):
            self._clients[name].hear(message)

    async def run(self) -> None:
        """Compare the clocks now and then, while the robot is in contact, until cancelled."""
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
