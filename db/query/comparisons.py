"""The newest comparison of the field models on the samples behind a robot's map."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.map_tables import MapComparison
from db.query.robots import robot_key


@dataclass(frozen=True, slots=True)
class ComparisonRecord:
    """Four models on the same samples."""

    robot: str
    variable: str
    at: datetime
    document: Mapping[str, Any]
    """Axes, what it was made of, scores by model."""
    grid: bytes
    """The arrays, packed by whoever made the comparison."""


def keep_comparison(session: Session, record: ComparisonRecord) -> None:
    """Keep a comparison in the place of the one before.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    session.merge(
        MapComparison(
            robot_key=robot_key(session, record.robot),
            variable=record.variable,
            at=record.at,
            document=dict(record.document),
            grid=record.grid,
        )
    )


def list_comparisons(session: Session, robot: str) -> list[ComparisonRecord]:
    """Return the newest comparison of each variable of a robot.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    rows = session.scalars(
        select(MapComparison).where(MapComparison.robot_key == robot_key(session, robot))
    )
    return [ComparisonRecord(robot, r.variable, r.at, r.document, r.grid) for r in rows]
