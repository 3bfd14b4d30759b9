"""The files that deployments can be taken away as."""

from collections.abc import Generator
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from fastapi.responses import StreamingResponse

from db.query.fleet.deployments import INSTANT, get_deployment
from db.query.fleet.robots import get_robot
from db.query.mission.target_span import TargetSpan
from server.access.dependency import Viewer
from server.base.dependency import StoreDep, period_of
from server.fix.export import fix_csv_blocks
from server.recording.export import (
    actuator_csv_blocks,
    csv_blocks,
    geojson,
    geojson_sample_blocks,
    kml,
    kml_sample_blocks,
)
from server.target.export import target_csv_blocks

router = APIRouter(prefix="/api/deployments", tags=["data"])
Format = Literal["csv", "geojson", "kml", "tracking", "actuators", "fixes"]
_SAMPLES = {"csv": csv_blocks, "geojson": geojson_sample_blocks, "kml": kml_sample_blocks}
"""What writes samples, by format."""
_MEDIA_TYPES: dict[Format, str] = {
    "csv": "text/csv; charset=utf-8",
    "tracking": "text/csv; charset=utf-8",
    "actuators": "text/csv; charset=utf-8",
    "fixes": "text/csv; charset=utf-8",
    "geojson": "application/geo+json",
    "kml": "application/vnd.google-earth.kml+xml",
}


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
    values: Annotated[
        bool, Query(description="GeoJSON and KML have the samples where they were taken.")
    ] = False,
) -> Response:
    """Return the samples as CSV, or the track as GeoJSON or KML; simulated data says so.

    With ``values`` GeoJSON and KML have a point for each moment, with what was measured there by
    channel, and what follows of it.

    ``tracking`` is a CSV of what the robot said of the targets that it followed, ``actuators`` one
    of how its actuators followed, ``fixes`` one of where cameras found it.
    """
    del caller
    record = await store.query(lambda session: get_deployment(session, deployment))
    period_of(record)
    robot = await store.query(lambda session: get_robot(session, record.robot))
    mark = "SIMULATION_" if robot.simulated else ""
    ending = f"{format}.csv" if format in ("tracking", "actuators", "fixes") else format
    headers = {
        "Content-Disposition": f'attachment; filename="{mark}{robot.id}_{record.id}.{ending}"'
    }
    media_type = _MEDIA_TYPES[format]
    if values or format not in ("geojson", "kml"):

        def blocks() -> Generator[str]:
            with store.read() as session:
                if format in _SAMPLES:
                    yield from _SAMPLES[format](session, record, robot)
                elif format == "actuators":
                    yield from actuator_csv_blocks(session, record, robot)
                elif format == "fixes":
                    start, end = record.begun_at, record.last_at
                    yield from fix_csv_blocks(session, robot, record.site, start, end)
                else:
                    wanted = TargetSpan(record.begun_at - INSTANT, record.last_at)
                    yield from target_csv_blocks(session, robot, wanted)

        return StreamingResponse(blocks(), media_type=media_type, headers=headers)
    write = geojson if format == "geojson" else kml
    content = await store.query(lambda session: write(session, record, robot))
    return Response(content, media_type=media_type, headers=headers)
