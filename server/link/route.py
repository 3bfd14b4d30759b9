"""The links of robots: their state, their plugs, and what crossed the satellite."""

from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import Field

from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.body import Body
from server.fleet.link_panel import link_views
from server.fleet.link_view import RobotLinkView, SatelliteView
from server.station_dependency import StationDep

router = APIRouter(prefix="/api/robots", tags=["links"], route_class=IdempotentRoute)


class PlugRequest(Body):
    """Which plug to pull or to put back."""

    uri: str = Field(max_length=500)
    """The link, as the robot has it."""
    plugged: bool
    """Whether the station may use it from now on."""


@router.get("/{robot}/links")
async def get_links(caller: Viewer, robot: str, station: StationDep) -> list[RobotLinkView]:
    """Return every link of a robot: its state, its age, and what it carries."""
    del caller
    return link_views(station.fleet.status(robot))


@router.post("/{robot}/links/plug")
async def enable_link(
    caller: Pilot, robot: str, body: PlugRequest, station: StationDep
) -> list[RobotLinkView]:
    """Pull the plug of a link, or put it back; robots that share a radio share its plug.

    Nothing is sent by an unplugged satellite link, and its gateway is asked to keep what comes.
    """
    await station.set_enabled(robot, body.uri, is_enabled=body.plugged, by=caller.name)
    return link_views(station.fleet.status(robot))


@router.get("/{robot}/satellite")
async def get_satellite(
    caller: Viewer,
    robot: str,
    station: StationDep,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> SatelliteView:
    """Return a robot's satellite budget and its newest messages, out and in."""
    del caller
    return await station.satellite.view(robot, limit)
