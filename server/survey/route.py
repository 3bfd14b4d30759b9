"""Surveys that several robots of one site fly together."""

from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import Field

from server.access.dependency import InChargeOf, Pilot, PilotOf
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.view import Body, View
from server.survey.fleet_survey import FleetSurveys
from server.survey.plan_route import PartialConfig

router = APIRouter(prefix="/api", tags=["missions"], route_class=IdempotentRoute)

FleetSurveysDep = Annotated[FleetSurveys, Depends(service(FleetSurveys))]


class SurveyRequest(Body):
    """Which robots of one site shall survey it."""

    robots: list[str] = Field(min_length=1, max_length=16)
    """Ids of the robots that fly it."""
    config: PartialConfig = Field(default_factory=dict)
    automation: bool = False
    """Start by itself as soon as each first round is planned; by default nothing is sent."""


@dataclass(frozen=True, slots=True)
class RobotMissionView(View):
    """What one robot does of a survey."""

    robot: str
    mission: str


@dataclass(frozen=True, slots=True)
class SurveyView(View):
    """The missions that a survey consists of, in the order in which they are planned."""

    missions: list[RobotMissionView]


@router.post("/surveys", status_code=202)
async def create_survey(
    caller: Pilot,
    body: SurveyRequest,
    pilot_of: PilotOf,
    in_charge_of: InChargeOf,
    surveys: FleetSurveysDep,
) -> SurveyView:
    """Begin a survey of several robots, planned in turn against the joint map and each other.

    422 names each robot that does not fit; nothing is begun then.
    """
    await (in_charge_of if body.automation else pilot_of)(body.robots)
    missions = await surveys.create(
        body.robots, body.config, automation=body.automation, by=caller.name
    )
    return SurveyView([RobotMissionView(robot, mission) for robot, mission in missions])
