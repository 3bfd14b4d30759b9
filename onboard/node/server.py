"""The serving end of a node: one device, any number of programs."""

import asyncio
import logging
from collections import deque
from collections.abc import AsyncGenerator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from typing import Any

from onboard.node.wire import (
    LINE_MAX,
    Content,
    NodeAddress,
    NodeError,
    NodeFault,
    content_of,
    line_of,
)

Answer = Callable[[dict[str, Any]], Awaitable[Content]]
"""Answers one kind of question; raises ``NodeError`` or ``ValueError`` where it cannot."""

_QUESTIONS_AT_ONCE = 8
"""Of one program; more are refused as BUSY."""
_ANSWERS_WAITING = 64
"""Answers that wait for a slow program; until it has read some, nothing more is read from it."""
_PROGRAMS_MAX = 32
"""Programs at once; more are hung up on."""
_NAME_SHOWN = 40
"""Characters of an unknown question that are said back."""
_PUBLISHED_WAITING = 64
"""Published lines that wait for a slow program; older ones give way to newer."""
_BAD_LINES_MAX = 8
"""A program that sends more is cut off."""
_SENTENCE_MAX = 300
"""Characters of what a device says of a wrong question."""
_GOODBYE_S = 1.0
"""Time for a program that is cut off to read why."""

_log = logging.getLogger(__name__)


class NodeServer:
    """Serves one node; belongs to one event loop.

    Args:
        name: The node's name, such as ``satellite``.
        answers: What it can be asked.
        topics: What it publishes.
    """

    def __init__(
        self, name: str, answers: Mapping[str, Answer], topics: tuple[str, ...] = ()
    ) -> None:
        self.name = name
        self.topics = topics
        self._answers = answers
        self._newest: dict[str, bytes] = {}
        self._programs: set[_Program] = set()
        self.dropped = 0
        """Published lines that slow programs never got."""

    @asynccontextmanager
    async def serve(self, address: NodeAddress | None = None) -> AsyncGenerator[NodeAddress]:
        """Listen; by default on a free loopback port.

        Yields:
            Where it listens.
        """
        wanted = address or NodeAddress()
        server = await asyncio.start_server(self._meet, wanted.host, wanted.port, limit=LINE_MAX)
        try:
            yield NodeAddress(wanted.host, server.sockets[0].getsockname()[1])
        finally:
            server.close()
            await asyncio.gather(*(program.end() for program in list(self._programs)))
            await server.wait_closed()

    def publish(self, topic: str, value: Content, *, is_state: bool = False) -> None:
        """Tell every program that subscribed.

        Args:
            topic: One of ``topics``.
            value: What is told.
            is_state: Whether a program that subscribes later shall get it at once.

        Raises:
            KeyError: If the node has no such topic.
            ValueError: If the value is no JSON.
        """
        if topic not in self.topics:
            raise KeyError(f"node {self.name} has no topic {topic}")
        line = line_of({"topic": topic, "value": value})
        if is_state:
            self._newest[topic] = line
        for program in self._programs:
            if topic in program.topics:
                self.dropped += program.publish(line)

    async def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._programs) >= _PROGRAMS_MAX:
            _log.warning("node %s serves %d programs already", self.name, _PROGRAMS_MAX)
            writer.transport.abort()
            return
        program = _Program(self, reader, writer)
        self._programs.add(program)
        try:
            await program.run()
        finally:
            self._programs.discard(program)

    async def answer(self, program: "_Program", ask: str, values: dict[str, Any]) -> Content:
        """Answer one question of a program.

        Raises:
            NodeError: If it cannot be answered.
        """
        match ask:
            case "describe":
                asks = [*self._answers, "describe", "subscribe"]
                return {"node": self.name, "asks": asks, "topics": list(self.topics)}
            case "subscribe":
                return self._subscribe(program, values)
            case _:
                pass
        if ask not in self._answers:
            known = ", ".join(self._answers)
            asked = repr(ask[:_NAME_SHOWN])
            raise NodeError(
                NodeFault.UNKNOWN, f"node {self.name} does not know {asked}; it knows {known}"
            )
        try:
            return await self._answers[ask](values)
        except (ValueError, KeyError, TypeError) as error:
            raise NodeError(NodeFault.BAD, f"{ask}: {str(error)[:_SENTENCE_MAX]}") from error

    def _subscribe(self, program: "_Program", values: dict[str, Any]) -> Content:
        wanted = values.get("topics")
        if not isinstance(wanted, list) or not all(topic in self.topics for topic in wanted):
            raise NodeError(
                NodeFault.BAD, f"topics of node {self.name}: {', '.join(self.topics) or 'none'}"
            )
        program.topics.update(wanted)
        for topic in wanted:
            if topic in self._newest:
                self.dropped += program.publish(self._newest[topic])
        return {"topics": sorted(program.topics)}


