"""Identifications: the parameters of a vehicle, sought in what a robot recorded."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response
from pydantic import AwareDatetime, Field

from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.text import Title
from server.base.view import Body, SettingsDocument, encoded
from server.base.work.job_view import JobBegun, JobView
from server.study.identification import Identifications
from server.study.view import (
    AcceptedVehicleView,
    IdentificationsView,
    IdentificationView,
)

router = APIRouter(prefix="/api", tags=["identification"], route_class=IdempotentRoute)

IdentificationsDep = Annotated[Identifications, Depends(service(Identifications))]


class IdentificationRequest(Body):
    """A recording, and how the parameters are sought in it."""

    deployment: str
    """A deployment of the robot, such as ``deployment-2``."""
    start: AwareDatetime | None = None
    """First moment; by default the deployment's."""
    end: AwareDatetime | None = None
    """Last moment; by default the deployment's."""
    config: SettingsDocument = Field(default_factory=dict)
    """Settings that differ from what holds for the robot; see
    `GET /api/config/identification/schema`."""


class AcceptRequest(Body):
    """What the vehicle is to be called."""

    key: str | None = Field(default=None, pattern=r"^[a-z0-9][a-z0-9_-]{0,39}$")
    """Its key in the catalogue; by default one made of the robot's id."""
    title: Title | None = None
    """Its title; by default one that says where it comes from."""


@router.post("/robots/{robot}/identifications", status_code=202)
async def start_identification(
    caller: Pilot,
    robot: str,
    body: IdentificationRequest,
    identifications: IdentificationsDep,
    begun: JobBegun,
) -> JobView:
    """Begin a search in a process of its own; `about` of the job is its id.

    409 says what a recording lacks: channels, reports from under water, or any report at all.
    """
    _, job = await identifications.start(
        robot, body.deployment, body.config, start=body.start, end=body.end, by=caller.name
    )
    return await begun(job)


@router.get("/robots/{robot}/identifications")
async def list_identifications(
    caller: Viewer,
    robot: str,
    identifications: IdentificationsDep,
    before: Annotated[str | None, Query(description="Id to go on before.")] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 50,
) -> IdentificationsView:
    """Return the searches of a robot, the newest first, without their results."""
    del caller
    found = await identifications.of_robot(robot, before, limit)
    return IdentificationsView(identifications=found)


@router.get("/identifications/{identification}", response_model=IdentificationView)
async def get_identification(
    caller: Viewer, identification: str, identifications: IdentificationsDep
) -> Response:
    """Return one search as it stands now; its convergence grows while it runs."""
    del caller
    return encoded(await identifications.get(identification))


@router.post("/identifications/{identification}/cancel", response_model=IdentificationView)
async def cancel_identification(
    caller: Pilot, identification: str, identifications: IdentificationsDep
) -> Response:
    """Call a search off; the answer comes when it has stopped. It can be resumed."""
    del caller
    return encoded(await identifications.cancel(identification))


@router.post("/identifications/{identification}/resume", status_code=202)
async def resume_identification(
    caller: Pilot, identification: str, identifications: IdentificationsDep, begun: JobBegun
) -> JobView:
    """Let a search go on from its last checkpoint, also after a restart of the station."""
    _, job = await identifications.resume(identification, by=caller.name)
    return await begun(job)


@router.post("/identifications/{identification}/accept", status_code=201)
async def accept_identification(
    caller: Pilot,
    identification: str,
    identifications: IdentificationsDep,
    body: AcceptRequest | None = None,
) -> AcceptedVehicleView:
    """Keep what was found as a vehicle of the catalogue; the robot's model stays as it is.

    Offsets of the actuators that were found with it are named in its note and in the answer, and
    offered as a trim advice.
    """
    wish = body or AcceptRequest()
    return await identifications.accept(
        identification, key=wish.key, title=wish.title, by=caller.name
    )
