"""Faults of the demo's robots: which there are, and their causing and undoing."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends

from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.problem import not_found
from server.base.view import View
from server.demo.demo import Demo

router = APIRouter(prefix="/api/demo/faults", tags=["demo"], route_class=IdempotentRoute)

DemoDep = Annotated[Demo, Depends(service(Demo))]


@dataclass(frozen=True, slots=True)
class FaultView(View):
    """A fault that somebody may cause in a simulated robot."""

    robot: str
    name: str
    title: str
    words: str
    """What happens, as a sentence goes on."""
    since: datetime | None
    """When it came; ``null`` while the robot has not got it."""
    by: str
    """Who caused it; empty if the demo was begun with it."""
    needs_hands: bool
    """Whether it can be undone at the surface only."""


@router.get("")
async def list_faults(caller: Viewer, demo: DemoDep) -> list[FaultView]:
    """Return every fault that each simulated robot can have. 404 on a station without a demo."""
    if not demo.is_open:
        raise not_found("This station runs no demo: no fault can be caused.")
    return [
        FaultView(robot, name, fault.title, fault.words, fault.since, fault.by, fault.needs_hands)
        for robot, faults in sorted(demo.robots.items())
        if caller.rights.sees(robot)
        for name, fault in faults.items()
    ]


@router.put("/{robot}/{fault}", status_code=204)
async def cause_fault(caller: Pilot, robot: str, fault: str, demo: DemoDep) -> None:
    """Let a simulated robot have a fault from now on; the event log says who caused it.

    503 while the simulator does not answer.
    """
    await demo.cause(robot, fault, caller.name)


@router.delete("/{robot}/{fault}", status_code=204)
async def mend_fault(caller: Pilot, robot: str, fault: str, demo: DemoDep) -> None:
    """Undo a fault. 409 where hands are needed and the robot is under water."""
    await demo.mend(robot, fault, caller.name)
