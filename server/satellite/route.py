"""What crossed the satellite, and what a plan would cost there."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query

from server.access.dependency import Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.fleet.link_view import SatelliteView
from server.satellite.satellite import Satellite

router = APIRouter(prefix="/api/robots", tags=["links"], route_class=IdempotentRoute)

SatelliteDep = Annotated[Satellite, Depends(service(Satellite))]


@router.get("/{robot}/satellite")
async def get_satellite(
    caller: Viewer,
    robot: str,
    satellite: SatelliteDep,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> SatelliteView:
    """Return a robot's satellite budget and its newest messages, out and in."""
    del caller
    return await satellite.view(robot, limit)
