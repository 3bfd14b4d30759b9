"""The 3D view: viser's page and its WebSocket, reached through the station's own door.

viser itself has neither sign-in nor an Origin check, so it listens on a socket of the station's
user, and every message passes here. A robot is chosen by the path, because viser's page cuts the
query off its WebSocket address.
"""

import contextlib
from collections.abc import Callable, Coroutine
from typing import Annotated, Any, Literal, cast

import websockets
from fastapi import APIRouter, Depends, Query, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import RedirectResponse
from pydantic import Field

from robot_link.messages import RobotId
from server.access.dependency import Pilot, SignInWatchDep, Viewer, WebSocketViewer
from server.access.role import Right
from server.access.stream import Direction, serve_stream
from server.base.dependency import service
from server.base.problem import Problem, not_found
from server.base.view import Body
from server.scene.host import SceneHost
from server.scene.view import SceneStateView
from webui.scene.page import page, policy
from webui.scene.view import SceneChange, SceneState

router = APIRouter(tags=["view"])

SceneHostDep = Annotated[SceneHost, Depends(service(SceneHost))]

_LARGEST_MESSAGE = 2**26
_FOREIGN_SCENE = "This view shows the station's own scenes only; leave `websocket` out."

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Framed = Annotated[
    bool, Query(description="Without viser's own panel, for a frame that has switches beside it.")
]


class SceneChangeBody(Body):
    """What is to be different in a 3D view; whatever is left out stays."""

    quantity: Literal["mean", "std"] | None = None
    form: Literal["volume", "slices"] | None = None
    model: str | None = None
    slice_depth: Share | None = None
    """Where the level slice lies, as a share of the map's depth; ``null`` takes it away."""
    slice_north: Share | None = None
    slice_east: Share | None = None
    opacity: float | None = Field(default=None, ge=0.02, le=1.0)
    exaggeration: float | None = Field(default=None, ge=1.0, le=1000.0)
    layers: dict[str, bool] | None = None
    """Layers to show or hide, by key."""


_MAY_BE_NULL = ("slice_depth", "slice_north", "slice_east")


@router.get("/api/robots/{robot}/view")
async def get_scene_state(caller: Viewer, robot: RobotId, scenes: SceneHostDep) -> SceneStateView:
    """Return what everybody who looks at a robot's 3D view sees."""
    return _told(robot, await scenes.state(robot))


@router.patch("/api/robots/{robot}/view")
async def change_scene_state(
    caller: Pilot, robot: RobotId, body: SceneChangeBody, scenes: SceneHostDep
) -> SceneStateView:
    """Let everybody see another quantity, slice, opacity, exaggeration or layer."""
    given = body.model_dump(exclude_unset=True)
    change = {
        key: value for key, value in given.items() if value is not None or key in _MAY_BE_NULL
    }
    return _told(robot, await scenes.change(robot, cast("SceneChange", change)))


def _told(robot: str, state: SceneState | None) -> SceneStateView:
    if state is None:
        raise not_found(f"There is no robot {robot}.")
    return SceneStateView.of(state)


@router.get("/view/", summary="3D view of one robot", response_class=RedirectResponse)
async def choose_view(
    caller: Viewer,
    robot: RobotId,
    framed: Framed = False,
    websocket: Annotated[str | None, Query(include_in_schema=False)] = None,
) -> RedirectResponse:
    """Lead to the scene of ``robot``."""
    _refuse_foreign_scene(websocket)
    return RedirectResponse(f"/view/{robot}/{'?framed=true' if framed else ''}", status_code=307)


@router.get("/view/{robot}/", summary="Page of a robot's 3D scene", response_class=Response)
async def show_view(
    robot: RobotId,
    caller: Viewer,
    scenes: SceneHostDep,
    framed: Framed = False,
    websocket: Annotated[str | None, Query(include_in_schema=False)] = None,
) -> Response:
    """Return viser's page, which then opens the WebSocket of the same path."""
    _refuse_foreign_scene(websocket)
    if await scenes.scene(robot) is None:
        raise not_found(f"There is no robot {robot}.")
    return Response(
        page(is_framed=framed),
        media_type="text/html; charset=utf-8",
        headers={"Content-Encoding": "gzip", "Content-Security-Policy": policy()},
    )


@router.websocket("/view/{robot}")
async def pipe_view(
    websocket: WebSocket,
    robot: RobotId,
    caller: WebSocketViewer,
    watch: SignInWatchDep,
    scenes: SceneHostDep,
) -> None:
    """Carry messages between a browser and the robot's scene until either end closes.

    Everything of the scene goes to the browser; of the browser's, its camera, and from who may
    change what everybody sees, the value of a control.
    """
    scene = await scenes.scene(robot)
    offered = websocket.scope.get("subprotocols", [])
    if scene is None or not offered:
        await websocket.close(code=1008)
        return
    may_change = caller.rights.may(Right.PILOT, robot)
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


def _refuse_foreign_scene(websocket: str | None) -> None:
    if websocket is not None:
        raise Problem(400, _FOREIGN_SCENE)
