"""Plans: made by the planner or laid out by hand, checked, sent, followed."""

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from pydantic import Field

from autonomy.planner.plan import PrimitiveKind
from db.query.plans import PlanRecord, list_plans
from server.access.dependency import Pilot, StoreDep, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.body import Body
from server.base.view import View
from server.plan.document import plan_summary
from server.plan.primitive_legs import LegRequest
from server.plan.search_request import SearchRequest
from server.plan.view import PlanSummaryView, PlanView, ViolationView
from server.station_dependency import StationDep
from server.target.settings import Base

router = APIRouter(prefix="/api", tags=["plans"], route_class=IdempotentRoute)

PartialConfig = Annotated[
    dict[str, Any],
    Field(
        description="Fields of the planner's configuration that differ from what holds for the "
        "robot; see `GET /api/config/planner/schema`. They become its new version."
    ),
]


class SurveyPlanRequest(Body):
    """One round of a survey, to be searched for by the planner."""

    kind: Literal["adaptive_survey"]
    config: PartialConfig = Field(default_factory=dict)
    mission: str | None = None
    """A mission that waits for its start: the plan takes the place of its newest draft."""


class LegBody(Body):
    """One motion primitive; it starts where the one before ended."""

    kind: PrimitiveKind
    end_ned: tuple[float, float, float]
    """North, east, depth. Of a dive or spiral only the depth counts."""
    speed_m_s: float | None = Field(default=None, gt=0.0, le=5.0)
    """Vertical speed, of a swim the speed over ground; by default the planner's."""
    heading_rad: float = 0.0
    """Heading at which a spiral is entered."""
    radius_m: float = Field(default=0.0, ge=0.0)
    """Radius of a spiral."""
    turn_rad: float = 0.0
    """Angle that a spiral turns through, positive to starboard."""


class PrimitivesPlanRequest(Body):
    """Legs laid out by hand, from where the robot is."""

    kind: Literal["primitives"]
    legs: list[LegBody] = Field(min_length=1, max_length=500)
    config: PartialConfig = Field(default_factory=dict)


class TargetPlanRequest(Body):
    """A target that the robot is to follow by its range alone."""

    kind: Literal["track_target"]
    config: Annotated[
        dict[str, Any],
        Field(
            description="Fields of the tracking configuration that differ from what holds for the "
            "robot; see `GET /api/config/tracking/schema`. They become its new version."
        ),
    ] = Field(default_factory=dict)
    base: Base = "kept"
    """What they are laid over: ``kept``, the settings of the robot's last plan, whoever made it, or
    the ``preset`` of its vehicle."""


PlanRequest = Annotated[
    SurveyPlanRequest | PrimitivesPlanRequest | TargetPlanRequest, Field(discriminator="kind")
]


class ChoiceRequest(Body):
    """Which of a draft's runners-up shall take its place."""

    runner_up: int = Field(ge=0)
    """Position in the draft's list of runners-up."""


class ContinueRequest(Body):
    """How long to search on."""

    planning_time_s: float | None = Field(default=None, gt=0.0, le=600.0)
    """By default as long as the draft's own search."""


@dataclass(frozen=True, slots=True)
class PlanIdView(View):
    """Where to ask how the plan fares."""

    id: str


@dataclass(frozen=True, slots=True)
class CheckView(View):
    """What speaks against flying a plan now."""

    plan_id: str
    violations: list[ViolationView]


@router.post("/robots/{robot}/plans", status_code=202)
async def create_plan(
    caller: Pilot, robot: str, body: PlanRequest, station: StationDep
) -> PlanIdView:
    """Begin a plan: 409 or 422 at once if it cannot be made, else it becomes a draft or fails."""
    if isinstance(body, SurveyPlanRequest) and body.mission is not None:
        plan = await station.surveys.plan_again(robot, body.mission, body.config, by=caller.name)
        return PlanIdView(plan.id)
    if isinstance(body, TargetPlanRequest):
        plan = await station.tracks.plan(robot, body.config, by=caller.name, base=body.base)
        return PlanIdView(plan.id)
    config_id, config = await station.planning.configure(robot, body.config, by=caller.name)
    if isinstance(body, PrimitivesPlanRequest):
        legs = [
            LegRequest(
                leg.kind, leg.end_ned, leg.speed_m_s, leg.heading_rad, leg.radius_m, leg.turn_rad
            )
            for leg in body.legs
        ]
        plan = await station.planning.plan_primitives(
            robot, config, config_id, legs, by=caller.name
        )
    else:
        plan = await station.planning.plan_survey(
            SearchRequest(robot, config, config_id, by=caller.name)
        )
    return PlanIdView(plan.id)


@router.get("/robots/{robot}/plans")
async def list_robot_plans(
    caller: Viewer,
    robot: str,
    store: StoreDep,
    station: StationDep,
    state: Annotated[str | None, Query(description="Plans in this state only.")] = None,
    before: Annotated[str | None, Query(description="Id to go on before.")] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 50,
) -> list[PlanSummaryView]:
    """Return the plans of a robot, the newest first, without legs and points."""
    del caller
    station.fleet.status(robot)
    states = None if state is None else (state,)
    plans = await store.query(
        lambda session: list_plans(session, robot=robot, states=states, before=before, limit=limit)
    )
    return [plan_summary(plan) for plan in plans]


@router.get("/plans/{plan}")
async def get_plan(caller: Viewer, plan: str, station: StationDep) -> PlanView:
    """Return a plan: its legs, its account, what it breaks, and where it is on its way."""
    del caller
    view = station.plans.view(await station.plans.get(plan))
    return replace(view, transfer=await station.transfers.view_of_plan(plan))


@router.post("/plans/{plan}/cancel", status_code=202)
async def cancel_plan(caller: Pilot, plan: str, station: StationDep) -> PlanIdView:
    """Stop planning, or throw a draft away; a plan that has left the station is not cancelled."""
    del caller
    record: PlanRecord = await station.planning.cancel(plan)
    return PlanIdView(record.id)


@router.post("/plans/{plan}/choose", status_code=202)
async def choose_runner_up(
    caller: Pilot, plan: str, body: ChoiceRequest, station: StationDep
) -> PlanIdView:
    """Make a draft of a runner-up; the old draft stays one until then, and is then superseded."""
    record = await station.choices.choose(plan, body.runner_up, by=caller.name)
    return PlanIdView(record.id)


@router.post("/plans/{plan}/continue", status_code=202)
async def continue_search(
    caller: Pilot, plan: str, station: StationDep, body: ContinueRequest | None = None
) -> PlanIdView:
    """Search on from a draft and its runners-up; the old draft stays until the new one is found."""
    wanted = body or ContinueRequest()
    record = await station.choices.go_on(plan, wanted.planning_time_s, by=caller.name)
    return PlanIdView(record.id)


@router.post("/plans/{plan}/check")
async def check_plan(caller: Pilot, plan: str, station: StationDep) -> CheckView:
    """Check a plan: the limits that it breaks, and what changed since it was made."""
    del caller
    return CheckView(plan, await station.planning.check(plan))
