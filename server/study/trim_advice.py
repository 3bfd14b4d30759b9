"""Trim advice as it is kept: for which vehicle it holds, and in words."""

from collections.abc import Mapping
from typing import Any

from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.trim import TrimConfig
from db.query.trim import TrimAdviceRecord
from server.base.vehicle_catalogue import vehicle_digest

_DIGEST = "vehicle_digest"


def for_vehicle(document: Mapping[str, Any], vehicle: Vehicle) -> dict[str, Any]:
    """Return the document of an advice together with the vehicle that it holds for."""
    return {**document, "vehicle": vehicle.key, _DIGEST: vehicle_digest(vehicle)}


def fits(record: TrimAdviceRecord, vehicle: Vehicle) -> bool:
    """Tell whether an advice holds for a vehicle with exactly these parameters."""
    return record.document.get(_DIGEST) == vehicle_digest(vehicle)


def advice_document(record: TrimAdviceRecord) -> dict[str, Any]:
    """Return an advice with its id as JSON."""
    shown = {key: value for key, value in record.document.items() if key != _DIGEST}
    return {**shown, "id": record.id, "deployment": record.deployment}


def in_words(trim: TrimConfig) -> str:
    """Say a trim as pilots do, in grams and millimetres."""
    buoyancy_g = trim.net_buoyancy_offset_kg * 1e3
    position_mm = trim.mass_position_offset_m * 1e3
    return f"net buoyancy {buoyancy_g:+.1f} g, mass position {position_mm:+.1f} mm"
