"""The way to a scene: viser's page and its WebSocket, reached through the station's own door.

viser itself has neither sign-in nor an Origin check, so it listens on a socket of the station's
user, and every message passes here. A scene is chosen by the path, because viser's page cuts the
query off its WebSocket address.
"""

import contextlib
from collections.abc import Callable, Coroutine
from typing import Annotated, Any

import websockets
from fastapi import Query, Response, WebSocket, WebSocketDisconnect

from server.access.access import Caller
from server.access.stream import Direction, SignInWatch, serve_stream
from server.base.problem import Problem
from webui.scene.page import page, policy
from webui.scene.server import RobotScene

_LARGEST_MESSAGE = 2**26
_FOREIGN_SCENE = "This view shows the station's own scenes only; leave `websocket` out."

Framed = Annotated[
    bool, Query(description="Without viser's own panel, for a frame that has switches beside it.")
]
Foreign = Annotated[str | None, Query(include_in_schema=False)]
"""Where viser's page would look for another scene."""


def refuse_foreign_scene(websocket: str | None) -> None:
    """Refuse a page that is to show a scene from elsewhere.

    Raises:
        Problem: 400 if it is.
    """
    if websocket is not None:
        raise Problem(400, _FOREIGN_SCENE)


def page_response(*, is_framed: bool) -> Response:
    """Return viser's page, which then opens the WebSocket of the same path."""
    return Response(
        page(is_framed=is_framed),
        media_type="text/html; charset=utf-8",
        headers={"Content-Encoding": "gzip", "Content-Security-Policy": policy()},
    )


async def pipe(
    websocket: WebSocket,
    scene: RobotScene,
    caller: Caller,
    watch: SignInWatch,
    *,
    may_change: bool,
) -> None:
    """Carry messages between a browser and a scene until either end closes.

    Everything of the scene goes to the browser; of the browser's, its camera, and with
    ``may_change`` the value of a control that everybody sees.
    """
    offered = websocket.scope.get("subprotocols", [])
    if not offered:
        await websocket.close(code=1008)
        return
    async with websockets.unix_connect(
        str(scene.socket),
        "ws://localhost/",
        subprotocols=[websockets.Subprotocol(name) for name in offered],
        compression=None,
        max_size=_LARGEST_MESSAGE,
    ) as line:
        await websocket.accept(subprotocol=line.subprotocol)

        async def to_scene() -> None:
            while (message := await websocket.receive())["type"] != "websocket.disconnect":
                content = scene.admitted(message.get("bytes") or b"", may_change=may_change)
                if content is not None:
                    await line.send(content)
            raise WebSocketDisconnect

        async def to_browser() -> None:
            async for content in line:
                if isinstance(content, bytes):
                    await websocket.send_bytes(content)

        await serve_stream(
            websocket, watch, caller, "3D view", _until_closed(to_scene), _until_closed(to_browser)
        )


def _until_closed(direction: Callable[[], Coroutine[Any, Any, None]]) -> Direction:
    """Let a direction end in peace when the scene has gone."""

    async def run() -> None:
        with contextlib.suppress(websockets.ConnectionClosed):
            await direction()

    return run
