"""Roles for chosen robots and groups, as requests give them and as answers show them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from db.query.station.grants import GrantRecord
from server.access.role import Role
from server.base.text import Name
from server.base.view import Body, View

GrantedRole: TypeAlias = Literal[Role.VIEWER, Role.PILOT, Role.ADMIN]


class RobotGrantBody(Body):
    """A role for one robot."""

    robot: str
    """Id of the robot."""
    role: GrantedRole
    """What may be done with it."""


class GroupGrantBody(Body):
    """A role for the robots of a group, whichever they are at the time."""

    group: Name
    """Id of the group of robots."""
    role: GrantedRole
    """What may be done with its robots."""


GrantBody: TypeAlias = RobotGrantBody | GroupGrantBody


@dataclass(frozen=True, slots=True)
class GrantView(View):
    """A role for one robot, or for the robots of a group."""

    role: Role
    robot: str | None
    group: str | None


def records_of(bodies: Sequence[GrantBody]) -> list[GrantRecord]:
    """Return grants as the database keeps them."""
    return [
        GrantRecord(body.role, robot=body.robot)
        if isinstance(body, RobotGrantBody)
        else GrantRecord(body.role, group=body.group)
        for body in bodies
    ]


def views_of(grants: Sequence[GrantRecord]) -> list[GrantView]:
    """Return grants as they are shown."""
    return [GrantView(Role(grant.role), grant.robot, grant.group) for grant in grants]


def words_of(role: str, grants: Sequence[GrantRecord]) -> str:
    """Return in words what somebody is, such as *viewer, pilot of mini-1*."""
    parts = [f"{grant.role} of {grant.robot or f'the group {grant.group}'}" for grant in grants]
    if role != Role.NONE or not parts:
        parts.insert(0, "without a role" if role == Role.NONE else role)
    return ", ".join(parts)
