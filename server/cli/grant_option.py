"""Roles for chosen robots and groups, as options of verbs."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace

from db.query.station.grants import GrantRecord
from server.access.role import Role

_GRANTED = tuple(role for role in Role if role is not Role.NONE)


def add_grant_options(parser: ArgumentParser) -> None:
    """Let roles be given for chosen robots and groups."""
    parser.add_argument(
        "--robot",
        dest="grants",
        action="append",
        type=_of_robot,
        metavar="ROBOT=ROLE",
        help="a role for one robot, such as mini-1=pilot; may be repeated",
    )
    parser.add_argument(
        "--group",
        dest="grants",
        action="append",
        type=_of_group,
        metavar="GROUP=ROLE",
        help="a role for the robots of a group; may be repeated",
    )


def grants_of(arguments: Namespace) -> list[GrantRecord] | None:
    """Return the roles that were given, ``None`` if none was."""
    return arguments.grants


def _of_robot(text: str) -> GrantRecord:
    name, role = _parts(text)
    return GrantRecord(role, robot=name)


def _of_group(text: str) -> GrantRecord:
    name, role = _parts(text)
    return GrantRecord(role, group=name)


def _parts(text: str) -> tuple[str, Role]:
    name, _, role = text.rpartition("=")
    if not name or role not in _GRANTED:
        raise ArgumentTypeError(f"{text!r} is not NAME=ROLE with one of {', '.join(_GRANTED)}")
    return name, Role(role)
