"""The live stream: one JSON batch a tick over a WebSocket."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, WebSocket, WebSocketDisconnect

from db.query.station.events import last_cursor
from server.access.dependency import SignInWatchDep, WebSocketViewer
from server.access.stream import serve_stream
from server.base.dependency import StoreDep, service
from server.base.live_feed import Audience, LiveFeed
from server.base.view import CURSOR_MAX

router = APIRouter(tags=["live"])

LiveFeedDep = Annotated[LiveFeed, Depends(service(LiveFeed))]


@router.websocket("/api/live")
async def live(
    websocket: WebSocket,
    caller: WebSocketViewer,
    watch: SignInWatchDep,
    feed: LiveFeedDep,
    store: StoreDep,
    robots: Annotated[str | None, Query(description="Ids, separated by commas.")] = None,
    after: Annotated[
        int | None, Query(ge=0, le=CURSOR_MAX, description="Cursor of the last event seen.")
    ] = None,
) -> None:
    """Send what changed, up to ten times a second, until the browser leaves or its sign-in ends."""
    audience = Audience(caller.rights.robots, is_public=caller.is_link)
    wanted = None if robots is None else frozenset(filter(None, robots.split(",")))
    if after is not None and after > await store.query(last_cursor):
        after = None  # of another database: what it waits for would never come
    await websocket.accept()

    async def tell() -> None:
        await feed.follow(websocket.send_text, wanted, after, audience)

    async def hear() -> None:
        """Wait for the client to leave; what it says meanwhile is ignored."""
        while (await websocket.receive())["type"] != "websocket.disconnect":
            pass
        raise WebSocketDisconnect

    await serve_stream(websocket, watch, caller, "live stream", tell, hear)
