"""Field maps as arrays, comparisons of their models, and learning."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Depends, Query, Response
from pydantic import AwareDatetime

from db.query.fleet.deployments import DeploymentRecord
from db.query.measured.maps import maps_at, maps_of_deployment
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import DeploymentDep, FoundationDep, period_of, service
from server.base.foundation import Foundation
from server.base.problem import not_found
from server.base.view import encoded
from server.base.work.job_view import JobBegun, JobView, leaves
from server.fleet.dependency import FleetDep
from server.map.choice import MapChoices
from server.map.comparison import MapComparisons
from server.map.export import ORDER, MapExport, archive, table
from server.map.field_maps import FieldMaps
from server.map.group import MapKey
from server.map.learning import MapLearning
from server.map.record import scores_of, view_of
from server.map.threshold import ThresholdShares
from server.map.view import (
    AxesView,
    FieldMapView,
    LearnedView,
    MapChoiceView,
    MapComparisonView,
    MapEntryView,
    SampleCountView,
    ScoresView,
    ShareAboveView,
)
from webui.scene.source import MapView

router = APIRouter(prefix="/api/robots/{robot}/maps", tags=["maps"], route_class=IdempotentRoute)

MapComparisonsDep = Annotated[MapComparisons, Depends(service(MapComparisons))]
MapLearningDep = Annotated[MapLearning, Depends(service(MapLearning))]
ThresholdSharesDep = Annotated[ThresholdShares, Depends(service(ThresholdShares))]
MapChoicesDep = Annotated[MapChoices, Depends(service(MapChoices))]
FieldMapsDep = Annotated[FieldMaps, Depends(service(FieldMaps))]


At = Annotated[
    AwareDatetime | None, Query(description="As it was kept last before this moment, RFC 3339.")
]


class MapFormat(StrEnum):
    """How a map is written."""

    JSON = "json"
    NPZ = "npz"
    """numpy archive: ``x_m, y_m, z_m, mean, std, mask, shape, simulation`` and the facts."""
    CSV = "csv"
    """One row for each grid point in the water, after comments with units, model and samples."""


@router.get("")
async def list_maps(
    caller: Viewer,
    robot: str,
    fleet: FleetDep,
    maps: FieldMapsDep,
    foundation: FoundationDep,
    deployment: DeploymentDep,
    at: At = None,
) -> list[MapEntryView]:
    """Return which variables of a robot are mapped, and by which models.

    Of a moment of the past, those that had been kept of its deployment by then.
    """
    del caller
    fleet.status(robot)
    entries: dict[str, MapEntryView] = {}
    shown = await _shown(maps, robot, foundation, deployment, at)
    for (key, model), view in shown.views.items():
        if key in entries:
            entries[key].models.append(model)
            entries[key].titles[model] = view.title or model
        else:
            entries[key] = MapEntryView(
                variable=key,
                title=view.variable.title,
                unit=view.variable.unit,
                models=[model],
                titles={model: view.title or model},
                samples=sum(view.samples_per_level),
                updated_at=view.updated_at,
            )
    return list(entries.values())


@router.get("/choices")
async def list_choices(caller: Viewer, robot: str, choices: MapChoicesDep) -> list[MapChoiceView]:
    """Return the channels of which the map of a robot can be, by what its water's robots told."""
    del caller
    return await choices.offered(robot)


@router.put("/choice/{variable}")
async def choose_variable(
    caller: Pilot, robot: str, variable: str, choices: MapChoicesDep
) -> list[MapChoiceView]:
    """Let the map of a robot, and its surveys, be of another channel.

    It becomes a new version of the `field` settings: the newest that the robot had for the channel,
    or the present ones with mean and variance of what was measured.
    """
    await choices.choose(robot, variable, caller.name)
    return await choices.offered(robot)


@router.get(
    "/{variable}",
    response_model=FieldMapView,
    responses={200: {"content": {"application/octet-stream": {}, "text/csv": {}}}},
)
async def get_map(
    caller: Viewer,
    robot: str,
    variable: str,
    fleet: FleetDep,
    maps: FieldMapsDep,
    foundation: FoundationDep,
    deployment: DeploymentDep,
    model: Annotated[
        str | None,
        Query(description="By default the live one; the others are of the newest comparison."),
    ] = None,
    format: Annotated[MapFormat, Query()] = MapFormat.JSON,
    at: At = None,
) -> Response:
    """Return mean and standard deviation on the map's grid; nothing where there is no water.

    Of a deployment that is over, the map as it was in the end; of a moment of the past, as it was
    kept last in its deployment before then.
    """
    del caller
    record = fleet.status(robot).record
    shown = await _shown(maps, robot, foundation, deployment, at)
    view = _find(shown, robot, variable, model)
    export = MapExport(
        robot=robot,
        site=record.site if deployment is None else deployment.site,
        view=view,
        config_version=None if shown.is_past else maps.version(robot),
        smoothed=0 if shown.is_past else _smoothed(maps, robot),
        is_simulation=foundation.settings.simulation or record.simulated,
    )
    if format is MapFormat.NPZ:
        content = await asyncio.to_thread(archive, export)
        return _file(content, "application/octet-stream", export.name("npz"))
    if format is MapFormat.CSV:
        content = (await asyncio.to_thread(table, export)).encode()
        return _file(content, "text/csv; charset=utf-8", export.name("csv"))
    answer = encoded(_map_view(maps, export, shown))
    answer.headers.update(_named(export.name("json")))
    return answer


