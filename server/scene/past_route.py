"""The 3D view of a robot at a moment of the past: it shows what was believed, and takes nothing."""

from typing import Annotated

from fastapi import APIRouter, Depends, Path, Response, WebSocket
from pydantic import AwareDatetime

from db.fault import UnknownIdError
from robot_link.messages import RobotId
from server.access.dependency import SignInWatchDep, Viewer, WebSocketViewer
from server.base.dependency import service
from server.base.problem import Problem
from server.scene.door import Foreign, Framed, page_response, pipe, refuse_foreign_scene
from server.scene.past_host import PastScenes
from server.scene.view import PastViewView

router = APIRouter(tags=["view"])

PastScenesDep = Annotated[PastScenes, Depends(service(PastScenes))]
Then = Annotated[AwareDatetime, Path(description="The moment, RFC 3339.")]


@router.get("/api/robots/{robot}/view/at/{at}")
async def get_past_view(
    caller: Viewer, robot: RobotId, at: Then, scenes: PastScenesDep
) -> PastViewView:
    """Return what the 3D view of a robot at a moment shows, and how old each part was then.

    The robot stands where the station believed it to be: what it measured before and told later is
    not among it. The map is the one that was kept last before.
    """
    del caller
    return PastViewView.of(await scenes.known(robot, at))


@router.get(
    "/view/{robot}/at/{at}/", summary="Page of a robot's 3D scene then", response_class=Response
)
async def show_past_view(
    robot: RobotId,
    caller: Viewer,
    at: Then,
    scenes: PastScenesDep,
    framed: Framed = False,
    websocket: Foreign = None,
) -> Response:
    """Return the page of the scene as it was, marked with its moment and as not live.

    422 for a moment that has not come yet.
    """
    del caller
    refuse_foreign_scene(websocket)
    await scenes.scene(robot, at)
    return page_response(is_framed=framed)


@router.websocket("/view/{robot}/at/{at}")
async def pipe_past_view(
    websocket: WebSocket,
    robot: RobotId,
    at: Then,
    caller: WebSocketViewer,
    watch: SignInWatchDep,
    scenes: PastScenesDep,
) -> None:
    """Carry a past scene to a browser; of the browser's, its camera alone."""
    try:
        past = await scenes.scene(robot, at)
    except (Problem, UnknownIdError):
        await websocket.close(code=1008)
        return
    await pipe(websocket, past.scene, caller, watch, may_change=False)
