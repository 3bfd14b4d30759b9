"""A deployment as REST says it."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, NotRequired

from sqlalchemy.orm import Session
from typing_extensions import TypedDict

from db.query.fleet.deployment_change import STATES
from db.query.fleet.deployments import DeploymentRecord, list_deployments
from db.query.measured.samples import kept_counts
from db.record import same
from server.base.view import View, one_of

DeploymentState = Annotated[str, one_of(*STATES)]


class RecordedScores(TypedDict):
    """How well the map of one variable predicts samples that were held out."""

    variable: str
    model: str
    title: str
    unit: NotRequired[str]
    rmse: float
    rmse_in_std: NotRequired[float]
    nlpd: float
    wmse: float
    coverage_90: float
    samples: int
    held_out: NotRequired[int]
    message: NotRequired[str]


class Signature(TypedDict):
    """Who moved a deployment, when, and what they said."""

    by: str
    at: datetime
    note: str


@dataclass(frozen=True, slots=True)
class DeploymentView(View):
    """A stretch of time that a robot spent in the water, or one imported recording."""

    id: str
    name: str
    purpose: str
    people: list[str]
    robot: str
    kind: Annotated[str, one_of("live", "recorded")]
    """``live`` or ``recorded``."""
    state: DeploymentState
    water: str
    """Name of the water as it was described then."""
    started_at: datetime | None
    """Null while it is planned."""
    ended_at: datetime | None
    """The first moment that is no more of it; null while it lasts."""
    void_reason: str
    """Why it does not count; empty if it does."""
    variables: list[str]
    samples: int
    source: str
    """Name of the imported file; empty for a live one."""
    skipped_rows: int
    """Rows of the file that were broken and left out."""
    scores: list[RecordedScores]
    """How well the maps of a recording predict samples that were held out."""
    review: Signature | None
    """Who looked at its data and signed them; null until then."""
    delivery: Signature | None
    """Who handed its data over; the note says to whom."""


@dataclass(frozen=True, slots=True)
class DeploymentsView(View):
    """Deployments, the newest first."""

    deployments: list[DeploymentView]


@dataclass(frozen=True, slots=True)
class SplitView(View):
    """What became of a deployment that was split."""

    first: DeploymentView
    second: DeploymentView


def list_views(session: Session, robot: str | None) -> list[DeploymentView]:
    """Return the newest thousand deployments, of one robot or of all."""
    records = list_deployments(session, robot=robot, limit=1000)
    return [deployment_view(session, record) for record in records]


def deployment_view(session: Session, record: DeploymentRecord) -> DeploymentView:
    """Return a deployment with what it holds."""
    samples = record.rows * len(record.variables)
    variables = list(record.variables)
    if record.kind == "live":
        counts = kept_counts(session, record.robot, deployment=record.id)
        samples, variables = sum(counts.values()), sorted(counts)
    return same(
        DeploymentView,
        record,
        name=record.title,
        people=list(record.people),
        water=record.site.name,
        variables=variables,
        samples=samples,
        source=str(record.document.get("source", "")),
        skipped_rows=int(record.document.get("skipped_rows", 0)),
        scores=list(record.document.get("scores", [])),
        review=_signature(record, "review"),
        delivery=_signature(record, "delivery"),
    )


def _signature(record: DeploymentRecord, key: str) -> Signature | None:
    kept = record.document.get(key)
    if kept is None:
        return None
    return Signature(by=kept["by"], at=datetime.fromisoformat(kept["at"]), note=kept["note"])
