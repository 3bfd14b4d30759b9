"""Contact windows and suggestions by REST."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query

from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.work.job_view import JobBegun, JobView
from server.schedule.replan.comparison import PlanComparison
from server.schedule.replan.contacts import Contacts
from server.schedule.replan.desk import SuggestionDesk
from server.schedule.replan.suggestions import Suggestions
from server.schedule.replan.view import ComparedPlanView, ContactWindowView, PlanSuggestionView

router = APIRouter(prefix="/api/robots/{robot}", tags=["plans"], route_class=IdempotentRoute)

ContactsDep = Annotated[Contacts, Depends(service(Contacts))]
DeskDep = Annotated[SuggestionDesk, Depends(service(SuggestionDesk))]
ComparisonDep = Annotated[PlanComparison, Depends(service(PlanComparison))]
SuggestionsDep = Annotated[Suggestions, Depends(service(Suggestions))]


@router.get("/contact")
async def get_contact(caller: Viewer, robot: str, contacts: ContactsDep) -> ContactWindowView:
    """Return how long a robot is expected to be in contact, or when it will be again.

    Each moment names what it is reckoned from; what the robot has not said is `null`.
    """
    del caller
    return await contacts.of(robot)


@router.get("/suggestion")
async def get_suggestion(caller: Viewer, robot: str, desk: DeskDep) -> PlanSuggestionView:
    """Return the newest suggestion: a new plan held against what is left of the flown one.

    Its draft is sent as any other, with `POST /api/plans/{plan}/upload`, and waits on board for the
    surfacing. The event `plan.suggested` tells of each verdict.
    """
    del caller
    return await desk.view(robot)


@router.get("/plans/comparison")
async def compare_plans(
    caller: Viewer,
    robot: str,
    comparison: ComparisonDep,
    plan: Annotated[list[str], Query(min_length=1, max_length=8)],
) -> list[ComparedPlanView]:
    """Return what each of some plans would tell of the map, on the same belief, in their order.

    Plans of any kind that has legs: what a person drew stands beside what the planner found.
    """
    del caller
    return await comparison.of(robot, plan)


@router.post("/suggestion", status_code=202)
async def ask_for_suggestion(
    caller: Pilot, robot: str, suggestions: SuggestionsDep, begun: JobBegun
) -> JobView:
    """Begin to search for a better plan, for this surfacing if time allows, else for the next.

    Nothing is sent. 409 says why nothing can be
    suggested: no plan is flown, it has no aim of information, or there is no time.
    """
    return await begun(await suggestions.ask(robot, by=caller.name))
