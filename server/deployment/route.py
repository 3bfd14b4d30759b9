"""Deployments: planned, begun, ended, split, corrected, and looked back at."""

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query
from pydantic import AwareDatetime, Field
from sqlalchemy.orm import Session

from autonomy.site import Site
from db.query.fleet.deployments import DeploymentRecord, get_deployment
from db.query.fleet.deployments import list_deployments as query_deployments
from db.store import Store
from server.access.dependency import Pilot, PilotOf, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import StoreDep, service
from server.base.problem import not_found
from server.base.text import Name, Title
from server.base.view import Body
from server.deployment.deployments import Deployments
from server.deployment.suggestion import Suggestions
from server.deployment.view import DeploymentsView, DeploymentView, SplitView, deployment_view
from server.fleet.dependency import FleetDep
from server.fleet.route import FleetViewsDep
from server.fleet.view import RobotView

router = APIRouter(prefix="/api", tags=["deployments"], route_class=IdempotentRoute)

DeploymentsDep = Annotated[Deployments, Depends(service(Deployments))]
SuggestionsDep = Annotated[Suggestions, Depends(service(Suggestions))]
State = Literal["planned", "in_water", "recovered", "reviewed", "delivered"]
Purpose = Annotated[str, Field(max_length=500)]
Overrule = Annotated[str, Field(max_length=500)]
People = Annotated[list[Name], Field(max_length=50)]


class NewDeployment(Body):
    """A deployment that is planned, or that has begun."""

    robot: str
    """Id of the robot."""
    name: Title | None = None
    """By default the robot's name and the day."""
    purpose: Purpose = ""
    """What it is for."""
    people: People = Field(default_factory=list[str])
    """Who takes part."""
    started_at: AwareDatetime | None = None
    """When the robot came into the water; without it the deployment is planned."""
    ended_at: AwareDatetime | None = None
    """When it came out, of one that is noted afterwards."""
    overrule: Overrule = ""
    """Why it begins although a checklist is open, if it shall; it is logged."""


class DeploymentChanges(Body):
    """What is to be changed of a deployment."""

    name: Title | None = None
    """What lists call it."""
    purpose: Purpose | None = None
    """What it is for."""
    people: People | None = None
    """Who takes part."""
    started_at: AwareDatetime | None = None
    """When the robot went into the water."""
    ended_at: AwareDatetime | None = None
    """When it was recovered; ``null`` while it has not been."""


class Moment(Body):
    """When something was so."""

    at: AwareDatetime | None = None
    """By default now."""


class Launch(Moment):
    """When a robot came into the water."""

    overrule: Overrule = ""
    """Why it is launched although a checklist is open, if it shall; it is logged."""


class Split(Body):
    """Where a deployment is to be split."""

    at: AwareDatetime
    """Moment at which the deployment becomes two."""
    name: Title | None = None
    """Of the second part; by default the robot's name and the day."""


class Voiding(Body):
    """Why a deployment does not count."""

    reason: str = Field(min_length=1, max_length=500, pattern=r"\S")
    """Why the deployment was a mistake; it is logged."""


class Review(Body):
    """What a person says who looked at the data."""

    note: str = Field(default="", max_length=500)
    """What is said of the deployment; empty for nothing."""


class Delivery(Body):
    """To whom the data were handed over."""

    to: str = Field(min_length=1, max_length=500, pattern=r"\S")
    """Who has the data now, 1 to 500 characters."""


class Reopening(Body):
    """Why a deployment is to be reviewed anew."""

    reason: str = Field(min_length=1, max_length=500, pattern=r"\S")
    """Why the deployment goes on; it is logged."""


