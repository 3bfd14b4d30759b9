"""The 3D view of a replay: it shows the moment that its tab asks for, and takes nothing."""

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Path, Response, WebSocket
from pydantic import AwareDatetime

from robot_link.messages import RobotId
from server.access.dependency import SignInWatchDep, Viewer, WebSocketViewer
from server.base.dependency import service
from server.base.view import Body
from server.scene.door import Foreign, Framed, page_response, pipe, refuse_foreign_scene
from server.scene.replay_host import ReplayScenes
from server.scene.view import ReplayViewView

router = APIRouter(tags=["view"])

ReplayScenesDep = Annotated[ReplayScenes, Depends(service(ReplayScenes))]
Tab = Annotated[
    str,
    Path(
        pattern=r"^[0-9a-f]{32}$",
        description="Names the tab of a browser: 32 hexadecimal digits that it draws for itself.",
    ),
]


class MomentBody(Body):
    """The moment that a tab is at."""

    at: AwareDatetime
    """RFC 3339."""
    clock: Literal["measured", "received"] = "measured"
    """`measured`: where the robot was then, whenever it told. `received`: where the station
    believed it to be then."""


@router.put("/api/robots/{robot}/view/replay/{tab}")
async def move_replay_view(
    caller: Viewer, robot: RobotId, tab: Tab, body: MomentBody, scenes: ReplayScenesDep
) -> ReplayViewView:
    """Draw a robot at a moment, for one tab of a browser; nobody else sees it move.

    422 for a moment that has not come yet.
    """
    del caller
    return ReplayViewView.of(robot, await scenes.move(robot, tab, body.at, body.clock))


@router.get(
    "/view/{robot}/replay/{tab}/", summary="Page of a replay's 3D scene", response_class=Response
)
async def show_replay_view(
    robot: RobotId,
    caller: Viewer,
    tab: Tab,
    framed: Framed = False,
    websocket: Foreign = None,
) -> Response:
    """Return the page of a replay's scene, marked as not live."""
    del caller, robot, tab
    refuse_foreign_scene(websocket)
    return page_response(is_framed=framed)


@router.websocket("/view/{robot}/replay/{tab}")
async def pipe_replay_view(
    websocket: WebSocket,
    robot: RobotId,
    tab: Tab,
    caller: WebSocketViewer,
    watch: SignInWatchDep,
    scenes: ReplayScenesDep,
) -> None:
    """Carry the scene of a replay to a browser; of the browser's, its camera alone."""
    scene = scenes.find(robot, tab)
    if scene is None:
        await websocket.close(code=1008)
        return
    await pipe(websocket, scene, caller, watch, may_change=False)
