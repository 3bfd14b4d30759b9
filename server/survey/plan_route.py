"""Plans are asked for here, whatever their kind, and drafts exchanged for others."""

from typing import Annotated, Literal, Self

from fastapi import APIRouter, Depends
from pydantic import Field, model_validator

from autonomy.planner.plan import PrimitiveKind
from server.access.dependency import Pilot
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.view import Body, SettingsDocument
from server.base.work.started import CalculationStarted, StartedView
from server.plan.planning import Planning
from server.plan.primitive_legs import LegRequest
from server.plan.search.request import SearchRequest
from server.survey.plan_choice import PlanChoices
from server.survey.surveys import Surveys
from server.target.planning import TargetPlanning
from server.target.settings import Base

router = APIRouter(prefix="/api", tags=["plans"], route_class=IdempotentRoute)

PlanChoicesDep = Annotated[PlanChoices, Depends(service(PlanChoices))]
PlanningDep = Annotated[Planning, Depends(service(Planning))]
SurveysDep = Annotated[Surveys, Depends(service(Surveys))]
TargetPlanningDep = Annotated[TargetPlanning, Depends(service(TargetPlanning))]

PartialConfig = Annotated[
    SettingsDocument,
    Field(
        description="Fields of the planner's configuration that differ from what holds for the "
        "robot; see `GET /api/config/planner/schema`. They become its new version."
    ),
]


class SurveyPlanRequest(Body):
    """One round of a survey, to be searched for by the planner."""

    kind: Literal["adaptive_survey"]
    """An adaptive survey."""
    config: PartialConfig = Field(default_factory=dict)
    mission: str | None = None
    """A mission that waits for its start: the plan takes the place of its newest draft."""
    keep_settings: bool = True
    """Whether the settings hold for the robot's later plans too, as those of a mission do."""

    @model_validator(mode="after")
    def _keeps_what_a_mission_flies_by(self) -> Self:
        if self.mission is not None and not self.keep_settings:
            raise ValueError("a mission keeps its settings: leave keep_settings out")
        return self


FAR_M = 1e6
"""Nothing of a plan is farther from anything else."""
Place = Annotated[float, Field(ge=-FAR_M, le=FAR_M)]
Turn = Annotated[float, Field(ge=-1e4, le=1e4)]


class LegBody(Body):
    """One motion primitive; it starts where the one before ended."""

    kind: PrimitiveKind
    """How it is flown."""
    end_ned: tuple[Place, Place, Place]
    """North, east, depth. Of a dive or spiral only the depth counts, of a stay at the surface
    nothing: it keeps where the leg before ended."""
    speed_m_s: float | None = Field(default=None, gt=0.0, le=5.0)
    """Vertical speed, of a swim the speed over ground; by default the planner's."""
    heading_rad: Turn = 0.0
    """Heading at which a spiral is entered."""
    radius_m: float = Field(default=0.0, ge=0.0, le=FAR_M)
    """Radius of a spiral, or of a stay at the surface."""
    turn_rad: Turn = 0.0
    """Angle that a spiral turns through, positive to starboard."""
    duration_s: float = Field(default=0.0, ge=0.0, le=604_800.0)
    """How long it stays at the surface."""


class PrimitivesPlanRequest(Body):
    """Legs laid out by hand, from where the robot is."""

    kind: Literal["primitives"]
    """A plan of legs that are given."""
    legs: list[LegBody] = Field(min_length=1, max_length=500)
    """What is flown, in order."""
    config: PartialConfig = Field(default_factory=dict)


class TargetPlanRequest(Body):
    """A target that the robot is to follow by its range alone."""

    kind: Literal["track_target"]
    """A plan that follows a target."""
    config: Annotated[
        SettingsDocument,
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


@router.post("/robots/{robot}/plans", status_code=202)
async def create_plan(
    caller: Pilot,
    robot: str,
    body: PlanRequest,
    planning: PlanningDep,
    surveys: SurveysDep,
    targets: TargetPlanningDep,
    started: CalculationStarted,
) -> StartedView:
    """Begin a plan: 409 or 422 at once if it cannot be made, else it becomes a draft or fails."""
    if isinstance(body, SurveyPlanRequest) and body.mission is not None:
        plan = await surveys.plan_again(robot, body.mission, body.config, by=caller.name)
        return started(plan.id)
    if isinstance(body, TargetPlanRequest):
        plan = await targets.plan(robot, body.config, by=caller.name, base=body.base)
        return started(plan.id)
    if isinstance(body, SurveyPlanRequest) and not body.keep_settings:
        config = await planning.settings.merged(robot, body.config)
        plan = await planning.plan_survey(SearchRequest(robot, config, None, by=caller.name))
        return started(plan.id)
    config_id, config = await planning.configure(robot, body.config, by=caller.name)
    if isinstance(body, PrimitivesPlanRequest):
        legs = [
            LegRequest(
                leg.kind,
                leg.end_ned,
                leg.speed_m_s,
                leg.heading_rad,
                leg.radius_m,
                leg.turn_rad,
                leg.duration_s,
            )
            for leg in body.legs
        ]
        plan = await planning.plan_primitives(robot, config, config_id, legs, by=caller.name)
    else:
        plan = await planning.plan_survey(SearchRequest(robot, config, config_id, by=caller.name))
    return started(plan.id)


@router.post("/plans/{plan}/choose", status_code=202)
async def choose_runner_up(
    caller: Pilot,
    plan: str,
    body: ChoiceRequest,
    choices: PlanChoicesDep,
    started: CalculationStarted,
) -> StartedView:
    """Make a draft of a runner-up; the old draft stays one until then, and is then superseded."""
    record = await choices.choose(plan, body.runner_up, by=caller.name)
    return started(record.id)


@router.post("/plans/{plan}/continue", status_code=202)
async def continue_search(
    caller: Pilot,
    plan: str,
    choices: PlanChoicesDep,
    started: CalculationStarted,
    body: ContinueRequest | None = None,
) -> StartedView:
    """Search on from a draft and its runners-up; the old draft stays until the new one is found."""
    wanted = body or ContinueRequest()
    record = await choices.go_on(plan, wanted.planning_time_s, by=caller.name)
    return started(record.id)