@router.get("/deployments")
async def list_deployments(
    caller: Viewer,
    store: StoreDep,
    robot: Annotated[str | None, Query()] = None,
    state: Annotated[State | None, Query()] = None,
    void: Annotated[bool, Query(description="Those that do not count, instead.")] = False,
    before: Annotated[str | None, Query(description="Id to go on before.")] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> DeploymentsView:
    """Return deployments, the newest first."""
    seen = caller.rights.robots

    def views(session: Session) -> list[DeploymentView]:
        records = query_deployments(
            session,
            robot=robot,
            robots=seen,
            state=state,
            is_void=void,
            before=before,
            limit=limit,
        )
        return [deployment_view(session, record) for record in records]

    return DeploymentsView(await store.query(views))


@router.post("/deployments", status_code=201)
async def create_deployment(
    caller: Pilot,
    body: NewDeployment,
    pilot_of: PilotOf,
    deployments: DeploymentsDep,
    fleet: FleetDep,
    store: StoreDep,
) -> DeploymentView:
    """Plan a deployment, or note one that has begun, or is over.

    409 if the robot has another deployment at this time; the answer names it. 409 too if it begins
    now and its settings ask for a checklist that is open: each item is named.
    """
    await pilot_of((body.robot,))
    fleet.status(body.robot)
    record = await deployments.add(
        body.robot,
        title=body.name,
        purpose=body.purpose,
        people=body.people,
        started_at=body.started_at,
        ended_at=body.ended_at,
        by=caller.name,
        overrule=body.overrule.strip(),
    )
    return await _view(store, record)


@router.get("/deployments/{deployment}")
async def get_one(caller: Viewer, deployment: str, store: StoreDep) -> DeploymentView:
    """Return one deployment."""
    del caller
    return await store.query(lambda s: deployment_view(s, get_deployment(s, deployment)))


@router.get("/deployments/{deployment}/water")
async def get_water(caller: Viewer, deployment: str, store: StoreDep) -> Site:
    """Return the water as it was described when the deployment ended, or as it is described now."""
    del caller
    return await store.query(lambda session: get_deployment(session, deployment).site)


@router.patch("/deployments/{deployment}")
async def patch_deployment(
    caller: Pilot,
    deployment: str,
    changes: DeploymentChanges,
    deployments: DeploymentsDep,
    store: StoreDep,
) -> DeploymentView:
    """Change what is written of a deployment, or correct its times.

    409 if another deployment of the robot has this time; the answer names it.
    """
    given = changes.model_dump(exclude_unset=True, exclude_none=True)
    if "name" in given:
        given["title"] = given.pop("name")
    return await _view(store, await deployments.correct(deployment, given, caller.name))


@router.post("/deployments/{deployment}/begin")
async def begin_deployment(
    caller: Pilot,
    deployment: str,
    deployments: DeploymentsDep,
    store: StoreDep,
    body: Launch | None = None,
) -> DeploymentView:
    """Say that the robot is in the water; 409 if it was already.

    409 too if its settings ask for a checklist of a launch that is open: each item is named.
    """
    wanted = Launch() if body is None else body
    record = await deployments.begin(
        deployment, wanted.at, by=caller.name, overrule=wanted.overrule.strip()
    )
    return await _view(store, record)


@router.post("/deployments/{deployment}/end")
async def end_deployment(
    caller: Pilot,
    deployment: str,
    deployments: DeploymentsDep,
    store: StoreDep,
    body: Moment | None = None,
) -> DeploymentView:
    """Say that the robot is out of the water: it is in the workshop from then on."""
    at = None if body is None else body.at
    return await _view(store, await deployments.end(deployment, at, by=caller.name))


@router.post("/deployments/{deployment}/split")
async def split_deployment(
    caller: Pilot, deployment: str, body: Split, deployments: DeploymentsDep, store: StoreDep
) -> SplitView:
    """End a deployment at a moment within it and let another go on from there."""
    first, second = await deployments.split(deployment, body.at, body.name, by=caller.name)
    return SplitView(await _view(store, first), await _view(store, second))


@router.post("/deployments/{deployment}/void")
async def void_deployment(
    caller: Pilot, deployment: str, body: Voiding, deployments: DeploymentsDep, store: StoreDep
) -> DeploymentView:
    """Hide a deployment that was made by mistake; what the robot said then belongs to none.

    Camera pictures that are kept of it are deleted.
    """
    return await _view(store, await deployments.void(deployment, body.reason, by=caller.name))


@router.post("/deployments/{deployment}/review")
async def review_deployment(
    caller: Pilot,
    deployment: str,
    deployments: DeploymentsDep,
    store: StoreDep,
    body: Review | None = None,
) -> DeploymentView:
    """Sign that the data of a recovered deployment were looked at; its times are fixed then."""
    note = "" if body is None else body.note
    return await _view(store, await deployments.review(deployment, note, by=caller.name))


@router.post("/deployments/{deployment}/deliver")
async def deliver_deployment(
    caller: Pilot, deployment: str, body: Delivery, deployments: DeploymentsDep, store: StoreDep
) -> DeploymentView:
    """Note to whom the data of a reviewed deployment were handed over.

    Camera pictures that are kept of it are deleted.
    """
    return await _view(store, await deployments.deliver(deployment, body.to, by=caller.name))


@router.post("/deployments/{deployment}/reopen")
async def reopen_deployment(
    caller: Pilot, deployment: str, body: Reopening, deployments: DeploymentsDep, store: StoreDep
) -> DeploymentView:
    """Take back that a deployment was reviewed, and delivered; files that were made stay."""
    return await _view(store, await deployments.reopen(deployment, body.reason, by=caller.name))


@router.delete("/robots/{robot}/deployment-suggestion")
async def decline_suggestion(
    caller: Pilot, robot: str, fleet: FleetDep, views: FleetViewsDep, suggestions: SuggestionsDep
) -> RobotView:
    """Say "not now" to what the station suggests; it asks again when the robot does otherwise."""
    del caller
    if fleet.status(robot).suggestion is None:
        raise not_found(f"Nothing is suggested of {robot}.")
    suggestions.decline(robot)
    return views.robot_view(robot)


async def _view(store: Store, record: DeploymentRecord) -> DeploymentView:
    return await store.query(lambda session: deployment_view(session, record))
