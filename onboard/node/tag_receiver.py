"""The tag receiver node: what a VR2C says on its serial line, of tags that it hears.

Topics: ``heard``, ``{"receiver", "tag", "sensor", "at"}`` for each transmission, ``at`` by the
receiver's clock; ``status``, ``{"receiver", "at"}`` for each line on the receiver's own condition;
``refused``, ``{"fault", "line"}`` with the bytes of a line that is not believed. Question
``counts``: how many of each there were.
"""

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from onboard.node.server import NodeServer
from onboard.node.wire import Content
from robot_link.tag.receiver_line import (
    BAUD,
    LINE_BYTES_MAX,
    HeardLine,
    ReceiverLineError,
    read_line,
)
from robot_link.transport.keeper import PortKeeper
from robot_link.transport.port import Port, SerialPort

HEARD, STATUS, REFUSED = "heard", "status", "refused"
_REOPEN_S = 0.5


class TagReceiverNode:
    """Serves one receiver to any number of programs.

    Args:
        line: Its serial line or pseudo-terminal.
    """

    def __init__(self, line: Path) -> None:
        async def opened() -> Port:
            return await SerialPort.open(str(line), baud=BAUD, flow_control=False)

        self._open: Callable[[], Awaitable[Port]] = opened
        self._keeper = PortKeeper("tag receiver", self._serve, _REOPEN_S)
        self._counts: Counter[str] = Counter()
        self.server = NodeServer(
            "tag_receiver", {"counts": self._tell_counts}, (HEARD, STATUS, REFUSED)
        )

    async def run(self) -> None:
        """Read the line until cancelled, and open it again whenever it fails."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._drain(), name="tag receiver events")
            await self._keeper.run()

    async def _drain(self) -> None:
        """Take the line's events, which no program asks for."""
        async for _ in self._keeper.events():
            pass

    async def _serve(self) -> str:
        try:
            port = await self._open()
        except OSError as error:
            return str(error)
        self._keeper.opened()
        rest = b""
        try:
            while data := await port.read():
                *lines, rest = (rest + data).split(b"\n")
                for line in lines:
                    self._take(line)
                if len(rest) > LINE_BYTES_MAX:
                    self._take(rest)
                    rest = b""
        except OSError as error:
            return str(error)
        else:
            return "the line is gone"
        finally:
            port.close()

    def _take(self, line: bytes) -> None:
        if not line.strip():
            return
        try:
            read = read_line(line)
        except ReceiverLineError as error:
            fault = error.fault.name.lower()
            self._counts[fault] += 1
            raw = line[:LINE_BYTES_MAX].hex()
            self.server.publish(REFUSED, {"fault": fault, "line": raw})
            return
        at = read.at.isoformat()
        if isinstance(read, HeardLine):
            self._counts[HEARD] += 1
            heard = {"receiver": read.receiver, "tag": read.tag, "sensor": read.sensor, "at": at}
            self.server.publish(HEARD, heard)
        else:
            self._counts[STATUS] += 1
            self.server.publish(STATUS, {"receiver": read.receiver, "at": at})

    async def _tell_counts(self, _values: dict[str, Any]) -> Content:
        return dict(self._counts)
