"""Plans: made by the planner or laid out by hand, checked, sent, followed."""

from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Depends, Query

from db.query.mission.plans import PlanRecord, list_plans
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import DeploymentDep, StoreDep, period_of, service
from server.base.view import View
from server.base.work.started import CalculationStarted, Started, StartedView
from server.fleet.dependency import FleetDep
from server.plan.document import plan_summary
from server.plan.planning import Planning
from server.plan.view import PlanSummaryView, ViolationView

router = APIRouter(prefix="/api", tags=["plans"], route_class=IdempotentRoute)

PlanningDep = Annotated[Planning, Depends(service(Planning))]


@dataclass(frozen=True, slots=True)
class CheckView(View):
    """What speaks against flying a plan now."""

    plan_id: str
    violations: list[ViolationView]


@router.get("/robots/{robot}/plans")
async def list_robot_plans(
    caller: Viewer,
    robot: str,
    store: StoreDep,
    fleet: FleetDep,
    deployment: DeploymentDep,
    state: Annotated[str | None, Query(description="Plans in this state only.")] = None,
    before: Annotated[str | None, Query(description="Id to go on before.")] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 50,
) -> list[PlanSummaryView]:
    """Return the plans of a robot, the newest first, without legs and points."""
    del caller
    fleet.status(robot)
    states = None if state is None else (state,)
    period = period_of(deployment, robot)
    plans = await store.query(
        lambda session: list_plans(
            session, robot=robot, states=states, period=period, before=before, limit=limit
        )
    )
    return [plan_summary(plan) for plan in plans]


@router.post("/plans/{plan}/cancel", status_code=202)
async def cancel_plan(
    caller: Pilot, plan: str, planning: PlanningDep, started: Started
) -> StartedView:
    """Stop planning, or throw a draft away; a plan that has left the station is not cancelled."""
    del caller
    record: PlanRecord = await planning.cancel(plan)
    return started(record.id)


@router.post("/plans/{plan}/rehearse", status_code=202)
async def rehearse_plan(
    caller: Pilot, plan: str, planning: PlanningDep, started: CalculationStarted
) -> StartedView:
    """Fly a draft ahead again, however long that takes; 409 for a plan that is no draft."""
    del caller
    record = await planning.rehearse(plan)
    return started(record.id)


@router.post("/plans/{plan}/check")
async def check_plan(caller: Pilot, plan: str, planning: PlanningDep) -> CheckView:
    """Check a plan: the limits that it breaks, and what changed since it was made."""
    del caller
    return CheckView(plan, await planning.check(plan))
