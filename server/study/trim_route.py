"""Trim: advice from the last dives, accepted by a person in steps."""

from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import Field, field_validator

from server.access.dependency import Pilot, PilotInCharge
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.view import Body
from server.base.work.job_view import JobBegun, JobView, leaves
from server.study.trim import STEPS, TrimAdvices
from server.study.view import TrimAdviceView, TrimView

router = APIRouter(prefix="/api/robots/{robot}/trim", tags=["trim"], route_class=IdempotentRoute)

TrimAdvicesDep = Annotated[TrimAdvices, Depends(service(TrimAdvices))]


class AdviceRequest(Body):
    """Which dives are to be held against the model."""

    deployment: str | None = None
    """A deployment of the robot; by default the newest."""
    dives: int = Field(default=10, ge=1, le=1000)
    """How many of its last dives count."""


class TrimAcceptance(Body):
    """How much of an advice is taken."""

    advice: str
    """Id of the advice, such as ``advice-2``."""
    share: float = Field(default=0.5, json_schema_extra={"enum": list(STEPS)})
    """Half of the step, as pilots do, or all of it."""

    @field_validator("share")
    @classmethod
    def _is_a_step(cls, share: float) -> float:
        if share not in STEPS:
            raise ValueError("must be 0.5 or 1")
        return share


@router.post("/advice", status_code=202, openapi_extra=leaves(TrimAdviceView))
async def start_advice(
    caller: Pilot,
    robot: str,
    trim: TrimAdvicesDep,
    begun: JobBegun,
    body: AdviceRequest | None = None,
) -> JobView:
    """Work out by how much the trim is off.

    The job's result is the advice with its `id`: the errors now and after the change, the offsets
    after half a step and after a whole one, and whether that is worth it. The job fails in words
    where there is too little steady gliding.
    """
    wish = body or AdviceRequest()
    job = await trim.start(robot, wish.deployment, wish.dives, by=caller.name)
    return await begun(job)


@router.post("/accept")
async def accept_advice(
    caller: PilotInCharge, robot: str, body: TrimAcceptance, trim: TrimAdvicesDep
) -> TrimView:
    """Change the trim by half of an advice's step, or all of it; the answer says when it arrives.

    409 if the trim was changed since the advice, or the advice was accepted already.
    """
    return await trim.accept(robot, body.advice, body.share, by=caller.name)
