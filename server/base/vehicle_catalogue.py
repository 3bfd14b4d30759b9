"""The vehicles that a station knows: those it brings along, and those that its people added."""

import hashlib
import json
import math
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from autonomy.vehicle.config import VEHICLES, Vehicle
from autonomy.vehicle.parameter_file import vehicle_document, vehicle_from_document
from db.query.fleet.vehicles import VehicleRecord, get_vehicle
from onboard.profile import FLIGHT_PROFILES, FlightProfile

BUILT_IN = "built-in"
"""Origin of the vehicles that the station brings along."""


@dataclass(frozen=True, slots=True)
class CatalogueEntry:
    """A vehicle, and where it comes from."""

    vehicle: Vehicle
    origin: str
    """``built-in``, ``file`` or ``identified``."""
    created_at: datetime | None = None
    created_by: str = ""


def entry_of(record: VehicleRecord) -> CatalogueEntry:
    """Return a vehicle that was added.

    Raises:
        VehicleFileError: If another version of the station wrote it, and it does not fit this one.
    """
    vehicle = vehicle_from_document(record.document)
    return CatalogueEntry(vehicle, record.origin, record.created_at, record.created_by)


def vehicle_digest(vehicle: Vehicle) -> str:
    """Return what two vehicles have in common only if every entry of them is the same."""
    document = json.dumps(vehicle_document(vehicle), sort_keys=True)
    return hashlib.sha256(document.encode()).hexdigest()


def preset_key(session: Session, model: str) -> str:
    """Return the key by which presets are found for a robot of a model.

    A vehicle that someone added has the presets of the built-in vehicle that is nearest in mass,
    by ratio: gains and noise follow the size of a robot.
    """
    record = None if model in VEHICLES else get_vehicle(session, model)
    return model if record is None else nearest_built_in(entry_of(record).vehicle)


def nearest_built_in(vehicle: Vehicle) -> str:
    """Return the key of the built-in vehicle whose mass has the ratio nearest to 1."""
    mass_kg = vehicle.hull.displaced_mass_kg
    return min(
        VEHICLES,
        key=lambda key: abs(math.log(VEHICLES[key].hull.displaced_mass_kg / mass_kg)),
    )


def profile_of(vehicle: Vehicle | None) -> FlightProfile:
    """Return how the program on board flies a vehicle, as built; the small one if none is known."""
    key = "miniglider" if vehicle is None else vehicle.key
    if key not in FLIGHT_PROFILES and vehicle is not None:
        key = nearest_built_in(vehicle)
    return FLIGHT_PROFILES[key]
