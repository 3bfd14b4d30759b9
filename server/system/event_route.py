"""Everything that happened, in order."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response
from fastapi.responses import StreamingResponse

from autonomy.channel import ALARM_LEVELS
from db.query.station.events import (
    ALL_EVENTS,
    EventFilter,
    EventRecord,
    actors,
    events_after,
    last_cursor,
    newest_events,
)
from server.access.dependency import Viewer
from server.base.dependency import DeploymentDep, FoundationDep, StoreDep, period_of
from server.base.problem import Problem, conflict
from server.base.view import CURSOR_MAX, EventData, View, one_of
from server.system.event_export import blocks

router = APIRouter(prefix="/api/events", tags=["events"])


@dataclass(frozen=True, slots=True)
class EventView(View):
    """One thing that happened."""

    cursor: int
    at: datetime
    kind: str
    level: Annotated[str, one_of(*ALARM_LEVELS)]
    robot: str | None
    text: str
    data: EventData
    by: str | None
    """Who caused it; none where the station or a robot did."""
    by_kind: Annotated[str, one_of("person", "script", "command line")] | None


@dataclass(frozen=True, slots=True)
class EventsView(View):
    """A page of events, the oldest first."""

    events: list[EventView]
    next: int
    """Send it as ``after`` to go on; it stays valid when the station restarts."""


async def _wanted(
    robot: Annotated[str | None, Query(description="Events of this robot only.")] = None,
    kind: Annotated[
        list[str] | None,
        Query(description="Events of this kind only, such as robot.surfaced; may be repeated."),
    ] = None,
    by: Annotated[
        str | None, Query(max_length=100, description="Only what this person or script caused.")
    ] = None,
    by_anybody: Annotated[
        bool, Query(description="Only what people, scripts and command lines caused.")
    ] = False,
    text: Annotated[
        str, Query(max_length=200, description="A part of the sentence or of the kind.")
    ] = "",
    before: Annotated[
        int | None, Query(ge=0, le=CURSOR_MAX, description="Only what is older than this cursor.")
    ] = None,
) -> EventFilter:
    return EventFilter(robot, tuple(kind or ()), None, by, by_anybody, text, before)


@router.get("")
async def list_events(
    caller: Viewer,
    store: StoreDep,
    foundation: FoundationDep,
    deployment: DeploymentDep,
    wanted: Annotated[EventFilter, Depends(_wanted)],
    after: Annotated[
        int | None, Query(ge=0, le=CURSOR_MAX, description="Cursor to go on after.")
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
    wanted = replace(wanted, robots=caller.rights.robots)
    if deployment is not None:
        period = period_of(deployment)
        of_it = replace(wanted, robot=deployment.robot, period=period)
        records = await store.query(lambda s: newest_events(s, of_it, limit=limit))
        return _page(records, after)
    if after is not None and after > (last := await store.query(last_cursor)):
        raise conflict(
            f"The log ends at {last}; the cursor {after} is of another one. Read without `after`."
        )
    if after is None:
        records = await store.query(lambda s: newest_events(s, wanted, limit=limit))
        is_all = wanted == ALL_EVENTS
        return _page(records, None if is_all else await store.query(last_cursor))
    loop = asyncio.get_running_loop()
    seen, until_s = after, loop.time() + wait_s
    while True:
        last = await store.query(last_cursor)  # before the rows: what comes between is not passed
        records = await store.query(lambda s, seen=seen: events_after(s, seen, wanted, limit=limit))
        left_s = until_s - loop.time()
        if records or left_s <= 0.0 or not await foundation.event_log.grown_beyond(last, left_s):
            return _page(records, max(seen, last))
        seen = last


@dataclass(frozen=True, slots=True)
class ActorsView(View):
    """Everybody who caused an event."""

    names: list[str]


@router.get("/actors")
async def list_actors(caller: Viewer, store: StoreDep) -> ActorsView:
    """Return who caused events, people, scripts and command lines, by name."""
    seen = caller.rights.robots
    return ActorsView(await store.query(lambda session: actors(session, seen)))


@router.get(
    "/export",
    response_class=Response,
    responses={200: {"content": {"application/x-ndjson": {}}}},
)
async def export_events(caller: Viewer, store: StoreDep) -> StreamingResponse:
    """Return the whole log as lines of JSON, the oldest first, with the hashes of its chain.

    `hash` is SHA-256 over the hash of the line before (32 zero bytes at first) and `hashed`.
    403 for whoever may see some robots alone: the chain holds as a whole only.
    """
    if not caller.rights.sees(None):
        raise Problem(403, "The whole log is for those who may see all robots.")
    name = "attachment; filename=grace-events.ndjson"
    return StreamingResponse(
        blocks(store), media_type="application/x-ndjson", headers={"Content-Disposition": name}
    )


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
        record.by,
        record.by_kind,
    )
