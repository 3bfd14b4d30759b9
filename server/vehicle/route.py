"""The catalogue of vehicles: their parameters, their polars, and new ones from files."""

from collections.abc import Sequence
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response

from autonomy.vehicle.parameter_file import VehicleDocument, vehicle_document
from db.query.fleet.robots import RobotRecord, list_robots
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import StoreDep, service
from server.base.vehicle_catalogue import CatalogueEntry
from server.base.view import VehicleUpload, encoded
from server.vehicle.vehicles import Vehicles
from server.vehicle.view import (
    CapabilityView,
    PolarView,
    SteadyView,
    VehiclesView,
    VehicleView,
)

router = APIRouter(prefix="/api/vehicles", tags=["vehicles"], route_class=IdempotentRoute)

VehiclesDep = Annotated[Vehicles, Depends(service(Vehicles))]


@router.get("")
async def list_vehicles(caller: Viewer, store: StoreDep, vehicles: VehiclesDep) -> VehiclesView:
    """Return every vehicle that a robot can be, and which robots are."""
    known = await store.query(list_robots)
    robots = [robot for robot in known if caller.rights.sees(robot.id)]
    return VehiclesView([_view(entry, robots) for entry in vehicles.entries])


@router.post("", status_code=201)
async def add_vehicle(caller: Pilot, document: VehicleUpload, vehicles: VehiclesDep) -> VehicleView:
    """Add a vehicle by its parameter document, in the form that `GET /api/vehicles/{key}` returns.

    422 names every entry that is missing, unknown, without its unit or out of range, with the
    allowed range; 409 says that the key is taken. A vehicle is never changed afterwards.
    """
    entry = await vehicles.add(document.root, origin="file", by=caller.name)
    return _view(entry, [])


@router.get("/{key}")
async def get_vehicle(caller: Viewer, key: str, vehicles: VehiclesDep) -> VehicleDocument:
    """Return the parameter document of a vehicle: every number with its unit."""
    del caller
    return vehicle_document(vehicles.get(key).vehicle)


@router.get("/{key}/polar", response_model=PolarView)
async def get_polar(caller: Viewer, key: str, vehicles: VehiclesDep) -> Response:
    """Return how a vehicle glides by net buoyancy and mass position, and where that is stable.

    The first answer of a vehicle takes seconds, further ones come from memory.
    """
    del caller
    return encoded(await vehicles.polar(key))


@router.get("/{key}/capability", response_model=CapabilityView)
async def get_capability(
    caller: Viewer,
    key: str,
    vehicles: VehiclesDep,
    depth_m: Annotated[
        float | None, Query(description="Depth of the water; by default as deep as it needs.", gt=0)
    ] = None,
) -> Response:
    """Return which primitives a vehicle can fly and what they cost, in the planner's settings.

    The first answer of a vehicle takes seconds, further ones come from memory.
    """
    del caller
    return encoded(await vehicles.capability(key, depth_m))


@router.get("/{key}/steady", response_model=SteadyView)
async def get_steady(
    caller: Viewer,
    key: str,
    vehicles: VehiclesDep,
    m0_kg: Annotated[float, Query(description="Net buoyancy, positive heavy.")],
    rp1_m: Annotated[float, Query(description="Position of the sliding mass, positive forward.")],
    delta_rad: Annotated[float, Query(description="Tail angle.")] = 0.0,
) -> Response:
    """Return what a vehicle settles into with its actuators held still.

    422 says in words where there is no such motion, or which input is beyond its stop.
    """
    del caller
    return encoded(await vehicles.steady(key, m0_kg, rp1_m, delta_rad))


def _view(entry: CatalogueEntry, robots: Sequence[RobotRecord]) -> VehicleView:
    vehicle = entry.vehicle
    return VehicleView(
        key=vehicle.key,
        title=vehicle.title,
        note=vehicle.note,
        origin=entry.origin,
        robots=[robot.id for robot in robots if robot.model == vehicle.key],
        created_at=entry.created_at,
        created_by=entry.created_by,
    )
