"""Who may do what with which robots: grants of people and tokens, and groups of robots."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from sqlalchemy import delete, or_, select
from sqlalchemy.orm import Session

from db.fault import StoreError, UnknownIdError
from db.person_tables import RobotGrant, RobotGroup, RobotGroupMember, Token
from db.query.fleet.robots import robot_key
from db.tables import Robot


class GroupInUseError(StoreError):
    """Somebody has a right by this group."""


@dataclass(frozen=True, slots=True)
class Holder:
    """Whose a grant is, by the key of its row."""

    person: int | None = None
    token: int | None = None


@dataclass(frozen=True, slots=True)
class GrantRecord:
    """A role for one robot, or for the robots of one group."""

    role: str
    robot: str | None = None
    group: str | None = None


@dataclass(frozen=True, slots=True)
class GroupRecord:
    """Robots under one name."""

    name: str
    robots: tuple[str, ...]


def robot_roles(
    session: Session, holders: Collection[Holder]
) -> dict[Holder, list[tuple[str, str]]]:
    """Return for each holder the robots that its grants reach, each with a role; in one read.

    A robot may come more than once: by itself, and by each of its groups.
    """
    people = [one.person for one in holders if one.person is not None]
    tokens = [one.token for one in holders if one.token is not None]
    statement = (
        select(RobotGrant.person_key, RobotGrant.token_key, Robot.id, RobotGrant.role)
        .outerjoin(RobotGroupMember, RobotGroupMember.group_key == RobotGrant.group_key)
        .join(
            Robot,
            or_(Robot.key == RobotGrant.robot_key, Robot.key == RobotGroupMember.robot_key),
        )
        .where(or_(RobotGrant.person_key.in_(people), RobotGrant.token_key.in_(tokens)))
    )
    roles: dict[Holder, list[tuple[str, str]]] = {holder: [] for holder in holders}
    for person, token, robot, role in session.execute(statement):
        roles[Holder(person, token)].append((robot, role))
    return roles


def grants_of(session: Session, holder: Holder) -> list[GrantRecord]:
    """Return the grants of one holder, in the order in which they were given."""
    return list_grants(session).get(holder, [])


def list_grants(session: Session) -> dict[Holder, list[GrantRecord]]:
    """Return every grant, by whose it is."""
    statement = (
        select(RobotGrant, Robot.id, RobotGroup.name)
        .outerjoin(Robot, Robot.key == RobotGrant.robot_key)
        .outerjoin(RobotGroup, RobotGroup.key == RobotGrant.group_key)
        .order_by(RobotGrant.key)
    )
    found: dict[Holder, list[GrantRecord]] = {}
    for row, robot, group in session.execute(statement):
        holder = Holder(row.person_key, row.token_key)
        found.setdefault(holder, []).append(GrantRecord(row.role, robot, group))
    return found


def set_grants(session: Session, holder: Holder, grants: Sequence[GrantRecord]) -> None:
    """Put grants in the place of all that a holder has.

    Raises:
        UnknownIdError: If there is no such robot or group.
    """
    column = RobotGrant.person_key if holder.token is None else RobotGrant.token_key
    session.execute(delete(RobotGrant).where(column == (holder.person or holder.token)))
    for grant in grants:
        session.add(
            RobotGrant(
                person_key=holder.person,
                token_key=holder.token,
                robot_key=None if grant.robot is None else robot_key(session, grant.robot),
                group_key=None if grant.group is None else _group(session, grant.group).key,
                role=grant.role,
            )
        )
    session.flush()


def list_groups(session: Session) -> list[GroupRecord]:
    """Return every group with its robots, by name."""
    statement = (
        select(RobotGroup.name, Robot.id)
        .outerjoin(RobotGroupMember, RobotGroupMember.group_key == RobotGroup.key)
        .outerjoin(Robot, Robot.key == RobotGroupMember.robot_key)
        .order_by(RobotGroup.name, Robot.key)
    )
    robots: dict[str, list[str]] = {}
    for name, robot in session.execute(statement):
        robots.setdefault(name, []).extend([robot] if robot else [])
    return [GroupRecord(name, tuple(members)) for name, members in robots.items()]


def put_group(session: Session, name: str, robots: Sequence[str]) -> None:
    """Let a group have these robots; it is made if there is none of this name.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    group = session.scalar(select(RobotGroup).where(RobotGroup.name == name))
    if group is None:
        group = RobotGroup(name=name)
        session.add(group)
        session.flush()
    session.execute(delete(RobotGroupMember).where(RobotGroupMember.group_key == group.key))
    for robot in dict.fromkeys(robots):
        member = RobotGroupMember(group_key=group.key, robot_key=robot_key(session, robot))
        session.add(member)
    session.flush()


def remove_group(session: Session, name: str) -> None:
    """Remove a group by which nobody has a right.

    Raises:
        UnknownIdError: If there is none of this name.
        GroupInUseError: If somebody has a right by it.
    """
    group = _group(session, name)
    ended = select(Token.key).where(Token.revoked_at.is_not(None))
    session.execute(delete(RobotGrant).where(RobotGrant.token_key.in_(ended)))
    if session.scalar(select(RobotGrant.key).where(RobotGrant.group_key == group.key).limit(1)):
        raise GroupInUseError(f"Rights are given by the group {name}; take them away first.")
    session.execute(delete(RobotGroupMember).where(RobotGroupMember.group_key == group.key))
    session.delete(group)


def _group(session: Session, name: str) -> RobotGroup:
    row = session.scalar(select(RobotGroup).where(RobotGroup.name == name))
    if row is None:
        raise UnknownIdError("group", name)
    return row
