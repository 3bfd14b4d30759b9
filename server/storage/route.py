"""What the station keeps, and what becomes of it."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query
from pydantic import AwareDatetime

from db.query.storage.told import pruned_stretches
from robot_link.storage_config import StorageConfig
from server.access.dependency import Admin, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import FoundationDep, StoreDep, service
from server.base.view import SettingsPatch
from server.base.work.job_view import JobBegun, JobView, leaves
from server.storage.passes import Passes
from server.storage.result import StoragePassResult, StoragePreviewResult
from server.storage.sizes import Sizes
from server.storage.view import (
    PrunedStretchView,
    StoredSizesView,
    storage_view,
    stretch_view,
)

router = APIRouter(prefix="/api", tags=["storage"], route_class=IdempotentRoute)

SizesDep = Annotated[Sizes, Depends(service(Sizes))]
PassesDep = Annotated[Passes, Depends(service(Passes))]
Start = Annotated[AwareDatetime | None, Query(description="First moment; RFC 3339.")]
End = Annotated[AwareDatetime | None, Query(description="Last moment; RFC 3339.")]


@router.get("/storage")
async def get_storage(
    caller: Viewer, sizes: SizesDep, passes: PassesDep, store: StoreDep
) -> StoredSizesView:
    """Return how much there is of everything, by the newest look, and what went when."""
    del caller
    pruned = await store.query(pruned_stretches)
    return storage_view(sizes, passes, pruned)


@router.post("/storage/preview", status_code=202, openapi_extra=leaves(StoragePreviewResult))
async def preview_storage(
    caller: Admin,
    rules: SettingsPatch,
    foundation: FoundationDep,
    passes: PassesDep,
    begun: JobBegun,
) -> JobView:
    """Look at what would go, and change nothing; the job's result has it by robot and deployment.

    The rules are those that hold, with the fields of the body on top, which are those of
    `PATCH /api/config/storage`; an empty body looks by the rules that hold. 409 while another look
    is under way.
    """
    merged = await foundation.configurations.merged("storage", None, rules.root)
    config = merged.value_as(StorageConfig)
    return await begun(await passes.preview(config, by=caller.name))


@router.post("/storage/passes", status_code=202, openapi_extra=leaves(StoragePassResult))
async def start_pass(caller: Admin, passes: PassesDep, begun: JobBegun) -> JobView:
    """Thin, move and delete at once what is due by the rules that hold.

    Answers with the job of the pass under way if there is one. What was done stays done when the
    job is cancelled; the next pass goes on.
    """
    return await begun(await passes.start(by=caller.name))


@router.get("/robots/{robot}/pruned")
async def get_pruned(
    caller: Viewer, robot: str, store: StoreDep, start: Start = None, end: End = None
) -> list[PrunedStretchView]:
    """Return what of a robot is no longer all there, the oldest first; whole days of UTC."""
    del caller
    found = await store.query(
        lambda session: pruned_stretches(session, robot, start=start, end=end)
    )
    return [stretch_view(one) for one in found]
