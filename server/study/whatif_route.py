"""What-if runs: controllers compared in one scenario, before anybody flies it."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response
from pydantic import Field

from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.text import Title
from server.base.view import Body, SettingsDocument, encoded
from server.base.work.job_view import JobBegun, JobView
from server.study.view import WhatIfsView, WhatIfView
from server.study.whatif import ControllerRequest, WhatIfs

router = APIRouter(prefix="/api", tags=["what-if"], route_class=IdempotentRoute)

WhatIfsDep = Annotated[WhatIfs, Depends(service(WhatIfs))]


class ControllerBody(Body):
    """A controller that is to be compared."""

    kind: str
    """Key of a controller, such as ``controller.pid``; see `GET /api/config`."""
    title: Title | None = None
    """What it is called in plots; by default its kind's title."""
    config: SettingsDocument = Field(default_factory=dict)
    """Settings that differ from what holds for the robot; null returns one to its preset."""


class WhatIfRequest(Body):
    """A scenario, and the controllers that are tried in it on the same seeds."""

    scenario: SettingsDocument = Field(default_factory=dict)
    """Fields that differ from what holds for the robot; see `GET /api/config/trial/schema`."""
    controllers: list[ControllerBody] = Field(min_length=1, max_length=6)
    """What is compared."""


class ShownWhatIf(Body):
    """What the 3D view is to draw beside the robot."""

    id: str | None
    """A what-if run of the robot; null for none."""


@router.post("/robots/{robot}/whatif", status_code=202)
async def start_whatif(
    caller: Pilot, robot: str, body: WhatIfRequest, whatifs: WhatIfsDep, begun: JobBegun
) -> JobView:
    """Begin a run in a process of its own; `about` of the job is its id.

    422 names each wrong field by its path, or the limit of the vehicle that the reference breaks.
    """
    requests = [ControllerRequest(one.kind, one.title, one.config) for one in body.controllers]
    _, job = await whatifs.start(robot, body.scenario, requests, by=caller.name)
    return await begun(job)


@router.get("/robots/{robot}/whatifs")
async def list_whatifs(
    caller: Viewer,
    robot: str,
    whatifs: WhatIfsDep,
    before: Annotated[str | None, Query(description="Id to go on before.")] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 50,
) -> WhatIfsView:
    """Return the runs of a robot, the newest first, without their results."""
    del caller
    return WhatIfsView(whatifs=await whatifs.of_robot(robot, before, limit))


@router.get("/whatifs/{whatif}", response_model=WhatIfView)
async def get_whatif(caller: Viewer, whatif: str, whatifs: WhatIfsDep) -> Response:
    """Return one run with its result."""
    del caller
    return encoded(await whatifs.get(whatif))


@router.put("/robots/{robot}/whatif/shown")
async def show_whatif(
    caller: Pilot, robot: str, body: ShownWhatIf, whatifs: WhatIfsDep
) -> ShownWhatIf:
    """Draw a run in the 3D view, beginning where the robot is now, or none.

    409 says that a run has no result to draw.
    """
    del caller
    await whatifs.shown.show(robot, body.id)
    return ShownWhatIf(id=whatifs.shown.id_of(robot))
