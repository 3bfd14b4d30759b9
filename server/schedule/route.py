"""Plans that are sent later: asking for it, looking at what waits, and cancelling."""

from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import AwareDatetime

from server.access.dependency import PilotInCharge, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import ClockDep, service
from server.base.view import Body
from server.fleet.fleet import Fleet
from server.fleet.routing import RequestedLink
from server.schedule.condition import Condition
from server.schedule.schedule import DEFAULT_LIFE, Schedule
from server.schedule.view import ScheduledSendView, ScheduleView, send_view

router = APIRouter(prefix="/api", tags=["schedule"], route_class=IdempotentRoute)

ScheduleDep = Annotated[Schedule, Depends(service(Schedule))]
FleetDep = Annotated[Fleet, Depends(service(Fleet))]


class ScheduleRequest(Body):
    """When a draft is to be sent by itself."""

    condition: Condition
    """What it waits for."""
    expires_at: AwareDatetime
    """Nothing is sent after that, by the robots' clock; at most 14 days from now."""
    start: bool = True
    """Whether the robot is told to fly it as soon as it can."""
    route: RequestedLink = "auto"
    """The link that it is to take."""
    confirmed: bool = False
    """Whether to send it although it was made for another place or time by then."""


@router.post("/plans/{plan}/schedule", status_code=201)
async def schedule_plan(
    caller: PilotInCharge, plan: str, body: ScheduleRequest, schedule: ScheduleDep
) -> ScheduledSendView:
    """Have a draft sent at the next surfacing, at a time, on a condition, or after another plan.

    It is a row before it is due and survives a restart of the station. An order to surface purges
    it. It is checked again when it is due, like any plan that a person sends.
    """
    send = await schedule.add(
        plan,
        body.condition,
        expires_at=body.expires_at,
        start=body.start,
        route=body.route,
        confirmed=body.confirmed,
        by=caller.name,
    )
    return send_view(send)


@router.get("/robots/{robot}/schedule")
async def get_schedule(
    caller: Viewer, robot: str, schedule: ScheduleDep, fleet: FleetDep, clock: ClockDep
) -> ScheduleView:
    """Return what waits to be sent to a robot, and what became of the last ones."""
    del caller
    fleet.status(robot)
    sends = [send_view(one) for one in await schedule.of_robot(robot)]
    return ScheduleView(sends, clock.now() + DEFAULT_LIFE)


@router.post("/schedule/{schedule_id}/cancel")
async def cancel_scheduled(
    caller: PilotInCharge, schedule_id: str, schedule: ScheduleDep
) -> ScheduledSendView:
    """Have a plan not sent by itself any more; what is on its way is withdrawn."""
    return send_view(await schedule.cancel(schedule_id, by=caller.name))
