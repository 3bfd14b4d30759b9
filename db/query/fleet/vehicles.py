"""Vehicles that were brought as a file or identified; a vehicle is never changed."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.fault import StoreError
from db.record import same, values
from db.study_tables import VehicleRow


class VehicleExistsError(StoreError):
    """There is a vehicle of this key already."""


@dataclass(frozen=True, slots=True)
class VehicleRecord:
    """A vehicle beside those that the station brings along."""

    key: str
    title: str
    note: str
    """What an operator must know of the model."""
    origin: str
    """``file`` or ``identified``."""
    document: Mapping[str, Any]
    """The parameter document."""
    created_at: datetime
    created_by: str


def add_vehicle(session: Session, vehicle: VehicleRecord) -> None:
    """Add a vehicle.

    Raises:
        VehicleExistsError: If its key is taken.
    """
    if get_vehicle(session, vehicle.key) is not None:
        raise VehicleExistsError(f"There is a vehicle {vehicle.key!r} already.")
    session.add(
        VehicleRow(
            id=vehicle.key,
            document=dict(vehicle.document),
            **values(vehicle, but=["key", "document"]),
        )
    )
    session.flush()


def get_vehicle(session: Session, key: str) -> VehicleRecord | None:
    """Return the vehicle of a key, ``None`` where there is none."""
    row = session.scalar(select(VehicleRow).where(VehicleRow.id == key))
    return None if row is None else _record(row)


def list_vehicles(session: Session) -> list[VehicleRecord]:
    """Return every vehicle in the order in which they were added."""
    return [_record(row) for row in session.scalars(select(VehicleRow).order_by(VehicleRow.key))]


def _record(row: VehicleRow) -> VehicleRecord:
    return same(VehicleRecord, row, key=row.id)
