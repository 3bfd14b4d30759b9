"""Missions of waypoints, for vehicles of other makers."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import Field

from db.record import same
from server.access.dependency import Pilot, PilotInCharge, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.view import Body, View, one_of
from server.base.work.job_view import JobBegun, JobView
from server.link.waypoints import Waypoint, WaypointMission, Waypoints

router = APIRouter(
    prefix="/api/robots/{robot}/waypoints", tags=["on board"], route_class=IdempotentRoute
)

WaypointsDep = Annotated[Waypoints, Depends(service(Waypoints))]


class WaypointBody(Body):
    """A place to go to."""

    north_m: float = Field(ge=-1e6, le=1e6)
    """In the water's frame."""
    east_m: float = Field(ge=-1e6, le=1e6)
    """East of the origin of the robot's water, m."""
    depth_m: float = Field(ge=-1e4, le=1e4)
    """Below the surface."""
    hold_s: float = Field(default=0.0, ge=0.0, le=36_000.0)
    """How long it stays there."""


class WaypointsBody(Body):
    """A mission in the order in which it is flown."""

    waypoints: list[WaypointBody] = Field(min_length=1, max_length=500)
    """Where it goes, in order."""


@dataclass(frozen=True, slots=True)
class WaypointView(View):
    """A place to go to, or another item of a vehicle's mission."""

    north_m: float
    east_m: float
    depth_m: float
    hold_s: float
    command: str
    """``waypoint``, or what else the item asks for."""


@dataclass(frozen=True, slots=True)
class WaypointsView(View):
    """What is known of a vehicle's mission."""

    state: Annotated[str, one_of("none", "uploading", "on_board", "refused", "unknown")]
    """``on_board`` only once every item was read back and is the one that was sent."""
    message: str
    """All of that in words."""
    item: int | None
    """The waypoint that was refused, from 1."""
    waypoints: list[WaypointView]
    """Those that were sent last."""
    sha256: str
    """Of the items as they were sent: the station's own, a standard vehicle cannot echo it."""
    proved_at: datetime | None
    on_vehicle: list[WaypointView]
    """The mission on board as it was read last."""
    read_at: datetime | None


@router.get("")
async def get_waypoints(caller: Viewer, robot: str, waypoints: WaypointsDep) -> WaypointsView:
    """Return what is known of the vehicle's mission."""
    del caller
    return _view(await waypoints.of(robot))


@router.put("", status_code=202)
async def put_waypoints(
    caller: PilotInCharge, robot: str, body: WaypointsBody, waypoints: WaypointsDep, begun: JobBegun
) -> JobView:
    """Put a mission on board and prove it by reading it back."""
    wanted = [same(Waypoint, one) for one in body.waypoints]
    return await begun(await waypoints.upload(robot, wanted, by=caller.name))


@router.post("/read", status_code=202)
async def read_waypoints(
    caller: Pilot, robot: str, waypoints: WaypointsDep, begun: JobBegun
) -> JobView:
    """Read the mission on board."""
    return await begun(await waypoints.read(robot, by=caller.name))


def _view(mission: WaypointMission) -> WaypointsView:
    return same(
        WaypointsView,
        mission,
        waypoints=[same(WaypointView, one) for one in mission.waypoints],
        on_vehicle=[same(WaypointView, one) for one in mission.on_vehicle],
    )
