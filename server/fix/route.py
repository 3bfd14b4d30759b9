"""Fixes by cameras, and tags that nobody knows."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query
from pydantic import AwareDatetime
from sqlalchemy.orm import Session

from db.query.camera.fixes import list_fixes
from server.access.dependency import Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import FoundationDep, service
from server.base.problem import FieldError, unprocessable
from server.fix.fusion import Fusion
from server.fix.view import FixesView, FixView, StrangerView, fix_view
from server.fleet.dependency import FleetDep

router = APIRouter(tags=["cameras"], route_class=IdempotentRoute)

FusionDep = Annotated[Fusion, Depends(service(Fusion))]
Moment = Annotated[AwareDatetime | None, Query(description="RFC 3339; by default no limit.")]


@router.get("/api/robots/{robot}/fixes")
async def list_robot_fixes(
    caller: Viewer,
    robot: str,
    fleet: FleetDep,
    foundation: FoundationDep,
    fusion: FusionDep,
    start: Moment = None,
    end: Moment = None,
    max_points: Annotated[int, Query(ge=1, le=10_000)] = 1000,
) -> FixesView:
    """Return where cameras found a robot, the refused fixes too; of too many each so many-th."""
    del caller
    record = fleet.status(robot).record
    if start is not None and end is not None and start > end:
        fault = FieldError(loc=["query", "start"], msg="must not be after end")
        raise unprocessable("1 field is wrong.", [fault])

    def read(session: Session) -> list[FixView]:
        found = list_fixes(session, robot, start, end, max_points=max_points)
        return [fix_view(one) for one in found]

    fixes = await foundation.store.query(read)
    sight = fusion.sight(robot)
    refused = {} if sight is None else dict(sight.refused)
    return FixesView(robot, fixes, refused, foundation.settings.simulation or record.simulated)


@router.get("/api/tags/strangers")
async def list_strangers(caller: Viewer, fusion: FusionDep) -> list[StrangerView]:
    """Return tags that cameras saw since the station began and that nobody knows."""
    del caller
    return [
        StrangerView(one.tag, one.camera, one.seen_at)
        for one in sorted(fusion.strangers.values(), key=lambda one: one.tag)
    ]
