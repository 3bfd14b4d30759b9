"""Something of every kind that a route names, for any robot: rows with no more than they need."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import JSON, Boolean, Float, Integer, String, select
from sqlalchemy.orm import Session

from db.column import Utc
from db.identity import public_id
from db.query.fleet.subject import TABLES
from db.query.station.jobs import add_job
from db.study_tables import Study
from db.tables import Base, Deployment, Robot

FIRST = ("plan", "mission")
"""Kinds that others refer to."""
PARAMETER = {"schedule": "schedule_id"}
"""As routes call it, where that is not the kind."""


def ids_of(session: Session, robot: str) -> dict[str, str]:
    """Add one thing of every kind; return by parameter the id of each."""
    key = session.scalars(select(Robot.key).where(Robot.id == robot)).one()
    made: dict[str, Any] = {"robot_key": key}
    ids = {"robot": robot}
    for kind, table in sorted(TABLES.items(), key=lambda item: item[0] not in FIRST):
        if table is Deployment:
            continue
        row = _least(table, {**made, "kind": kind, "cause": f"test {key}", "number": key})
        session.add(row)
        session.flush()
        number = row.number if table is Study else row.key
        made[f"{kind}_key"] = row.key
        ids[PARAMETER.get(kind, kind)] = public_id(kind, number)
    deployment = select(Deployment.key).where(Deployment.robot_key == key)
    ids["deployment"] = public_id("deployment", session.scalars(deployment.limit(1)).one())
    ids["job"] = add_job(session, "test", at=datetime.now(UTC), by="test", robot=robot).id
    return ids


def _least(table: type[Base], known: Mapping[str, Any]) -> Any:
    row = table()
    for column in table.__table__.columns:
        if column.primary_key and column.name == "key":
            continue
        if column.name in known:
            setattr(row, column.name, known[column.name])
        elif not column.nullable and column.default is None:
            setattr(row, column.name, _value(column.type))
    return row


def _value(kind: object) -> object:
    match kind:
        case Boolean():
            return False
        case Utc():
            return datetime.now(UTC)
        case Integer():
            return 1
        case Float():
            return 0.0
        case JSON():
            return {}
        case String():
            return ""
        case _:
            return b""
