"""A radio at the port that does what a test says."""

import asyncio
from collections.abc import Awaitable, Callable

from robot_link.transport.port import Port
from robot_link.transport.xbee_frame import encode


class ScriptedPort:
    """A port whose far side is a function from what was written to what is read."""

    def __init__(self, answer: Callable[[bytes], bytes] = lambda _: b"") -> None:
        self.written: list[bytes] = []
        self._answer = answer
        self._incoming: asyncio.Queue[bytes] = asyncio.Queue()

    async def read(self) -> bytes:
        return await self._incoming.get()

    async def write(self, data: bytes) -> None:
        self.written.append(data)
        if answer := self._answer(data):
            self._incoming.put_nowait(answer)

    def bring(self, data: bytes) -> None:
        self._incoming.put_nowait(data)

    def unread(self, data: bytes) -> None:
        if data:
            self._incoming.put_nowait(data)

    def close(self) -> None:
        pass


def answering_questions(data: bytes) -> bytes:
    """A radio that knows its parameters and says nothing of what it sends."""
    if data[3] != 0x08:
        return b""
    value = {b"NP": b"\x01\x00", b"DB": b"\x40"}.get(data[5:7], b"\x00\x00\x00\x01")
    return encode(bytes((0x88, data[4])) + data[5:7] + b"\x00" + value, 1)


def opener(port: Port) -> Callable[[], Awaitable[Port]]:
    async def opened() -> Port:
        return port

    return opened
