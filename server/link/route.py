"""The links of robots: their state, and whether they may be used."""

from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import Field

from server.access.dependency import PilotInCharge, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.problem import not_found
from server.base.view import Body
from server.fleet.dependency import FleetDep
from server.fleet.disabled_links import DisabledLinks
from server.fleet.link_panel import link_views
from server.fleet.link_view import RobotLinkView

router = APIRouter(prefix="/api/robots", tags=["links"], route_class=IdempotentRoute)

DisabledLinksDep = Annotated[DisabledLinks, Depends(service(DisabledLinks))]


class PlugRequest(Body):
    """Which link to enable or to disable."""

    uri: str = Field(max_length=500)
    """The link, as the robot has it."""
    plugged: bool
    """Whether the station may use it from now on."""


@router.get("/{robot}/links")
async def get_links(caller: Viewer, robot: str, fleet: FleetDep) -> list[RobotLinkView]:
    """Return every link of a robot: its state, its age, and what it carries."""
    del caller
    return link_views(fleet.status(robot))


@router.post("/{robot}/links/plug")
async def enable_link(
    caller: PilotInCharge,
    robot: str,
    body: PlugRequest,
    disabled_links: DisabledLinksDep,
    fleet: FleetDep,
) -> list[RobotLinkView]:
    """Enable or disable a link; robots that share a radio share that.

    Nothing is sent by a disabled satellite link, and its gateway is asked to keep what comes.
    """
    if body.uri not in fleet.status(robot).record.links:
        raise not_found(f"{robot} has no link {body.uri!r}.")
    await disabled_links.set(body.uri, is_enabled=body.plugged, robot=robot, by=caller.name)
    return link_views(fleet.status(robot))
