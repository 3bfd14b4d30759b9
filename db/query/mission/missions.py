"""Missions: what operators asked of robots."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.claim import note_made
from db.deployment_span import Period
from db.identity import key_of, public_id
from db.query.change import row_and_robot, row_of
from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import Mission, Robot

OPEN_STATES = ("planning", "ready", "running", "replanning", "scoring")
"""States in which a mission still has something to do."""


@dataclass(frozen=True, slots=True)
class MissionRecord:
    """A mission as the database keeps it."""

    id: str
    robot: str
    kind: str
    state: str
    automation: bool
    """Whether the station may replan, upload and start by itself."""
    config: Mapping[str, Any]
    """The full configuration that the mission uses, validated before it came here."""
    document: Mapping[str, Any]
    """Budget spent, scores, message and whatever else belongs to the mission's service."""
    created_at: datetime
    created_by: str


def add_mission(
    session: Session,
    robot: str,
    kind: str,
    *,
    state: str,
    automation: bool,
    config: Mapping[str, Any],
    document: Mapping[str, Any],
    at: datetime,
    by: str,
) -> str:
    """Add a mission and return its id.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = Mission(
        robot_key=robot_key(session, robot),
        kind=kind,
        state=state,
        automation=automation,
        config=dict(config),
        document=dict(document),
        created_at=at,
        created_by=by,
    )
    session.add(row)
    session.flush()
    mission = public_id("mission", row.key)
    note_made(session, mission)
    return mission


def change_mission(
    session: Session,
    mission: str,
    *,
    state: str | None = None,
    automation: bool | None = None,
    document: Mapping[str, Any] | None = None,
) -> MissionRecord:
    """Change what is given; the keys of ``document`` replace those that are there.

    Raises:
        UnknownIdError: If there is no such mission.
    """
    row = row_of(session, Mission, "mission", mission)
    if state is not None:
        row.state = state
    if automation is not None:
        row.automation = automation
    if document is not None:
        row.document = {**row.document, **document}
    session.flush()
    return get_mission(session, mission)


def get_mission(session: Session, mission: str) -> MissionRecord:
    """Return one mission.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(*row_and_robot(session, Mission, "mission", mission))


def list_missions(
    session: Session,
    *,
    robot: str | None = None,
    states: tuple[str, ...] | None = None,
    period: Period | None = None,
    before: str | None = None,
    limit: int = 100,
) -> list[MissionRecord]:
    """Return missions, the newest first; ``before`` continues a list after its last id."""
    statement = (
        select(Mission, Robot.id)
        .join(Robot, Mission.robot_key == Robot.key)
        .order_by(Mission.key.desc())
        .limit(limit)
    )
    if robot is not None:
        statement = statement.where(Mission.robot_key == robot_key(session, robot))
    if states is not None:
        statement = statement.where(Mission.state.in_(states))
    if period is not None:
        statement = statement.where(period.holds(Mission.created_at))
    if before is not None:
        statement = statement.where(Mission.key < key_of("mission", before))
    return [_record(row, name) for row, name in session.execute(statement)]


def _record(row: Mission, robot: str) -> MissionRecord:
    return same(MissionRecord, row, id=public_id("mission", row.key), robot=robot)
