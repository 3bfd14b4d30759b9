"""Everything that happened, in order."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Query

from db.query.station.events import EventRecord, events_after, last_cursor, newest_events
from server.access.dependency import Viewer
from server.base.dependency import DeploymentDep, FoundationDep, StoreDep, period_of
from server.base.problem import conflict
from server.base.view import CURSOR_MAX, EventData, View, one_of

router = APIRouter(prefix="/api/events", tags=["events"])


@dataclass(frozen=True, slots=True)
class EventView(View):
    """One thing that happened."""

    cursor: int
    at: datetime
    kind: str
    level: Annotated[str, one_of("info", "watch", "warning", "critical")]
    robot: str | None
    text: str
    data: EventData


@dataclass(frozen=True, slots=True)
class EventsView(View):
    """A page of events, the oldest first."""

    events: list[EventView]
    next: int
    """Send it as ``after`` to go on; it stays valid when the station restarts."""


@router.get("")
async def list_events(
    caller: Viewer,
    store: StoreDep,
    foundation: FoundationDep,
    deployment: DeploymentDep,
    after: Annotated[
        int | None, Query(ge=0, le=CURSOR_MAX, description="Cursor to go on after.")
    ] = None,
    robot: Annotated[str | None, Query(description="Events of this robot only.")] = None,
    kind: Annotated[
        list[str] | None,
        Query(description="Events of this kind only, such as robot.surfaced; may be repeated."),
    ] = None,
    wait_s: Annotated[
        float, Query(ge=0.0, le=25.0, description="Wait so long for an event after `after`.")
    ] = 0.0,
    limit: Annotated[int, Query(ge=1, le=1000)] = 200,
) -> EventsView:
    """Return the events after a cursor, or the newest ones where no cursor is given.

    Of a deployment, the newest events of its robot in its time. With `wait_s`, the answer comes as
    soon as there is an event after the cursor, or empty after that time: a script that always goes
    on from `next` misses none, however often its connection breaks.

    A cursor that this log has not reached is refused: it comes from another database, and would
    wait for what it has missed already.
    """
    del caller
    if deployment is not None:
        period = period_of(deployment)
        records = await store.query(
            lambda s: newest_events(s, robot=deployment.robot, period=period, limit=limit)
        )
        return _page(records, after)
    if after is not None and after > (last := await store.query(last_cursor)):
        raise conflict(
            f"The log ends at {last}; the cursor {after} is of another one. Read without `after`."
        )
    kinds = tuple(kind or ())
    if after is None:
        records = await store.query(
            lambda s: newest_events(s, robot=robot, kinds=kinds, limit=limit)
        )
        return _page(records, await store.query(last_cursor) if kinds or robot else None)
    loop = asyncio.get_running_loop()
    seen, until_s = after, loop.time() + wait_s
    while True:
        last = await store.query(last_cursor)  # before the rows: what comes between is not passed
        records = await store.query(
            lambda s, seen=seen: events_after(s, seen, robot=robot, kinds=kinds, limit=limit)
        )
        left_s = until_s - loop.time()
        if records or left_s <= 0.0 or not await foundation.event_log.grown_beyond(last, left_s):
            return _page(records, max(seen, last))
        seen = last


def _page(records: Sequence[EventRecord], after: int | None) -> EventsView:
    last = records[-1].cursor if records else (after or 0)
    return EventsView([event_view(record) for record in records], last)


def event_view(record: EventRecord) -> EventView:
    """Return an event as it is shown."""
    return EventView(
        record.cursor,
        record.at,
        record.kind,
        record.level,
        record.robot,
        record.text,
        dict(record.data),
    )
