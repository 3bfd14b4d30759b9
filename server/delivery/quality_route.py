"""Flags of quality by REST."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends, Query
from pydantic import AwareDatetime, Field
from sqlalchemy.orm import Session
from typing_extensions import TypedDict

from autonomy.quality.flag import SUSPECT
from db.query.fleet.deployments import get_deployment
from db.query.measured.quality import manual_flags, newest_quality_run, quality_stretches
from db.record import same
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import StoreDep, service
from server.base.view import Body, View
from server.base.work.job_view import JobBegun, JobView, leaves
from server.delivery.quality import QualityResult, QualityRuns, samples_of, series_of

router = APIRouter(prefix="/api/deployments", tags=["data"], route_class=IdempotentRoute)
QualityRunsDep = Annotated[QualityRuns, Depends(service(QualityRuns))]


class FlagCounts(TypedDict):
    """How many values have which flag of QARTOD."""

    good: int
    not_evaluated: int
    suspect: int
    fail: int


@dataclass(frozen=True, slots=True)
class QualityRunView(View):
    """What the newest run of rules found."""

    name: str
    """Of the rule set."""
    version: str
    sha256: str
    """Digest of the rules."""
    rows: int
    """Moments that it looked at."""
    at: datetime
    by: str
    came_after: int | None
    """Measurements of the deployment that came after it; null of a run that did not count them."""
    counts: dict[str, dict[str, FlagCounts]]
    """By series and test; ``all`` is the gravest of all tests."""


@dataclass(frozen=True, slots=True)
class StretchView(View):
    """Values of a series in a row with the same flag, both ends included."""

    series: str
    first_at: datetime
    last_at: datetime
    flag: int
    """3 suspect, 4 fails; 2 was not evaluated."""
    tests: list[str]


@dataclass(frozen=True, slots=True)
class ManualFlagView(View):
    """A flag that a person set; it counts before any test."""

    id: str
    series: str
    first_at: datetime
    last_at: datetime
    flag: int
    """1 good, 2 probably good, 3 probably bad, 4 bad."""
    reason: str
    at: datetime
    by: str


@dataclass(frozen=True, slots=True)
class QualityView(View):
    """What is known of the quality of a deployment's data."""

    series: list[str]
    """What can be flagged."""
    run: QualityRunView | None
    """Null before the first."""
    stretches: list[StretchView]
    """What it found suspect or failing, by series and time."""
    is_cut: bool
    """Whether there are more stretches than were asked for."""
    manual: list[ManualFlagView]
    """Those that count, in the order in which they were set: later ones win."""


class NewFlag(Body):
    """A stretch of time of a series, and what a person says of it."""

    series: str = Field(max_length=60)
    """Key of the channel or value."""
    first_at: AwareDatetime
    """When the stretch begins, included."""
    last_at: AwareDatetime
    """When it ends, included."""
    flag: int = Field(ge=1, le=4)
    """1 good, 2 probably good, 3 probably bad, 4 bad."""
    reason: str = Field(min_length=1, max_length=500, pattern=r"\S")
    """Why, 1 to 500 characters."""


@router.get("/{deployment}/quality")
async def get_quality(
    caller: Viewer,
    deployment: str,
    store: StoreDep,
    limit: Annotated[int, Query(ge=1, le=2000)] = 200,
) -> QualityView:
    """Return what the newest run found, and what people flagged."""
    del caller
    return await store.query(lambda session: _view(session, deployment, limit))


@router.post("/{deployment}/quality", status_code=202, openapi_extra=leaves(QualityResult))
async def run_quality(
    caller: Pilot, deployment: str, runs: QualityRunsDep, begun: JobBegun
) -> JobView:
    """Judge the data by the rules that hold for the robot; see `GET /api/config/quality`.

    409 while a run over this deployment is under way. What earlier runs found is kept.
    """
    return await begun(await runs.start(deployment, by=caller.name))


@router.post("/{deployment}/flags", status_code=201)
async def set_flag(
    caller: Pilot, deployment: str, body: NewFlag, runs: QualityRunsDep
) -> ManualFlagView:
    """Flag a stretch of time of a series; 409 once the deployment is reviewed."""
    kept = await runs.flag(deployment, by=caller.name, **body.model_dump())
    return same(ManualFlagView, kept)


@router.delete("/{deployment}/flags/{flag}", status_code=204)
async def withdraw_flag(caller: Pilot, deployment: str, flag: str, runs: QualityRunsDep) -> None:
    """Let a flag count no more; the log keeps it."""
    await runs.withdraw(deployment, flag, by=caller.name)


def _view(session: Session, deployment: str, limit: int) -> QualityView:
    record = get_deployment(session, deployment)
    run = newest_quality_run(session, deployment)
    has_begun = record.started_at is not None
    found = (
        [] if run is None else quality_stretches(session, run.key, least=SUSPECT, limit=limit + 1)
    )
    return QualityView(
        series=series_of(session, record) if has_begun else [],
        run=None
        if run is None
        else same(
            QualityRunView,
            run,
            name=str(run.rules["name"]),
            version=str(run.rules["version"]),
            counts=dict(run.counts),
            came_after=None
            if run.samples is None
            else max(0, sum(samples_of(session, record).values()) - run.samples),
        ),
        stretches=[
            same(StretchView, one, tests=[name for name in one.tests.split(",") if name])
            for one in found[:limit]
        ],
        is_cut=len(found) > limit,
        manual=[same(ManualFlagView, one) for one in manual_flags(session, deployment)],
    )
