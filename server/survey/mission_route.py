"""Missions: an adaptive survey plans, flies and maps until its budget is spent."""

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query
from pydantic import Field, field_validator

from server.access.dependency import InChargeOf, Pilot, PilotInCharge, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.view import Body
from server.base.work.changes import WaitingDep
from server.base.work.started import Started, StartedView
from server.checklist.gate import Overrule
from server.fleet.dependency import FleetDep
from server.fleet.status import FOLLOW_TARGET
from server.survey.mission_ledger import MissionLedger
from server.survey.plan_route import PartialConfig
from server.survey.surveys import Surveys
from server.survey.view import MissionView

router = APIRouter(prefix="/api", tags=["missions"], route_class=IdempotentRoute)

MissionLedgerDep = Annotated[MissionLedger, Depends(service(MissionLedger))]
SurveysDep = Annotated[Surveys, Depends(service(Surveys))]


class MissionRequest(Body):
    """What a robot is asked to do."""

    kind: Literal["adaptive_survey"]
    """Which mission it is."""
    config: PartialConfig = Field(default_factory=dict)
    automation: bool = False
    """Start by itself as soon as the first round is planned; by default nothing is sent."""

    @field_validator("kind", mode="before")
    @classmethod
    def _is_a_survey(cls, kind: object) -> object:
        if kind == FOLLOW_TARGET:
            raise ValueError(
                "following a target is one plan: POST /api/robots/{robot}/plans with this kind"
            )
        return kind


class StartRequest(Body):
    """How a mission is to be started."""

    overrule: Annotated[str, Field(max_length=500)] = ""
    """Why it is to start although a checklist that the robot's settings require is not complete;
    logged, and shown at its first plan."""


@router.post("/robots/{robot}/missions", status_code=202)
async def create_mission(
    caller: Pilot,
    robot: str,
    body: MissionRequest,
    surveys: SurveysDep,
    in_charge_of: InChargeOf,
    started: Started,
) -> StartedView:
    """Begin a survey: its first round is planned and then waits for `start`."""
    if body.automation:
        await in_charge_of((robot,))
    return started(
        await surveys.create(robot, body.config, automation=body.automation, by=caller.name)
    )


@router.get("/robots/{robot}/missions")
async def list_missions(
    caller: Viewer,
    robot: str,
    fleet: FleetDep,
    missions: MissionLedgerDep,
    before: Annotated[str | None, Query(description="Id to go on before.")] = None,
    limit: Annotated[int, Query(ge=1, le=100)] = 20,
) -> list[MissionView]:
    """Return the missions of a robot, the newest first."""
    del caller
    fleet.status(robot)
    return await missions.views(robot, before, limit)


@router.get("/missions/{mission}")
async def get_mission(
    caller: Viewer, mission: str, missions: MissionLedgerDep, waiting: WaitingDep
) -> MissionView:
    """Return a mission: state, rounds, budget spent as the robot reports it, scores."""
    del caller
    return await waiting.told(
        mission,
        lambda: missions.view(mission),
        has_ended=lambda one: one.state in ("done", "failed", "stopped"),
    )


@router.post("/missions/{mission}/start", status_code=202)
async def start_mission(
    caller: PilotInCharge,
    mission: str,
    surveys: SurveysDep,
    started: Started,
    body: StartRequest | None = None,
) -> StartedView:
    """Send and start the draft, and each further round, until the budget is spent.

    409 lists what is open of a checklist that the robot's settings require.
    """
    reason = "" if body is None else body.overrule.strip()
    overrule = Overrule(reason, caller.name) if reason else None
    await surveys.start(mission, by=caller.name, overrule=overrule)
    return started(mission)


@router.post("/missions/{mission}/stop", status_code=202)
async def stop_mission(
    caller: PilotInCharge, mission: str, surveys: SurveysDep, started: Started
) -> StartedView:
    """End the automation; the draft stays, and the robot finishes the plan that it flies."""
    await surveys.stop(mission, by=caller.name)
    return started(mission)