class _Program:
    """One connected program."""

    def __init__(
        self, node: NodeServer, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self._node = node
        self._reader = reader
        self._writer = writer
        self._said: deque[bytes] = deque()
        self._published: deque[bytes] = deque(maxlen=_PUBLISHED_WAITING)
        self._wake = asyncio.Event()
        self._has_room = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()
        self._ended = asyncio.Event()
        self.topics: set[str] = set()

    async def run(self) -> None:
        """Serve until the program hangs up or the node ends."""
        writing = asyncio.create_task(self._write(), name=f"node {self._node.name} write")
        try:
            with suppress(ConnectionError):
                await self._read()
            if not self._writer.is_closing():
                self._writer.writelines(self._said)
            self._writer.close()
        finally:
            for task in (writing, *self._tasks):
                task.cancel()
            await asyncio.gather(writing, *self._tasks, return_exceptions=True)
            with suppress(ConnectionError, TimeoutError):
                async with asyncio.timeout(_GOODBYE_S):
                    await self._writer.wait_closed()
            self._writer.transport.abort()
            self._ended.set()

    async def end(self) -> None:
        """Hang up."""
        self._writer.transport.abort()
        await self._ended.wait()

    def publish(self, line: bytes) -> int:
        """Queue a published line; return how many older ones gave way."""
        lost = int(len(self._published) == _PUBLISHED_WAITING)
        self._published.append(line)
        self._wake.set()
        return lost

    async def _read(self) -> None:
        bad = 0
        while bad <= _BAD_LINES_MAX:
            await self._room()
            try:
                line = await self._reader.readuntil(b"\n")
            except asyncio.IncompleteReadError:
                return
            except asyncio.LimitOverrunError:
                self._say({"error": f"a line has at most {LINE_MAX} bytes", "kind": NodeFault.BAD})
                return
            try:
                number, ask, values = _question(line)
            except ValueError as error:
                bad += 1
                self._say({"error": f"not a question: {error}", "kind": NodeFault.BAD})
                continue
            if len(self._tasks) >= _QUESTIONS_AT_ONCE:
                sentence = f"{_QUESTIONS_AT_ONCE} questions wait already"
                self._say({"id": number, "error": sentence, "kind": NodeFault.BUSY})
                continue
            task = asyncio.create_task(
                self._answer(number, ask, values), name=f"node {self._node.name} {ask}"
            )
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _answer(self, number: int, ask: str, values: dict[str, Any]) -> None:
        try:
            answer = await self._node.answer(self, ask, values)
            self._say({"id": number, "answer": answer})
        except NodeError as error:
            self._say({"id": number, "error": str(error), "kind": error.fault})
        except Exception:  # noqa: BLE001 - a device's fault is told to who asked, and logged
            _log.exception("node %s failed to answer %s", self._node.name, ask)
            sentence = f"node {self._node.name} failed; its log says why"
            self._say({"id": number, "error": sentence, "kind": NodeFault.FAILED})

    async def _room(self) -> None:
        """Wait until the program has read enough of its answers."""
        while len(self._said) >= _ANSWERS_WAITING and not self._writer.is_closing():
            self._has_room.clear()
            await self._has_room.wait()

    def _say(self, content: Content) -> None:
        self._said.append(line_of(content))
        self._wake.set()

    async def _write(self) -> None:
        try:
            while True:
                await self._wake.wait()
                self._wake.clear()
                while self._said or self._published:
                    self._writer.write((self._said or self._published).popleft())
                    await self._writer.drain()
                    self._has_room.set()
        except ConnectionError:
            self._writer.transport.abort()
            self._has_room.set()


def _question(line: bytes) -> tuple[int, str, dict[str, Any]]:
    match content_of(line):
        case {"id": int(number), "ask": str(ask), "with": dict(values)}:
            return number, ask, values
        case {"id": int(number), "ask": str(ask), **rest} if "with" not in rest:
            return number, ask, {}
        case _:
            raise ValueError("a question has a whole id, a text ask and an object with")
