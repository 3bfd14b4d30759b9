"""The live stream: one JSON batch a tick over a WebSocket."""

import asyncio
from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Depends, Query, WebSocket, WebSocketDisconnect, status

from server.access.dependency import WebSocketViewer
from server.base.dependency import service
from server.base.live_feed import LiveFeed

router = APIRouter(tags=["live"])

LiveFeedDep = Annotated[LiveFeed, Depends(service(LiveFeed))]


@router.websocket("/api/live")
async def live(
    websocket: WebSocket,
    caller: WebSocketViewer,
    feed: LiveFeedDep,
    robots: Annotated[str | None, Query(description="Ids, separated by commas.")] = None,
    after: Annotated[int | None, Query(ge=0, description="Cursor of the last event seen.")] = None,
) -> None:
    """Send what changed, ten times a second, until the browser leaves or its sign-in ends."""
    wanted = None if robots is None else frozenset(filter(None, robots.split(",")))
    await websocket.accept()
    sending = asyncio.create_task(
        feed.follow(websocket.send_text, wanted, after), name="live stream to a client"
    )
    leaving = asyncio.create_task(_until_gone(websocket), name="client of the live stream")
    signed_in_s = (caller.expires_at - datetime.now(UTC)).total_seconds()
    try:
        await asyncio.wait(
            {sending, leaving}, timeout=signed_in_s, return_when=asyncio.FIRST_COMPLETED
        )
        if not leaving.done():
            gone = sending.done()
            await websocket.close(
                status.WS_1001_GOING_AWAY if gone else status.WS_1008_POLICY_VIOLATION
            )
    finally:
        sending.cancel()
        leaving.cancel()
        results = await asyncio.gather(sending, leaving, return_exceptions=True)
    for result in results:
        # A client may leave in the middle of a batch; anything else is a fault of the station.
        if isinstance(result, Exception) and not isinstance(result, WebSocketDisconnect):
            raise result


async def _until_gone(websocket: WebSocket) -> None:
    """Wait for the client to leave; what it says meanwhile is ignored."""
    async for _ in websocket.iter_bytes():
        pass
