"""The acoustic node: ranges to other modems under water, and words of 13 bits.

| question | values | answer |
|---|---|---|
| ping | peer: address | travel_time_s, range_m (null without an answer), is_valid, reason |
| mini | peer: address, word: 0..8191 | |

Topics: ``range``, each answer to a ping, with its peer; ``mini``, ``{"peer", "word"}`` that came.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from onboard.node.server import NodeServer
from onboard.node.wire import Content, NodeError, NodeFault
from robot_link.acoustic.config import AcousticConfig
from robot_link.acoustic.measurement import MiniReceived
from robot_link.acoustic.micromodem import MicroModem
from robot_link.acoustic.modem_line import ModemRefusedError, ModemTiming
from robot_link.clock import Clock
from robot_link.messages import RobotId
from robot_link.transport.datagram import PortClosedError
from robot_link.transport.port import Port, SerialPort

RANGE, MINI = "range", "mini"
_BAUD = 19200


class AcousticNode:
    """Serves one Micro-Modem to any number of programs.

    Args:
        line: Its serial line or pseudo-terminal.
        us: Its own address.
        peers: Who has the modem of which address.
        clock: The robot's clock.
        config: Speed of sound and longest range.
        timing: Time-outs on the line.
    """

    def __init__(
        self,
        line: Path,
        us: int,
        peers: Mapping[int, RobotId],
        clock: Clock,
        config: AcousticConfig | None = None,
        timing: ModemTiming | None = None,
    ) -> None:
        async def opened() -> Port:
            return await SerialPort.open(str(line), baud=_BAUD, flow_control=False)

        self._modem = MicroModem(opened, us, peers, clock, config, timing, self._hear)
        self.server = NodeServer(
            "acoustic", {"ping": self._ping, "mini": self._mini}, (RANGE, MINI)
        )

    async def run(self) -> None:
        """Run the modem until cancelled."""
        await self._modem.run()

    async def drain(self) -> None:
        """Take the line's events, which no program asks for, until cancelled."""
        async for _ in self._modem.events():
            pass

    def _hear(self, message: MiniReceived) -> None:
        self.server.publish(MINI, {"peer": message.peer, "word": message.word})

    async def _ping(self, values: dict[str, Any]) -> Content:
        measured = await self._modem.ping(int(values["peer"]))
        answer = {
            "peer": measured.peer,
            "travel_time_s": measured.travel_time_s,
            "range_m": measured.range_m,
            "is_valid": measured.is_valid,
            "reason": measured.reason,
        }
        self.server.publish(RANGE, answer)
        return answer

    async def _mini(self, values: dict[str, Any]) -> Content:
        try:
            await self._modem.mini(int(values["peer"]), int(values["word"]))
        except (ModemRefusedError, PortClosedError) as error:
            sentence = str(error) or "there is no modem at the line"
            raise NodeError(NodeFault.REFUSED, sentence) from error
        return {}
