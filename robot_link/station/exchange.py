"""Questions to a robot, each repeated until the message comes that answers it."""

import asyncio
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol, TypeVar

from robot_link.clock import monotonic_s
from robot_link.mavlink.codec import WireMessage
from robot_link.messages import SystemId
from robot_link.station.error import NoAnswerError

Answer = TypeVar("Answer")

_NEWEST_SHARE = 0.25
"""Weight of the newest round trip in their running mean."""
_INBOX = 1024
"""Messages that a slow reader may leave waiting; more are dropped, and asked for again."""


class Correspondent(Protocol):
    """Whom the clients talk to: one robot, by whatever radio reaches it."""

    @property
    def system(self) -> SystemId:
        """Its MAVLink system id."""
        ...

    async def deliver(self, messages: Iterable[WireMessage]) -> bool:
        """Send messages; return whether its radio confirmed them."""
        ...


@dataclass(frozen=True, slots=True)
class Patience:
    """How long and how often a question is asked; wall seconds."""

    answer_s: float = 1.5
    """Wait for an answer, beside twice the round trip seen so far."""
    attempts: int = 4
    """How often a question is sent before the robot counts as silent."""


class Exchange:
    """Asks, waits and asks again; belongs to one event loop.

    Every message of the robot must be given to ``hear``. Several questions may be under way.
    """

    def __init__(self, peer: Correspondent, patience: Patience | None = None) -> None:
        self._peer = peer
        self.patience = patience or Patience()
        self._listeners: list[asyncio.Queue[WireMessage]] = []
        self._round_trip_s = 0.0

    @property
    def system(self) -> SystemId:
        """The robot's MAVLink system id."""
        return self._peer.system

    @property
    def wait_s(self) -> float:
        """How long an answer is waited for now."""
        return self.patience.answer_s + 2.0 * self._round_trip_s

    def hear(self, message: WireMessage) -> None:
        """Pass on what the robot said."""
        for inbox in self._listeners:
            with suppress(asyncio.QueueFull):
                inbox.put_nowait(message)

    async def say(self, messages: Sequence[WireMessage]) -> None:
        """Send something that needs no answer."""
        await self._peer.deliver(messages)

    async def ask(
        self,
        question: Callable[[int], Sequence[WireMessage]],
        answer: Callable[[WireMessage], Answer | None],
        *,
        attempts: int | None = None,
        about: str = "",
    ) -> Answer:
        """Send a question until it is answered.

        Args:
            question: Gives what to send at each attempt, counted from 0.
            answer: What a message answers; None where it is no answer.
            attempts: How often to ask; by default as often as the patience says.
            about: What was asked for, for the sentence of the error.

        Raises:
            NoAnswerError: If no answer came.
        """
        with Listening(self) as inbox:
            for attempt in range(self.patience.attempts if attempts is None else attempts):
                asked_s = monotonic_s()
                await self._peer.deliver(question(attempt))
                with suppress(TimeoutError):
                    found = await inbox.first(answer, self.wait_s)
                    self._note_round_trip(monotonic_s() - asked_s)
                    return found
        raise NoAnswerError("the robot did not answer" + (f" {about}" if about else ""))

    def listen(self) -> "Listening":
        """Return an inbox that is open within a ``with`` block."""
        return Listening(self)

    def open(self, inbox: "asyncio.Queue[WireMessage]") -> None:
        """Give all further messages to this inbox as well."""
        self._listeners.append(inbox)

    def close(self, inbox: "asyncio.Queue[WireMessage]") -> None:
        """Give nothing more to this inbox."""
        self._listeners.remove(inbox)

    def _note_round_trip(self, took_s: float) -> None:
        self._round_trip_s += _NEWEST_SHARE * (took_s - self._round_trip_s)


class Listening:
    """What a robot says while the ``with`` block lasts."""

    def __init__(self, exchange: Exchange) -> None:
        self._exchange = exchange
        self._inbox: asyncio.Queue[WireMessage] = asyncio.Queue(_INBOX)

    def __enter__(self) -> "Listening":
        self._exchange.open(self._inbox)
        return self

    def __exit__(self, *_: object) -> None:
        self._exchange.close(self._inbox)

    async def first(
        self, answer: Callable[[WireMessage], Answer | None], longest_s: float
    ) -> Answer:
        """Return the first answer among the messages to come.

        Raises:
            TimeoutError: If there was none in time.
        """
        async with asyncio.timeout(max(0.0, longest_s)):
            while True:
                found = answer(await self._inbox.get())
                if found is not None:
                    return found
