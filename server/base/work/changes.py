"""Requests that wait for the next change of one thing, and cost nothing meanwhile."""

import asyncio
import contextlib
import hashlib
from collections.abc import Awaitable, Callable, Generator
from contextlib import contextmanager
from typing import Annotated, Final, TypeVar

import msgspec
from fastapi import Depends, Header, Query, Request, Response

from server.base.event_bus import EventBus

WAIT_MAX_S: Final = 30.0
E = TypeVar("E")
V = TypeVar("V")


class Changes:
    """Wakes whoever waits for a thing when an event about it is published.

    Belongs to one event loop. Ids of different kinds differ, so one register serves all.
    """

    def __init__(self, bus: EventBus) -> None:
        self._bus = bus
        self._waiting: dict[str, set[asyncio.Event]] = {}
        self._is_closed = False

    def follow(self, kind: type[E], identity: Callable[[E], str]) -> None:
        """Take every event of a type as a change of the thing that it is about."""
        self._bus.subscribe(kind, lambda event: self._note(identity(event)))

    def close(self) -> None:
        """Let nobody wait any longer."""
        self._is_closed = True
        for identity in list(self._waiting):
            self._note(identity)

    @contextmanager
    def watching(self, identity: str) -> Generator[asyncio.Event]:
        """Have an event set with each change of a thing, from now on."""
        changed = asyncio.Event()
        if self._is_closed:
            changed.set()
        self._waiting.setdefault(identity, set()).add(changed)
        try:
            yield changed
        finally:
            others = self._waiting[identity]
            others.discard(changed)
            if not others:
                del self._waiting[identity]

    @property
    def is_closed(self) -> bool:
        """Whether the station stops."""
        return self._is_closed

    def _note(self, identity: str) -> None:
        for changed in self._waiting.get(identity, ()):
            changed.set()


class Waiting:
    """What a request says of waiting, and the waiting itself."""

    def __init__(
        self,
        request: Request,
        response: Response,
        wait_s: Annotated[
            float,
            Query(
                ge=0.0,
                le=WAIT_MAX_S,
                description="Wait so long for the next change; what has ended is told at once.",
            ),
        ] = 0.0,
        if_none_match: Annotated[
            str | None,
            Header(description="The `ETag` seen last: what differs from it is told at once."),
        ] = None,
    ) -> None:
        self._request = request
        self._response = response
        self._wait_s = wait_s
        self._seen = if_none_match
        self._changes: Changes = request.app.state.foundation.changes

    async def told(
        self,
        identity: str,
        look: Callable[[], Awaitable[V]],
        *,
        has_ended: Callable[[V], bool],
        is_news: Callable[[V], bool] = lambda _: True,
    ) -> V:
        """Return a thing as it stands, or as it stands after its next change.

        Args:
            identity: Id of the thing.
            look: Returns its view.
            has_ended: Whether nothing more comes of it, so that nobody waits.
            is_news: Whether a change is one that was waited for.
        """
        with self._changes.watching(identity) as changed:
            found = await look()
            if self._wait_s > 0.0 and not has_ended(found) and self._is_known(found):
                found = await self._after_change(changed, look, is_news, found)
        self._response.headers["ETag"] = _etag(found)
        return found

    async def _after_change(
        self,
        changed: asyncio.Event,
        look: Callable[[], Awaitable[V]],
        is_news: Callable[[V], bool],
        found: V,
    ) -> V:
        before = _etag(found)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self._wait_s), _until_gone(self._request, changed) as gone:
                while not gone.is_set() and not self._changes.is_closed:
                    await changed.wait()
                    changed.clear()
                    found = await look()
                    if _etag(found) != before and is_news(found):
                        break
        return found

    def _is_known(self, found: object) -> bool:
        return self._seen is None or self._seen == _etag(found)


@contextlib.asynccontextmanager
async def _until_gone(request: Request, changed: asyncio.Event):  # noqa: ANN202 - a generator of one event
    """Have a wait end when its client leaves."""
    gone = asyncio.Event()

    async def listen() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass
        gone.set()
        changed.set()

    task = asyncio.create_task(listen(), name="client that waits")
    try:
        yield gone
    finally:
        task.cancel()
        await asyncio.wait([task])


def _etag(found: object) -> str:
    return f'"{hashlib.sha256(msgspec.json.encode(found)).hexdigest()[:16]}"'


WaitingDep = Annotated[Waiting, Depends()]
