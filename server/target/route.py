"""What robots that follow a target said of their hold on it."""

from collections.abc import Generator
from typing import Annotated

from fastapi import APIRouter, Query, Response
from fastapi.responses import StreamingResponse
from pydantic import AwareDatetime

from server.access.dependency import Viewer
from server.base.dependency import FoundationDep
from server.base.view import encoded
from server.fleet.dependency import FleetDep
from server.fleet.target_view import TargetReportsView
from server.target.export import target_csv_blocks
from server.target.history import TargetHistory

router = APIRouter(prefix="/api/robots", tags=["tracking"])

PlanQuery = Annotated[
    str | None, Query(description="Only the reports of this plan of kind ``track_target``.")
]


@router.get("/{robot}/tracking", response_model=TargetReportsView)
async def get_tracking(
    caller: Viewer,
    robot: str,
    foundation: FoundationDep,
    fleet: FleetDep,
    plan: PlanQuery = None,
    after: Annotated[
        AwareDatetime | None,
        Query(description="Reports measured after this moment; without it, the newest. RFC 3339."),
    ] = None,
    limit: Annotated[int, Query(ge=1, le=5000)] = 1000,
) -> Response:
    """Return a robot's reports on its target, the oldest first.

    Go on from the ``measured_at`` of the last with ``after``.
    """
    del caller
    fleet.status(robot)
    found = await TargetHistory(foundation.store).reports(robot, plan, after, limit)
    return encoded(found)


@router.get(
    "/{robot}/tracking.csv",
    response_class=Response,
    responses={200: {"content": {"text/csv; charset=utf-8": {}}}},
)
async def export_tracking(
    caller: Viewer,
    robot: str,
    foundation: FoundationDep,
    fleet: FleetDep,
    plan: PlanQuery = None,
) -> Response:
    """Return a robot's reports on its target as CSV; simulated data says so."""
    del caller
    record = fleet.status(robot).record
    store = foundation.store
    wanted = await TargetHistory(store).range_of(robot, plan)
    mark = "SIMULATION_" if record.simulated else ""
    name = f"{mark}{robot}_{plan or 'all'}_tracking.csv"

    def blocks() -> Generator[str]:
        with store.read() as session:
            yield from target_csv_blocks(session, record, wanted)

    return StreamingResponse(
        blocks(),
        media_type="text/csv; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )
