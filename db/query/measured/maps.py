"""Snapshots of field maps."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db.deployment_span import Period, live_spans
from db.map_tables import MapSnapshot
from db.query.fleet.deployments import INSTANT, DeploymentRecord, deployment_at
from db.query.fleet.robots import robot_key
from db.record import same, values

_DAY = timedelta(days=1)


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


def newest_maps(session: Session, robot: str, period: Period | None = None) -> list[MapRecord]:
    """Return the newest snapshot of every map of a robot, of a period the newest in it.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    newest = (
        select(func.max(MapSnapshot.key))
        .where(MapSnapshot.robot_key == robot_key(session, robot))
        .group_by(MapSnapshot.variable, MapSnapshot.model)
    )
    if period is not None:
        newest = newest.where(period.holds(MapSnapshot.at))
    rows = session.scalars(select(MapSnapshot).where(MapSnapshot.key.in_(newest)))
    return [same(MapRecord, row, robot=robot) for row in rows]


def map_times(session: Session, robot: str) -> list[tuple[int, str, str, datetime]]:
    """Return key, variable, model and time of every snapshot of a robot.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    rows = session.execute(
        select(MapSnapshot.key, MapSnapshot.variable, MapSnapshot.model, MapSnapshot.at).where(
            MapSnapshot.robot_key == robot_key(session, robot)
        )
    )
    return [(key, variable, model, at) for key, variable, model, at in rows]


def get_maps(session: Session, robot: str, keys: Collection[int]) -> dict[int, MapRecord]:
    """Return snapshots of a robot by their keys."""
    rows = session.scalars(select(MapSnapshot).where(MapSnapshot.key.in_(keys)))
    return {row.key: same(MapRecord, row, robot=robot) for row in rows}


def maps_of_deployment(session: Session, deployment: DeploymentRecord) -> list[MapRecord]:
    """Return the newest snapshot of every map of a deployment that has begun.

    The last one may have been kept a little after its end; from the robot's next deployment on,
    maps are of that.

    Raises:
        NotBegunError: If it has not begun.
    """
    key, period = robot_key(session, deployment.robot), deployment.period
    spans = live_spans(session, [key])[key]
    later = [span.started_at for span in spans if span.started_at > period.first]
    last = min(later) - INSTANT if later else None
    return newest_maps(session, deployment.robot, Period(period.first, last))


def maps_at(session: Session, robot: str, at: datetime) -> list[MapRecord]:
    """Return the newest snapshot of every map of a robot that was kept by a moment.

    They are of the deployment that the moment belongs to, or of the day before where it belongs to
    none.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    deployment = deployment_at(session, robot, at)
    first = at - _DAY if deployment is None else deployment.begun_at
    return newest_maps(session, robot, Period(first, at))