@router.get("/{variable}/share")
async def get_share_above(
    caller: Viewer,
    robot: str,
    variable: str,
    shares: ThresholdSharesDep,
    above: Annotated[
        float | None,
        Query(
            allow_inf_nan=False,
            description="In the variable's unit; by default the threshold of the field's settings.",
        ),
    ] = None,
) -> ShareAboveView:
    """Return between which shares of the water the live map is above a value.

    Fields that agree with the map are drawn on a coarse grid; a map that grows fast is drawn from
    now and then only.
    """
    del caller
    return await shares.share(robot, variable, above)


@router.get("/{variable}/comparison")
async def get_comparison(
    caller: Viewer, robot: str, variable: str, comparisons: MapComparisonsDep
) -> MapComparisonView:
    """Return the newest comparison of all field models on the samples of a map."""
    del caller
    return comparisons.view(robot, variable)


@router.post("/{variable}/comparison", status_code=202)
async def start_comparison(
    caller: Pilot, robot: str, variable: str, comparisons: MapComparisonsDep, begun: JobBegun
) -> JobView:
    """Compare all field models on all samples, in a process of its own.

    They are scored against the truth where the robot is simulated, else against whole dives that
    are held out. The same job is returned while one is under way.
    """
    return await begun(await comparisons.start(robot, variable, by=caller.name))


@router.post("/{variable}/learning", status_code=202, openapi_extra=leaves(LearnedView))
async def start_learning(
    caller: Pilot, robot: str, variable: str, learning: MapLearningDep, begun: JobBegun
) -> JobView:
    """Learn the kernels of the map's model from all samples, in a process of its own.

    What is found becomes a new version of the `field` settings, and the map is made anew. The same
    job is returned while one is under way.
    """
    return await begun(await learning.start(robot, variable, by=caller.name))


@dataclass(frozen=True, slots=True)
class _Shown:
    """The maps that a route tells of."""

    views: Mapping[MapKey, MapView]
    scores: Mapping[MapKey, ScoresView]
    is_past: bool
    """Whether they are of a deployment that is over."""


async def _shown(
    maps: FieldMaps,
    robot: str,
    foundation: Foundation,
    deployment: DeploymentRecord | None,
    at: datetime | None,
) -> _Shown:
    """Return the maps of a robot: of now, of a moment, or as they were when a deployment ended."""
    period_of(deployment, robot)
    if at is not None:
        kept = await foundation.store.query(lambda session: maps_at(session, robot, at))
    elif deployment is None or deployment.ended_at is None or deployment.kind == "recorded":
        return _Shown(maps.views(robot), maps.scores(robot), is_past=False)
    else:
        kept = await foundation.store.query(lambda session: maps_of_deployment(session, deployment))
    known = foundation.channels.catalogue
    views = {
        (one.variable, one.model): view_of(one, known[one.variable])
        for one in kept
        if one.variable in known
    }
    return _Shown(views, scores_of(kept), is_past=True)


def _find(shown: _Shown, robot: str, variable: str, model: str | None) -> MapView:
    views = shown.views
    for (key, of_model), view in views.items():
        if key == variable and model in {None, of_model}:
            return view
    known = ", ".join(f"{key} ({of_model})" for key, of_model in views) or "none yet"
    hint = "; compare the models to see others" if views else ""
    raise not_found(f"There is no such map of {robot}; there are: {known}{hint}.")


def _smoothed(maps: FieldMaps, robot: str) -> int:
    samples = maps.samples(robot)
    return 0 if samples is None else int(np.count_nonzero(samples.is_smoothed))


def _map_view(maps: FieldMaps, export: MapExport, shown: _Shown) -> FieldMapView:
    robot, view = export.robot, export.view
    variable = view.variable
    wet = np.isfinite(view.mean)
    return FieldMapView(
        robot=robot,
        variable=variable.key,
        title=variable.title,
        unit=variable.unit,
        scale=variable.scale,
        value_unit=export.value_unit,
        colour_map=variable.colour_map,
        is_derived=variable.is_derived,
        model=view.model,
        site=export.site.name,
        origin_latitude_deg=export.site.origin_latitude_deg,
        origin_longitude_deg=export.site.origin_longitude_deg,
        axes=AxesView(view.x_m.tolist(), view.y_m.tolist(), view.z_m.tolist()),
        shape=list(view.mean.shape),
        order=ORDER,
        # What is no number becomes null on its way out.
        mean=view.mean.ravel().tolist(),
        std=view.std.ravel().tolist(),
        mask=None if wet.all() else wet.ravel().tolist(),
        samples=SampleCountView(export.samples, list(view.samples_per_level)),
        smoothed_samples=export.smoothed,
        models=[model for key, model in shown.views if key == variable.key],
        config_version=export.config_version,
        carriage="still" if shown.is_past else maps.carriage(robot),
        water_moved="" if shown.is_past else maps.water_moved(robot),
        simulation=export.is_simulation,
        updated_at=view.updated_at,
        scores=shown.scores.get((variable.key, view.model)),
        threshold=maps.threshold(robot),
    )


def _file(content: bytes, media_type: str, name: str) -> Response:
    return Response(content, media_type=media_type, headers=_named(name))


def _named(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"'}
