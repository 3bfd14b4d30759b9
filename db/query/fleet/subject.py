"""Whose something is: the robot behind a public id."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, cast

from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from db.checklist_tables import ChecklistRunRow
from db.design_tables import DesignRow
from db.fault import UnknownIdError
from db.identity import key_of
from db.schedule_tables import ScheduledSendRow
from db.study_tables import Study
from db.tables import Alarm, Base, Command, Deployment, Mission, Plan, Robot, Transfer

TABLES: Mapping[str, type[Base]] = MappingProxyType(
    {
        "alarm": Alarm,
        "checklist": ChecklistRunRow,
        "command": Command,
        "deployment": Deployment,
        "design": DesignRow,
        "identification": Study,
        "mission": Mission,
        "plan": Plan,
        "schedule": ScheduledSendRow,
        "transfer": Transfer,
        "whatif": Study,
    }
)
"""Of each kind of public id, the table that holds it and its ``robot_key``."""


def robot_of(session: Session, kind: str, identity: str) -> str | None:
    """Return the robot that something belongs to, ``None`` if it is of no robot; one read by key.

    Raises:
        UnknownIdError: If there is nothing of this kind and id.
    """
    table = cast("Any", TABLES[kind])
    number = key_of(kind, identity)
    found = session.execute(
        select(table.robot_key, Robot.id)
        .outerjoin(Robot, Robot.key == table.robot_key)
        .where(*_is(table, kind, number))
    ).one_or_none()
    if found is None:
        raise UnknownIdError(kind, identity)
    return found[1]


def _is(table: Any, kind: str, number: int) -> tuple[ColumnElement[bool], ...]:  # noqa: ANN401 - any table with a robot
    if table is Study:
        return (table.kind == kind, table.number == number)
    return (table.key == number,)
