"""A job as it is shown, and the answer of every route that begins one."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any

from fastapi import Depends, Request, Response

from db.query.station.jobs import JobRecord
from db.record import same
from server.base.dependency import FoundationDep
from server.base.view import View, one_of
from server.base.work.started import BEGUN, LOCATION, location_of

JOB_RESULT = "x-job-result"
"""Key of an operation in the OpenAPI document: the schema of what its job leaves."""


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
    robot: str | None
    """Whose it is; ``null`` of what is about the station."""
    about: str | None
    """Id of what it works for, where that is kept beside it: a what-if run, an identification, an
    upload."""


def job_view(job: JobRecord) -> JobView:
    """Return a job as it is shown."""
    return same(JobView, job, result=None if job.result is None else dict(job.result))


def leaves(result: type[Any]) -> dict[str, Any]:
    """Return what makes the document of a route say what its job leaves: ``openapi_extra``."""
    return {JOB_RESULT: {"$ref": f"#/components/schemas/{result.__name__}"}}


class JobAnswer:
    """Answers a request that began a job, whichever it is: the job as it stands now."""

    def __init__(self, foundation: FoundationDep, request: Request, response: Response) -> None:
        self._jobs = foundation.jobs
        self._request = request
        self._response = response

    async def __call__(self, job: str) -> JobView:
        """Return the answer, and say where to ask for the job from now on."""
        self._response.headers[LOCATION] = location_of(job)
        setattr(self._request.state, BEGUN, job)
        return job_view(await self._jobs.get(job))


JobBegun = Annotated[JobAnswer, Depends()]
