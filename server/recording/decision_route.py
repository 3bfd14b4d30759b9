"""Decisions of a robot: what each was made of, and whether it is made the same once more."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends, Query
from pydantic import AwareDatetime

from db.query.mission.decisions import (
    DecisionRange,
    DecisionRecord,
    count_decisions,
    list_decisions,
)
from db.record import same
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import DeploymentDep, StoreDep, cut_to, service
from server.base.view import View, one_of
from server.base.work.job_view import JobBegun, JobView, leaves
from server.fleet.dependency import FleetDep
from server.recording.decision_replays import DecisionReplayResult, DecisionReplays

router = APIRouter(
    prefix="/api/robots/{robot}/decisions", tags=["decisions"], route_class=IdempotentRoute
)

ReplaysDep = Annotated[DecisionReplays, Depends(service(DecisionReplays))]
Start = Annotated[AwareDatetime | None, Query(description="First moment; RFC 3339.")]
End = Annotated[
    AwareDatetime | None, Query(description="First moment that does not count any more.")
]


@dataclass(frozen=True, slots=True)
class DecisionView(View):
    """One decision, and what came of making it once more."""

    id: str
    kind: str
    title: str
    """What was decided, in words."""
    about: str
    """Id of what came of it, such as a plan's; "" where nothing has one."""
    at: datetime
    state: Annotated[str, one_of("done", "cancelled", "failed", "ended")]
    """``ended`` where the work was ended before it could say how far it had come."""
    seed: list[int]
    """What its random numbers began with; empty where it drew none."""
    iterations: int | None
    """Of a search; ``null`` for what is no search."""
    candidates: int | None
    """Trajectories that a search compared."""
    versions: dict[str, str | None]
    """Versions of the settings by their kind; ``null`` for the preset."""
    software: dict[str, str]
    """Versions of all that computed it."""
    input_sha256: str
    """Of all that it was made of."""
    map_sha256: str
    """Of the samples and settings of the map among that."""
    outcome_sha256: str | None
    """Of what came of it, quantized."""
    verdict: Annotated[str, one_of("same", "different", "cannot")] | None
    """By the newest replay; ``null`` where that did not reach it."""
    because: str
    """Why it is not the same, a sentence without its end; "" where it is."""


@dataclass(frozen=True, slots=True)
class DecisionsView(View):
    """The newest decisions, in the order in which they were made."""

    decisions: list[DecisionView]
    count: int
    """Of all, also those that are not in the list."""
    job: str | None
    """The replay under way."""


@router.get("")
async def read_decisions(
    caller: Viewer,
    robot: str,
    fleet: FleetDep,
    store: StoreDep,
    replays: ReplaysDep,
    deployment: DeploymentDep,
    start: Start = None,
    end: End = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> DecisionsView:
    """Return what the station decided for a robot, and what the newest replay said of it."""
    del caller
    fleet.status(robot)
    wanted = DecisionRange((robot,), *cut_to(deployment, robot, start, end))
    decisions = await store.query(lambda session: list_decisions(session, wanted, newest=limit))
    found = await replays.found(robot)
    return DecisionsView(
        [
            _view(one, replays.replay.title(one), *found.get(one.id, (None, "")))
            for one in decisions
        ],
        await store.query(lambda session: count_decisions(session, wanted)),
        replays.job(robot),
    )


@router.post("/replay", status_code=202, openapi_extra=leaves(DecisionReplayResult))
async def replay_decisions(
    caller: Pilot,
    robot: str,
    fleet: FleetDep,
    replays: ReplaysDep,
    deployment: DeploymentDep,
    begun: JobBegun,
    start: Start = None,
    end: End = None,
) -> JobView:
    """Make a robot's decisions once more of what they were made of, and compare the outcomes.

    It takes as long as the decisions took, gives way to all other work, and changes nothing.
    """
    fleet.status(robot)
    wanted = DecisionRange((robot,), *cut_to(deployment, robot, start, end))
    return await begun(await replays.start(robot, wanted, by=caller.name))


def _view(decision: DecisionRecord, title: str, verdict: str | None, because: str) -> DecisionView:
    document = decision.document
    pace = document["pace"]
    return same(
        DecisionView,
        decision,
        title=title,
        seed=document["seed"],
        iterations=None if pace is None else pace["iterations"],
        candidates=document["candidates"],
        versions=document["versions"],
        software=document["software"],
        verdict=verdict,
        because=because,
    )
