"""Deployments, and the files that they can be taken away as."""

from collections.abc import Generator
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from fastapi.responses import StreamingResponse
from sqlalchemy.orm import Session

from db.query.deployments import DeploymentRecord, get_deployment
from db.query.deployments import list_deployments as query_deployments
from db.query.robots import get_robot
from db.query.samples import kept_counts
from db.query.target_span import TargetSpan
from db.record import same
from server.access.dependency import Viewer
from server.base.dependency import StoreDep
from server.base.view import View, one_of
from server.recording.export import actuator_csv_blocks, csv_blocks, geojson, kml
from server.recording.intake import RecordedScores
from server.target.export import target_csv_blocks

router = APIRouter(prefix="/api/deployments", tags=["data"])
Format = Literal["csv", "geojson", "kml", "tracking", "actuators"]
_MEDIA_TYPES: dict[Format, str] = {
    "csv": "text/csv; charset=utf-8",
    "tracking": "text/csv; charset=utf-8",
    "actuators": "text/csv; charset=utf-8",
    "geojson": "application/geo+json",
    "kml": "application/vnd.google-earth.kml+xml",
}

_INSTANT = timedelta(microseconds=1)


@dataclass(frozen=True, slots=True)
class DeploymentView(View):
    """A stretch of time that a robot spent in the water, or one imported recording."""

    id: str
    name: str
    robot: str
    kind: Annotated[str, one_of("live", "recorded")]
    """``live`` or ``recorded``."""
    started_at: datetime
    ended_at: datetime | None
    """Null while it lasts."""
    variables: list[str]
    samples: int
    source: str
    """Name of the imported file; empty for a live one."""
    skipped_rows: int
    """Rows of the file that were broken and left out."""
    scores: list[RecordedScores]
    """How well the maps of a recording predict samples that were held out."""


@dataclass(frozen=True, slots=True)
class DeploymentsView(View):
    """Deployments, the newest first."""

    deployments: list[DeploymentView]


@router.get("")
async def list_deployments(
    caller: Viewer,
    store: StoreDep,
    robot: Annotated[str | None, Query()] = None,
    before: Annotated[str | None, Query(description="Id to go on before.")] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> DeploymentsView:
    """Return deployments, the newest first."""
    del caller

    def views(session: Session) -> list[DeploymentView]:
        records = query_deployments(session, robot=robot, before=before, limit=limit)
        return [_view(session, record) for record in records]

    return DeploymentsView(await store.query(views))


@router.get("/{deployment}")
async def get_one(caller: Viewer, deployment: str, store: StoreDep) -> DeploymentView:
    """Return one deployment."""
    del caller
    return await store.query(lambda s: _view(s, get_deployment(s, deployment)))


@router.get(
    "/{deployment}/export",
    response_class=Response,
    responses={200: {"content": {name: {} for name in _MEDIA_TYPES.values()}}},
)
async def export(
    caller: Viewer,
    deployment: str,
    store: StoreDep,
    format: Annotated[Format, Query()] = "csv",
) -> Response:
    """Return the samples as CSV, or the track as GeoJSON or KML; simulated data says so.

    ``tracking`` is a CSV of what the robot said of the targets that it followed, ``actuators`` one
    of how its actuators followed.
    """
    del caller
    record = await store.query(lambda session: get_deployment(session, deployment))
    robot = await store.query(lambda session: get_robot(session, record.robot))
    mark = "SIMULATION_" if robot.simulated else ""
    ending = f"{format}.csv" if format in ("tracking", "actuators") else format
    headers = {
        "Content-Disposition": f'attachment; filename="{mark}{robot.id}_{record.id}.{ending}"'
    }
    media_type = _MEDIA_TYPES[format]
    if format in ("csv", "tracking", "actuators"):

        def blocks() -> Generator[str]:
            with store.read() as session:
                if format == "csv":
                    yield from csv_blocks(session, record, robot)
                elif format == "actuators":
                    yield from actuator_csv_blocks(session, record, robot)
                else:
                    wanted = TargetSpan(record.started_at - _INSTANT, record.ended_at)
                    yield from target_csv_blocks(session, robot, wanted)

        return StreamingResponse(blocks(), media_type=media_type, headers=headers)
    write = geojson if format == "geojson" else kml
    content = await store.query(lambda session: write(session, record, robot))
    return Response(content, media_type=media_type, headers=headers)


def _view(session: Session, record: DeploymentRecord) -> DeploymentView:
    samples = record.rows * len(record.variables)
    variables = list(record.variables)
    if record.kind == "live":
        counts = kept_counts(session, record.robot, of_deployment=True)
        samples, variables = sum(counts.values()), sorted(counts)
    return same(
        DeploymentView,
        record,
        name=record.title,
        variables=variables,
        samples=samples,
        source=str(record.document.get("source", "")),
        skipped_rows=int(record.document.get("skipped_rows", 0)),
        scores=list(record.document.get("scores", [])),
    )
