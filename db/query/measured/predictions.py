"""Where robots that were not heard should have been, and where the next fix found them."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.current_tables import PredictionRow
from db.identity import key_of, public_id
from db.query.fleet.robots import robot_key
from db.record import same
from robot_link.messages import RobotId


@dataclass(frozen=True, slots=True)
class PredictionRecord:
    """One prediction that a fix has judged."""

    robot: RobotId
    said_at: datetime
    """Of the last word that it was made from."""
    seen_at: datetime
    """Of the fix."""
    is_inside: bool
    """Whether the fix lay inside the 90 % ellipse."""
    document: Mapping[str, Any]
    id: str = ""


def add_prediction(session: Session, record: PredictionRecord) -> bool:
    """Keep a prediction; return whether it was not there yet.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, record.robot)
    known = select(PredictionRow.key).where(
        PredictionRow.robot_key == key, PredictionRow.seen_at == record.seen_at
    )
    if session.scalar(known) is not None:
        return False
    session.add(
        PredictionRow(
            robot_key=key,
            said_at=record.said_at,
            seen_at=record.seen_at,
            is_inside=record.is_inside,
            document=dict(record.document),
        )
    )
    session.flush()
    return True


def list_predictions(
    session: Session, robot: str, *, before: str | None = None, limit: int = 50
) -> list[PredictionRecord]:
    """Return judged predictions of a robot, the newest first.

    Args:
        session: A reading session.
        robot: Its id.
        before: Id to go on before.
        limit: Most to return.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(PredictionRow)
        .where(PredictionRow.robot_key == robot_key(session, robot))
        .order_by(PredictionRow.key.desc())
        .limit(limit)
    )
    if before is not None:
        statement = statement.where(PredictionRow.key < key_of("prediction", before))
    return [
        same(PredictionRecord, row, robot=RobotId(robot), id=public_id("prediction", row.key))
        for row in session.scalars(statement)
    ]
