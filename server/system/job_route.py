"""Long work: how far it is, what came of it, and calling it off."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Query

from db.query.station.jobs import JobRecord
from db.query.station.jobs import list_jobs as query_jobs
from db.record import same
from server.access.dependency import Pilot, Viewer
from server.base.dependency import FoundationDep
from server.base.view import View, one_of

router = APIRouter(prefix="/api/jobs", tags=["jobs"])


@dataclass(frozen=True, slots=True)
class JobView(View):
    """One piece of long work."""

    id: str
    kind: str
    state: Annotated[str, one_of("queued", "running", "done", "failed", "cancelled")]
    """``queued``, ``running``, ``done``, ``failed`` or ``cancelled``."""
    progress: float
    """0 to 1."""
    message: str
    result: dict[str, Any] | None
    created_at: datetime
    ended_at: datetime | None


@dataclass(frozen=True, slots=True)
class JobsView(View):
    """Jobs, the newest first."""

    jobs: list[JobView]


@router.get("")
async def list_jobs(
    caller: Viewer,
    foundation: FoundationDep,
    before: Annotated[str | None, Query(description="Id to go on before.")] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> JobsView:
    """Return jobs, the newest first."""
    seen = caller.rights.robots
    records = await foundation.store.query(
        lambda session: query_jobs(session, robots=seen, before=before, limit=limit)
    )
    running = {job.id: job for job in foundation.jobs.running}
    return JobsView([job_view(running.get(record.id, record)) for record in records])


@router.get("/{job}")
async def get_job(caller: Viewer, job: str, foundation: FoundationDep) -> JobView:
    """Return one job with its newest progress."""
    del caller
    return job_view(await foundation.jobs.get(job))


@router.delete("/{job}")
async def cancel_job(caller: Pilot, job: str, foundation: FoundationDep) -> JobView:
    """Call a running job off; the answer comes when it has stopped."""
    del caller
    return job_view(await foundation.jobs.cancel(job))


def job_view(job: JobRecord) -> JobView:
    """Return a job as it is shown."""
    return same(JobView, job, result=None if job.result is None else dict(job.result))
