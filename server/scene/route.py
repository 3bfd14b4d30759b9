"""The 3D view of a robot now: viser's page and its WebSocket, and what everybody sees in it."""

from typing import Annotated, Literal, cast

from fastapi import APIRouter, Depends, Response, WebSocket
from fastapi.responses import RedirectResponse
from pydantic import Field

from robot_link.messages import RobotId
from server.access.dependency import Pilot, SignInWatchDep, Viewer, WebSocketViewer
from server.access.role import Right
from server.base.dependency import service
from server.base.problem import not_found
from server.base.view import Body
from server.scene.door import Foreign, Framed, page_response, pipe, refuse_foreign_scene
from server.scene.host import SceneHost
from server.scene.view import SceneStateView
from webui.scene.view import SceneChange, SceneState

router = APIRouter(tags=["view"])

SceneHostDep = Annotated[SceneHost, Depends(service(SceneHost))]


Share = Annotated[float, Field(ge=0.0, le=1.0)]


class SceneChangeBody(Body):
    """What is to be different in a 3D view; whatever is left out stays."""

    quantity: Literal["mean", "std"] | None = None
    """Whether the mean of the map is drawn or its standard deviation."""
    form: Literal["volume", "slices"] | None = None
    """How the map is drawn."""
    model: str | None = None
    """Which model of the field is drawn."""
    slice_depth: Share | None = None
    """Where the level slice lies, as a share of the map's depth; ``null`` takes it away."""
    slice_north: Share | None = None
    """Where the slice across north lies, as a share of the map; ``null`` takes it away."""
    slice_east: Share | None = None
    """Where the slice across east lies, as a share of the map; ``null`` takes it away."""
    opacity: float | None = Field(default=None, ge=0.02, le=1.0)
    """How opaque the map is, 0.02 to 1."""
    exaggeration: float | None = Field(default=None, ge=1.0, le=1000.0)
    """How many times depths are stretched, 1 to 1,000."""
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
    websocket: Foreign = None,
) -> RedirectResponse:
    """Lead to the scene of ``robot``."""
    refuse_foreign_scene(websocket)
    return RedirectResponse(f"/view/{robot}/{'?framed=true' if framed else ''}", status_code=307)


@router.get("/view/{robot}/", summary="Page of a robot's 3D scene", response_class=Response)
async def show_view(
    robot: RobotId,
    caller: Viewer,
    scenes: SceneHostDep,
    framed: Framed = False,
    websocket: Foreign = None,
) -> Response:
    """Return viser's page, which then opens the WebSocket of the same path."""
    refuse_foreign_scene(websocket)
    if await scenes.scene(robot) is None:
        raise not_found(f"There is no robot {robot}.")
    return page_response(is_framed=framed)


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
    if scene is None:
        await websocket.close(code=1008)
        return
    await pipe(websocket, scene, caller, watch, may_change=caller.rights.may(Right.PILOT, robot))
