"""A memory of each engine, with days of one robot in it."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update
from sqlalchemy.orm import Session

from db.ingest import Telemetry
from db.store import Store
from db.tables import Deployment
from robot_link.messages import RawFrame, RobotId, RobotMode
from robot_link.report import Reading
from tests.db.conftest import (
    postgresql,
    postgresql_url,
    prepared_database,
    prepared_postgresql,
    report,
    sample,
    sqlite_url,
    store,
    url,
)

__all__ = [
    "postgresql",
    "postgresql_url",
    "prepared_database",
    "prepared_postgresql",
    "sqlite_url",
    "store",
    "url",
]
"""Fixtures of the database's own tests."""
DAY = datetime(2026, 3, 1, tzinfo=UTC)
NOW = DAY + timedelta(days=100)
LASTS_S = 3600
"""How much of each day the robot was on."""
ROBOT = RobotId("mini-1")


def day_of_robot(
    number: int, every_s: float = 10.0, received_at: datetime | None = None
) -> list[Telemetry]:
    """Return what a robot said in an hour of a day: states, samples, readings, raw bytes."""
    values: list[Telemetry] = []
    begin = DAY + timedelta(days=number, hours=10)
    for step in range(int(LASTS_S / every_s)):
        at = begin + timedelta(seconds=step * every_s)
        came = received_at or at + timedelta(milliseconds=80)
        is_up = step * every_s % 600 < 60
        depth_m = 0.0 if is_up else 5.0 + (step * 37 % 101) / 50.0
        values.append(
            replace(
                report(0.0, depth_m, ROBOT),
                measured_at=at,
                received_at=came,
                has_fix=is_up,
                mode=RobotMode.SURFACED if is_up else RobotMode.GLIDING,
            )
        )
        values.append(
            replace(
                sample(number * 100_000 + step, 3.0 + step * 53 % 360 / 100.0),
                measured_at=at,
                received_at=came,
            )
        )
        values.append(
            Reading(ROBOT, "internal_pressure", 900.0 + step * 29 % 360 / 100.0, at, came)
        )
        values.append(RawFrame(ROBOT, "radio", False, bytes([step % 256]) * 20, at))
    return values


@pytest.fixture
def ended(store: Store) -> None:
    """The deployment that the robot was put in begins before all that and has ended."""

    def change(session: Session) -> None:
        session.execute(
            update(Deployment).values(
                state="recovered",
                started_at=DAY - timedelta(days=10),
                ended_at=DAY + timedelta(days=50),
            )
        )

    store.change(change).result(60)
