"""Field maps as arrays."""

import io
from enum import StrEnum
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Query, Response

from server.api.dependency import FoundationDep, Viewer
from server.api.station_dependency import StationDep, encoded
from server.problem import not_found
from server.service.station import Station
from server.service.view.map import AxesView, FieldMapView, MapEntryView, SampleCountView
from webui.scene.source import MapView

router = APIRouter(prefix="/api/robots/{robot}/maps", tags=["maps"])


class MapFormat(StrEnum):
    """How a map is written."""

    JSON = "json"
    NPZ = "npz"
    """numpy archive: ``x_m, y_m, z_m, mean, std`` and ``simulation``."""


@router.get("")
async def list_maps(caller: Viewer, robot: str, station: StationDep) -> list[MapEntryView]:
    """Return which variables of a robot are mapped, and by which models."""
    del caller
    station.fleet.picture(robot)
    entries: dict[str, MapEntryView] = {}
    for (key, model), view in station.maps.views(robot).items():
        if key in entries:
            entries[key].models.append(model)
        else:
            entries[key] = MapEntryView(
                variable=key,
                title=view.variable.title,
                unit=view.variable.unit,
                models=[model],
                samples=sum(view.samples_per_level),
                updated_at=view.updated_at,
            )
    return list(entries.values())


@router.get(
    "/{variable}",
    response_model=FieldMapView,
    responses={200: {"content": {"application/octet-stream": {}}}},
)
async def get_map(
    caller: Viewer,
    robot: str,
    variable: str,
    station: StationDep,
    foundation: FoundationDep,
    model: Annotated[str | None, Query(description="By default the first that is listed.")] = None,
    format: Annotated[MapFormat, Query()] = MapFormat.JSON,
) -> Response:
    """Return mean and standard deviation on the map's grid."""
    del caller
    station.fleet.picture(robot)
    view = _find(station, robot, variable, model)
    if format is MapFormat.NPZ:
        return _archive(robot, view, simulation=foundation.settings.simulation)
    return encoded(
        FieldMapView(
            robot=robot,
            variable=variable,
            title=view.variable.title,
            unit=view.variable.unit,
            scale=view.variable.scale,
            model=view.model,
            axes=AxesView(view.x_m.tolist(), view.y_m.tolist(), view.z_m.tolist()),
            mean=view.mean.ravel().tolist(),
            std=view.std.ravel().tolist(),
            samples=SampleCountView(sum(view.samples_per_level), list(view.samples_per_level)),
            updated_at=view.updated_at,
            scores=station.maps.scores(robot).get((variable, view.model)),
        )
    )


def _find(station: Station, robot: str, variable: str, model: str | None) -> MapView:
    views = station.maps.views(robot)
    for (key, of_model), view in views.items():
        if key == variable and model in {None, of_model}:
            return view
    known = ", ".join(f"{key} ({of_model})" for key, of_model in views) or "none yet"
    raise not_found(f"There is no such map of {robot}; there are: {known}.")


def _archive(robot: str, view: MapView, *, simulation: bool) -> Response:
    packed = io.BytesIO()
    np.savez_compressed(
        packed,
        x_m=view.x_m,
        y_m=view.y_m,
        z_m=view.z_m,
        mean=view.mean,
        std=view.std,
        simulation=np.array(simulation),
    )
    mark = "_SIMULATION" if simulation else ""
    name = f"{robot}_{view.variable.key}_{view.model}{mark}.npz"
    return Response(
        packed.getvalue(),
        media_type="application/octet-stream",
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )
