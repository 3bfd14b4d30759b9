"""Snapshots of field maps."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db.map_tables import MapSnapshot
from db.query.robots import robot_key
from db.record import same, values


@dataclass(frozen=True, slots=True)
class MapRecord:
    """A field map as it was after some samples."""

    robot: str
    variable: str
    model: str
    at: datetime
    samples: int
    document: Mapping[str, Any]
    """Axes, scale, scores, samples per fidelity."""
    grid: bytes
    """The arrays, packed by whoever made the map."""


def add_map(session: Session, record: MapRecord) -> None:
    """Keep a snapshot.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    session.add(
        MapSnapshot(
            robot_key=robot_key(session, record.robot),
            document=dict(record.document),
            **values(record, but=["robot", "document"]),
        )
    )


def newest_maps(session: Session, robot: str) -> list[MapRecord]:
    """Return the newest snapshot of every map of a robot.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    newest = (
        select(func.max(MapSnapshot.key))
        .where(MapSnapshot.robot_key == robot_key(session, robot))
        .group_by(MapSnapshot.variable, MapSnapshot.model)
    )
    rows = session.scalars(select(MapSnapshot).where(MapSnapshot.key.in_(newest)))
    return [same(MapRecord, row, robot=robot) for row in rows]
