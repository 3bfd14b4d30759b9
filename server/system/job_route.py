"""Long work: how far it is, what came of it, and calling it off."""

from dataclasses import dataclass
from typing import Annotated, Literal

from fastapi import APIRouter, Query

from db.query.station.jobs import OPEN_STATES
from db.query.station.jobs import list_jobs as query_jobs
from server.access.dependency import Pilot, Viewer
from server.base.dependency import FoundationDep
from server.base.view import View
from server.base.work.changes import WaitingDep
from server.base.work.job_view import JobView, job_view

router = APIRouter(prefix="/api/jobs", tags=["jobs"])


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
async def get_job(
    caller: Viewer,
    job: str,
    foundation: FoundationDep,
    waiting: WaitingDep,
    until: Annotated[
        Literal["change", "end"], Query(description="What `wait_s` waits for.")
    ] = "change",
) -> JobView:
    """Return one job with its newest progress; with `wait_s`, once it got further or ended."""
    del caller

    async def look() -> JobView:
        return job_view(await foundation.jobs.get(job))

    return await waiting.told(
        job, look, has_ended=_has_ended, is_news=_has_ended if until == "end" else _is_news
    )


@router.delete("/{job}")
async def cancel_job(caller: Pilot, job: str, foundation: FoundationDep) -> JobView:
    """Call a running job off; the answer comes when it has stopped."""
    del caller
    return job_view(await foundation.jobs.cancel(job))


def _has_ended(job: JobView) -> bool:
    return job.state not in OPEN_STATES


def _is_news(job: JobView) -> bool:
    del job
    return True
