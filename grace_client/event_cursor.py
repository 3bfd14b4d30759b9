"""The station's events, each once and in order, over broken connections, restarts and one's own.

The station keeps every event under a cursor that grows; who goes on after the last one that was
done misses none. A cursor can be kept in a file: an event counts as done, and is written there,
when the next one is asked for, so that a script that dies in the middle of one gets it again.
"""

import os
from collections import deque
from collections.abc import AsyncIterator, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grace_client.exchange import Call, Flow
from grace_client.generated.models import EventsView, EventView

if TYPE_CHECKING:
    from grace_client.calls import AsyncRunner, Runner

WAIT_S = 20.0
_PAGE = 200


class _Place:
    """Where a reader is in the log, and what it has fetched beyond that."""

    def __init__(self, query: dict[str, Any], file: Path | None, after: int | None) -> None:
        self._query = query
        self._file = file
        if after is None and file is not None and file.exists():
            after = int(file.read_text())
        self.after = after
        """Cursor of the last event that is done; ``None`` before the first request."""
        self._fetched: deque[EventView] = deque()

    def step(self, runner: "Runner | AsyncRunner") -> Flow[EventView | None]:
        """Return the next event, or ``None`` where none came in a while."""
        if not self._fetched:
            yield from self._fetch(runner)
        return self._fetched.popleft() if self._fetched else None

    def done(self, cursor: int) -> None:
        """Note that everything up to a cursor is done, on disk before it counts."""
        self.after = cursor
        if self._file is None:
            return
        draft = self._file.with_name(f".{self._file.name}.new")
        with draft.open("w") as file:
            file.write(str(cursor))
            file.flush()
            os.fsync(file.fileno())
        draft.replace(self._file)

    def _fetch(self, runner: "Runner | AsyncRunner") -> Flow[None]:
        if self.after is None:
            newest = Call("GET", "/api/events", query={**self._query, "limit": 1})
            page: EventsView = yield from runner.told(newest, EventsView)
            self.done(page.next)
        query = {**self._query, "after": self.after, "wait_s": WAIT_S, "limit": _PAGE}
        call = Call("GET", "/api/events", query=query, timeout_s=WAIT_S + 30.0)
        page = yield from runner.told(call, EventsView)
        self._fetched.extend(page.events)
        if not page.events:
            self.done(page.next)


def _place(
    robot: str | None, kind: Sequence[str], file: str | Path | None, after: int | None
) -> _Place:
    query: dict[str, Any] = {"kind": list(kind)}
    if robot is not None:
        query["robot"] = robot
    return _Place(query, None if file is None else Path(file), after)


class EventCursor:
    """Iterates over events for ever; ``None`` now and then where nothing happens, if asked."""

    def __init__(
        self,
        runner: "Runner",
        robot: str | None,
        kind: Sequence[str],
        file: str | Path | None,
        after: int | None,
    ) -> None:
        self._runner = runner
        self._place = _place(robot, kind, file, after)

    @property
    def after(self) -> int | None:
        """Cursor of the last event that is done."""
        return self._place.after

    def poll(self) -> EventView | None:
        """Return the next event, or ``None`` if none came within 20 s; call ``done`` after it."""
        return self._runner.run(self._place.step(self._runner))

    def done(self, event: EventView) -> None:
        """Note that an event is done, and need not come again."""
        self._place.done(event.cursor)

    def __iter__(self) -> Iterator[EventView]:
        """Yield each event; it is done when the next one is asked for."""
        while True:
            event = self.poll()
            if event is not None:
                yield event
                self.done(event)


class AsyncEventCursor:
    """The same as ``EventCursor``, awaited."""

    def __init__(
        self,
        runner: "AsyncRunner",
        robot: str | None,
        kind: Sequence[str],
        file: str | Path | None,
        after: int | None,
    ) -> None:
        self._runner = runner
        self._place = _place(robot, kind, file, after)

    @property
    def after(self) -> int | None:
        """Cursor of the last event that is done."""
        return self._place.after

    async def poll(self) -> EventView | None:
        """Return the next event, or ``None`` if none came within 20 s; call ``done`` after it."""
        return await self._runner.run(self._place.step(self._runner))

    def done(self, event: EventView) -> None:
        """Note that an event is done, and need not come again."""
        self._place.done(event.cursor)

    async def __aiter__(self) -> AsyncIterator[EventView]:
        """Yield each event; it is done when the next one is asked for."""
        while True:
            event = await self.poll()
            if event is not None:
                yield event
                self.done(event)
