"""Imported recordings: a deployment of its own, with all of its rows."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from itertools import islice
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.fault import StoreError
from db.identity import public_id
from db.ingest import insert_new
from db.query.change import row_of
from db.query.fleet.deployments import DeploymentRecord, get_deployment
from db.query.fleet.robots import get_robot, robot_key
from db.sample_ingest import NewSample, insert_samples
from db.tables import Deployment, StateRow
from robot_link.messages import STATE

BATCH_ROWS = 5_000
_FLIGHT = tuple(channel.key for channel in STATE.channels if channel.recorded is not None)


class DeploymentExistsError(StoreError):
    """This very recording is there already; the sentence names it."""


@dataclass(frozen=True, slots=True)
class RecordedRow:
    """One row of a recording in the robot's local frame."""

    measured_at: datetime
    position_ned: tuple[float, float, float]
    values: Sequence[float]
    """In the order of the deployment's variables."""
    flight: Mapping[str, float] = field(default_factory=dict[str, float])
    """How the vehicle flew, by the names of channels, as far as the row tells."""


def add_recording(
    session: Session,
    robot: str,
    rows: Iterable[RecordedRow],
    *,
    title: str,
    log: int,
    variables: Sequence[str],
    document: Mapping[str, Any],
    at: datetime,
) -> DeploymentRecord:
    """Add a recorded deployment with all of its rows, in the transaction of the caller.

    Rows of a moment of which the robot has a state already add their samples only.

    Args:
        session: A session of a change.
        robot: Whose recording it is.
        rows: In order of time; taken one after another.
        title: What operators call it.
        log: Names the recording among the robot's sample logs.
        variables: Keys of the variables of each row.
        document: What else is known of it.
        at: When it arrived.

    Raises:
        UnknownIdError: If there is no such robot.
        DeploymentExistsError: If the robot has this log already.
        ValueError: If there is no row.
    """
    key = robot_key(session, robot)
    present = session.scalar(
        select(Deployment.key).where(Deployment.robot_key == key, Deployment.log == log)
    )
    if present is not None:
        raise DeploymentExistsError(
            f"This recording is there already, as {public_id('deployment', present)} of {robot}."
        )
    kept = _keep_rows(session, key, log, variables, rows, at)
    deployment = Deployment(
        robot_key=key,
        kind="recorded",
        state="recovered",
        title=title,
        purpose="",
        people=[],
        site=get_robot(session, robot).site.model_dump(mode="json"),
        void_reason="",
        log=log,
        started_at=kept.first,
        ended_at=kept.last,
        rows=kept.count,
        variables=list(variables),
        document=dict(document),
    )
    session.add(deployment)
    session.flush()
    return get_deployment(session, public_id("deployment", deployment.key))


def note_on_deployment(session: Session, deployment: str, document: Mapping[str, Any]) -> None:
    """Add to what is known of a deployment; keys that are there are replaced.

    Raises:
        UnknownIdError: If there is no such deployment.
    """
    row = row_of(session, Deployment, "deployment", deployment)
    row.document = {**row.document, **document}


@dataclass(frozen=True, slots=True)
class _Kept:
    """Rows of a recording that were kept."""

    count: int
    first: datetime
    last: datetime


def _keep_rows(
    session: Session,
    key: int,
    log: int,
    variables: Sequence[str],
    rows: Iterable[RecordedRow],
    at: datetime,
) -> _Kept:
    count, first, last = 0, None, None
    remaining = iter(rows)
    while batch := list(islice(remaining, BATCH_ROWS)):
        first, last = first or batch[0].measured_at, batch[-1].measured_at
        insert_new(session, StateRow, [_state(key, row, at) for row in batch])
        if variables:
            insert_samples(session, _samples(key, log, variables, batch, count, at))
        count += len(batch)
    if first is None or last is None:
        raise ValueError("a recording needs a row")
    return _Kept(count, first, last)


def _state(key: int, row: RecordedRow, received_at: datetime) -> dict[str, Any]:
    north_m, east_m, depth_m = row.position_ned
    return {
        "robot_key": key,
        "measured_at": row.measured_at,
        "received_at": received_at,
        "north_m": north_m,
        "east_m": east_m,
        "depth_m": depth_m,
        **{name: row.flight.get(name) for name in _FLIGHT},
        "position_std_m": row.flight.get("position_std_m", 0.0),
        "has_fix": "position_std_m" in row.flight,
    }


def _samples(
    key: int,
    log: int,
    variables: Sequence[str],
    batch: Sequence[RecordedRow],
    offset: int,
    received_at: datetime,
) -> list[NewSample]:
    return [
        NewSample(
            robot_key=key,
            log=log,
            sequence=index * len(variables) + column,
            channel=variable,
            measured_at=row.measured_at,
            received_at=received_at,
            value=value,
            position_ned=row.position_ned,
            position_std_m=0.0,
        )
        for index, row in enumerate(batch, start=offset)
        for column, (variable, value) in enumerate(zip(variables, row.values, strict=True))
    ]
