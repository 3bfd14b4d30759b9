"""A program's end of a node: asks, and hears what the node publishes."""

import asyncio
import itertools
import logging
from collections import deque
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Any

from onboard.node.wire import (
    NodeAddress,
    NodeError,
    NodeFault,
    NodeGoneError,
    NodeSilentError,
    content_of,
    line_of,
)

_REOPEN_S = 0.2
_SUBSCRIBE = 0
"""Number of the question that the client itself asks."""

_FAULTS = {fault.value: fault for fault in NodeFault}

_log = logging.getLogger(__name__)


class Subscription:
    """What a node publishes on one topic, the newest ``size`` of it; for one reader."""

    def __init__(self, topic: str, size: int) -> None:
        self.topic = topic
        self.dropped = 0
        """Values that gave way to newer ones before they were read."""
        self._values: deque[dict[str, Any]] = deque(maxlen=size)
        self._arrived = asyncio.Event()

    def put(self, value: dict[str, Any]) -> None:
        """Take a value in."""
        self.dropped += int(len(self._values) == self._values.maxlen)
        self._values.append(value)
        self._arrived.set()

    async def get(self) -> dict[str, Any]:
        """Return the oldest value that was not read, waiting for one."""
        while not self._values:
            self._arrived.clear()
            await self._arrived.wait()
        return self._values.popleft()

    async def __aiter__(self) -> AsyncIterator[dict[str, Any]]:
        """Yield values until cancelled."""
        while True:
            yield await self.get()


class NodeClient:
    """Talks to one node, and connects again when the node comes back; belongs to one event loop.

    Args:
        address: Where the node listens.
    """

    def __init__(self, address: NodeAddress) -> None:
        self.address = address
        self._subscriptions: list[Subscription] = []
        self._asked: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._numbers = itertools.count(_SUBSCRIBE + 1)
        self._writer: asyncio.StreamWriter | None = None
        self._connected = asyncio.Event()

    async def run(self) -> None:
        """Connect, serve and connect again until cancelled."""
        was_told = False
        while True:
            try:
                reader, writer = await self.address.connect()
            except OSError as error:
                if not was_told:
                    _log.warning("no node at %s: %s", self.address, error)
                was_told = True
            else:
                was_told = False
                await self._serve(reader, writer)
            await asyncio.sleep(_REOPEN_S)

    async def connected(self) -> None:
        """Wait for a connection."""
        await self._connected.wait()

    def subscribe(self, topic: str, size: int = 1) -> Subscription:
        """Hear a topic from now on, across connections.

        Args:
            topic: What the node publishes.
            size: How many values wait for their reader at most.
        """
        subscription = Subscription(topic, size)
        self._subscriptions.append(subscription)
        if self._writer is not None:
            self._writer.write(_subscribe_line([topic]))
        return subscription

    async def ask(self, what: str, *, timeout_s: float = 5.0, **values: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
        """Ask the node and return its answer.

        Raises:
            NodeError: If the node says no.
            NodeGoneError: If there is no connection, or it breaks before the answer.
            NodeSilentError: If no answer comes in time.
            ValueError: If a value is no JSON.
        """
        if self._writer is None:
            raise NodeGoneError(f"there is no connection to the node at {self.address}")
        number = next(self._numbers)
        line = line_of({"id": number, "ask": what, "with": values})
        answer: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        self._asked[number] = answer
        try:
            self._writer.write(line)
            async with asyncio.timeout(timeout_s):
                return await answer
        except TimeoutError as error:
            raise NodeSilentError(
                f"the node at {self.address} did not answer {what} in {timeout_s:g} s"
            ) from error
        finally:
            self._asked.pop(number, None)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writer = writer
        topics = sorted({subscription.topic for subscription in self._subscriptions})
        if topics:
            writer.write(_subscribe_line(topics))
        self._connected.set()
        try:
            with suppress(ConnectionError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
                while True:
                    self._take(await reader.readuntil(b"\n"))
        finally:
            self._connected.clear()
            self._writer = None
            for answer in self._asked.values():
                if not answer.done():
                    gone = NodeGoneError(f"the node at {self.address} closed the connection")
                    answer.set_exception(gone)
                    answer.exception()  # it may have no reader any more
            writer.close()
            with suppress(ConnectionError):
                await writer.wait_closed()

    def _take(self, line: bytes) -> None:
        try:
            said = content_of(line)
        except ValueError as error:
            _log.warning("node at %s: %s", self.address, error)
            return
        match said:
            case {"topic": topic, "value": dict(value)}:
                for subscription in self._subscriptions:
                    if subscription.topic == topic:
                        subscription.put(value)
            case {"id": int(number), "answer": dict(answer)} if asked := self._waiting(number):
                asked.set_result(answer)
            case {"id": int(number), "error": str(sentence), "kind": str(kind)} if (
                asked := self._waiting(number)
            ):
                fault = _FAULTS.get(kind, NodeFault.FAILED)
                asked.set_exception(NodeError(fault, sentence))
            case {"error": sentence}:
                _log.warning("node at %s: %s", self.address, sentence)
            case {"id": int(), "answer": _}:
                pass  # too late, or to the subscription
            case _:
                _log.warning("node at %s: neither an answer nor a topic", self.address)

    def _waiting(self, number: int) -> asyncio.Future[dict[str, Any]] | None:
        """Return who waits for the answer of this number."""
        asked = self._asked.get(number)
        return None if asked is None or asked.done() else asked


def _subscribe_line(topics: list[str]) -> bytes:
    return line_of({"id": _SUBSCRIBE, "ask": "subscribe", "with": {"topics": topics}})
