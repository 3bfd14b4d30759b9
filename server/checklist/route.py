"""A robot's checklists: looked at, begun, ticked, completed, overruled."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query
from pydantic import Field

from server.access.dependency import Pilot, PilotInCharge, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.view import Body
from server.checklist.checklists import Checklists
from server.checklist.overview import Overview
from server.checklist.view import PastChecklistView, RobotChecklistsView
from server.fleet.dependency import FleetDep

router = APIRouter(prefix="/api", tags=["checklists"], route_class=IdempotentRoute)

ChecklistsDep = Annotated[Checklists, Depends(service(Checklists))]
OverviewDep = Annotated[Overview, Depends(service(Overview))]
Reason = Annotated[str, Field(min_length=3, max_length=500, pattern=r"\S")]


class NewChecklist(Body):
    """Which list is begun."""

    template: Annotated[str, Field(max_length=40)]
    """Key of the list that a robot begins."""


class ChecklistTick(Body):
    """An item that is ticked, or unticked."""

    item: Annotated[str, Field(max_length=40)]
    """Key of the item."""
    ticked: bool = True
    """Whether it was looked at and is well; false takes a tick back."""
    note: Annotated[str, Field(max_length=300)] = ""
    """What is said of it; empty for nothing."""


class ChecklistOverrule(Body):
    """Why plans may be started although blocking items are open."""

    reason: Reason
    """Why the plan may start all the same; it is logged and shown at the plan."""


@router.get("/robots/{robot}/checklists")
async def get_checklists(caller: Viewer, robot: str, overview: OverviewDep) -> RobotChecklistsView:
    """Return the lists of a robot with what its automatic items find now, and found yesterday."""
    del caller
    return await overview.of_robot(robot)


@router.get("/robots/{robot}/checklists/past")
async def list_past(
    caller: Viewer,
    robot: str,
    overview: OverviewDep,
    fleet: FleetDep,
    before: Annotated[str | None, Query(description="Id to go on before.")] = None,
    limit: Annotated[int, Query(ge=1, le=100)] = 20,
) -> list[PastChecklistView]:
    """Return the runs through a robot's lists as they were, the newest first."""
    del caller
    fleet.status(robot)
    return await overview.past(robot, before, limit)


@router.post("/robots/{robot}/checklists", status_code=201)
async def begin_checklist(
    caller: Pilot, robot: str, body: NewChecklist, checklists: ChecklistsDep, overview: OverviewDep
) -> RobotChecklistsView:
    """Begin a run through a list; 409 if one is open, or the list is not for this robot."""
    await checklists.begin(robot, body.template, by=caller.name)
    return await overview.of_robot(robot)


@router.post("/checklists/{checklist}/ticks", status_code=201)
async def tick_item(
    caller: Pilot,
    checklist: str,
    body: ChecklistTick,
    checklists: ChecklistsDep,
    overview: OverviewDep,
) -> RobotChecklistsView:
    """Tick an item with your name and the time, or untick it; what was ticked before is kept."""
    record = await checklists.tick(
        checklist, body.item, is_ticked=body.ticked, note=body.note.strip(), by=caller.name
    )
    return await overview.of_robot(record.robot)


@router.post("/checklists/{checklist}/complete")
async def complete_checklist(
    caller: Pilot, checklist: str, checklists: ChecklistsDep, overview: OverviewDep
) -> RobotChecklistsView:
    """Complete a list, which keeps its values as they are; 409 names each open blocking item."""
    record = await checklists.complete(checklist, by=caller.name)
    return await overview.of_robot(record.robot)


@router.post("/checklists/{checklist}/overrule")
async def overrule_checklist(
    caller: PilotInCharge,
    checklist: str,
    body: ChecklistOverrule,
    checklists: ChecklistsDep,
    overview: OverviewDep,
) -> RobotChecklistsView:
    """Let plans start although blocking items are open; the reason is logged.

    What turns bad after that blocks again.
    """
    record = await checklists.overrule(checklist, body.reason.strip(), by=caller.name)
    return await overview.of_robot(record.robot)
