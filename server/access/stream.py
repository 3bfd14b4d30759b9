"""Streams and downloads: a ticket opens one, and it ends with the sign-in that opened it."""

import asyncio
from collections import Counter
from collections.abc import Callable, Coroutine, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from fastapi import WebSocket, WebSocketDisconnect, status
from sqlalchemy.exc import SQLAlchemyError

from db.fault import StoreError
from robot_link.clock import monotonic_s
from server.access.access import LOOK_S, Access
from server.access.caller import Caller, Proof
from server.access.presence import Presence, Who, who
from server.access.secret import new_secret, secret_hash

Direction: TypeAlias = Callable[[], Coroutine[Any, Any, None]]
"""One way of a stream; it returns when its far end has gone, or raises that its browser has."""
TICKET_S: Final = 30.0
"""How long a ticket waits for its one use."""
TICKETS_MAX: Final = 1000
STREAMS_MAX: Final = 100
"""Of one person, link or script at once."""


@dataclass(frozen=True, slots=True)
class _Issued:
    proof: Proof
    until_s: float


class Tickets:
    """Stand for a sign-in where no header can be sent, once and for half a minute.

    The address of a stream ends up in logs and histories; a ticket in it is worthless by then.
    """

    def __init__(self, access: Access) -> None:
        self._access = access
        self._issued: dict[str, _Issued] = {}

    def issue(self, caller: Caller) -> str:
        """Return a ticket of a caller; the oldest of too many is forgotten."""
        now_s = monotonic_s()
        self._issued = {key: one for key, one in self._issued.items() if one.until_s > now_s}
        if len(self._issued) >= TICKETS_MAX:
            del self._issued[next(iter(self._issued))]
        ticket = new_secret()
        self._issued[secret_hash(ticket)] = _Issued(caller.proof, now_s + TICKET_S)
        return ticket

    async def use(self, ticket: str) -> Caller | None:
        """Use a ticket up and return whose it was, ``None`` if it or its sign-in has ended."""
        issued = self._issued.pop(secret_hash(ticket), None)
        if issued is None or issued.until_s <= monotonic_s():
            return None
        return await self._access.caller_of(issued.proof)


class SignInEndedError(Exception):
    """What is being sent is no business of who asked for it any more."""


class SignInWatch:
    """Looks at the sign-ins of everything that lasts, all at once and only while there is any.

    Belongs to one event loop. A failing storage ends nobody's: what it is about is shown by the
    streams.
    """

    def __init__(self, access: Access, presence: Presence) -> None:
        self.presence = presence
        self.streams: Counter[Who] = Counter()
        """How many streams are open, by who opened them."""
        self._access = access
        self._watched: dict[asyncio.Event, Caller] = {}
        self._has_some = asyncio.Event()

    @contextmanager
    def watching(self, caller: Caller) -> Generator[asyncio.Event]:
        """Give what is set once a caller's sign-in has ended, or lets them do something else."""
        ended = asyncio.Event()
        self._watched[ended] = caller
        self._has_some.set()
        try:
            yield ended
        finally:
            del self._watched[ended]

    async def run(self) -> None:
        """Look at what is watched, until cancelled."""
        while True:
            await self._has_some.wait()
            await asyncio.sleep(LOOK_S)
            watched = dict(self._watched)
            if not watched:
                self._has_some.clear()
                continue
            try:
                rights = await self._access.rights_of({each.proof for each in watched.values()})
            except (StoreError, SQLAlchemyError):
                continue
            for ended, caller in watched.items():
                if rights.get(caller.proof) != caller.rights:
                    ended.set()


async def serve_stream(
    websocket: WebSocket,
    watch: SignInWatch,
    caller: Caller,
    name: str,
    *directions: Direction,
) -> None:
    """Run the directions of an accepted WebSocket until one ends, or the caller's sign-in does.

    The browser is told 1001 where the far end has gone, 1008 where its sign-in ended, and 1013
    where its person has too many streams already.
    """
    one = who(caller)
    if watch.streams[one] >= STREAMS_MAX:
        await websocket.close(status.WS_1013_TRY_AGAIN_LATER)
        return
    with watch.watching(caller) as ended, watch.presence.present(caller):
        watch.streams[one] += 1
        try:
            await _serve_until(ended, websocket, name, directions)
        finally:
            watch.streams[one] -= 1


async def _serve_until(
    ended: asyncio.Event, websocket: WebSocket, name: str, directions: tuple[Direction, ...]
) -> None:
    ending = asyncio.create_task(ended.wait(), name=f"sign-in of a {name}")
    running = [asyncio.create_task(one(), name=f"{name} to a client") for one in directions]
    try:
        await asyncio.wait((ending, *running), return_when=asyncio.FIRST_COMPLETED)
        if ending.done():
            await websocket.close(status.WS_1008_POLICY_VIOLATION)
        elif not any(one.done() and _is_gone(one.exception()) for one in running):
            await websocket.close(status.WS_1001_GOING_AWAY)
    finally:
        for task in (ending, *running):
            task.cancel()
        results = await asyncio.gather(ending, *running, return_exceptions=True)
    for result in results:
        if isinstance(result, Exception) and not _is_gone(result):
            raise result


def _is_gone(error: BaseException | None) -> bool:
    """Tell whether an error only says that the browser has left, maybe in the midst of a batch."""
    return isinstance(error, WebSocketDisconnect)
