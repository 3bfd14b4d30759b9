"""Commands and the levels that each was proved to have reached."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.claim import note_made
from db.deployment_span import Period
from db.identity import public_id
from db.query.change import row_and_robot
from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import Command, CommandLevelRow, Robot
from robot_link.messages import FIRST_EMERGENCY_NUMBER, CommandKind, CommandLevel, CommandNumber

CREATED = "created"
"""Level of a command that no link has taken yet."""
_RANK = {CREATED: 0, "queued": 1, "radio": 2, "applied": 3, "refused": 3, "expired": 3}
_NUMBERS = FIRST_EMERGENCY_NUMBER - 1


@dataclass(frozen=True, slots=True)
class ProvedLevel:
    """A level with the moment and the link that proved it."""

    level: CommandLevel
    at: datetime
    carrier: str
    reason: str


@dataclass(frozen=True, slots=True)
class CommandRecord:
    """A command as the database keeps it."""

    id: str
    number: CommandNumber
    robot: str
    kind: CommandKind
    plan_sha256: str | None
    level: str
    """The highest proved level, or ``created`` before the first."""
    levels: tuple[ProvedLevel, ...]
    created_at: datetime
    created_by: str
    expires_at: datetime


def add_command(
    session: Session,
    robot: str,
    kind: CommandKind,
    *,
    at: datetime,
    expires_at: datetime,
    by: str,
    plan_sha256: str | None = None,
) -> CommandRecord:
    """Add a command before its first byte leaves.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = Command(
        robot_key=robot_key(session, robot),
        kind=kind.value,
        plan_sha256=plan_sha256,
        level=CREATED,
        created_at=at,
        created_by=by,
        expires_at=expires_at,
    )
    session.add(row)
    session.flush()
    record = _record(session, row, robot)
    note_made(session, record.id)
    return record


def add_level(
    session: Session,
    command: str,
    level: CommandLevel,
    *,
    at: datetime,
    carrier: str,
    reason: str = "",
) -> CommandRecord:
    """Note a proved level once; a final level (applied, refused, expired) is never overruled.

    Two carriers may each prove that they took it, which is noted of both.

    Raises:
        UnknownIdError: If there is no such command.
    """
    row, robot = row_and_robot(session, Command, "command", command)
    rises = _RANK[level.value] > _RANK[row.level]
    if rises or (level.value == row.level and _is_other_carrier(session, row, carrier)):
        row.level = level.value
        session.add(
            CommandLevelRow(
                command_key=row.key, level=level.value, at=at, carrier=carrier, reason=reason
            )
        )
        session.flush()
    return _record(session, row, robot)


def _is_other_carrier(session: Session, row: Command, carrier: str) -> bool:
    """Tell whether this carrier is the first to prove again what another has proved."""
    if row.level not in ("queued", "radio"):
        return False
    proved = session.scalars(
        select(CommandLevelRow.carrier).where(
            CommandLevelRow.command_key == row.key, CommandLevelRow.level == row.level
        )
    )
    return carrier not in set(proved)


def get_command(session: Session, command: str) -> CommandRecord:
    """Return one command.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(session, *row_and_robot(session, Command, "command", command))


def list_commands(
    session: Session,
    *,
    robot: str | None = None,
    open_only: bool = False,
    period: Period | None = None,
    limit: int = 100,
) -> list[CommandRecord]:
    """Return commands, the newest first; ``open_only`` leaves out those that are settled."""
    statement = (
        select(Command, Robot.id)
        .join(Robot, Command.robot_key == Robot.key)
        .order_by(Command.key.desc())
        .limit(limit)
    )
    if robot is not None:
        statement = statement.where(Command.robot_key == robot_key(session, robot))
    if open_only:
        statement = statement.where(Command.level.in_([CREATED, "queued", "radio"]))
    if period is not None:
        statement = statement.where(period.holds(Command.created_at))
    return [_record(session, row, name) for row, name in session.execute(statement).all()]


def newest_of_kind(session: Session, robot: str, kind: CommandKind) -> CommandRecord | None:
    """Return what a robot was told last of a kind.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = session.scalars(
        select(Command)
        .where(Command.robot_key == robot_key(session, robot), Command.kind == kind.value)
        .order_by(Command.key.desc())
        .limit(1)
    ).one_or_none()
    return None if row is None else _record(session, row, robot)


def newest_applied(
    session: Session, robot: str, kinds: tuple[CommandKind, ...]
) -> tuple[CommandKind, datetime] | None:
    """Return which of these commands a robot said last that it obeys, and when it said so.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    found = session.execute(
        select(Command.kind, CommandLevelRow.at)
        .join(CommandLevelRow, CommandLevelRow.command_key == Command.key)
        .where(
            Command.robot_key == robot_key(session, robot),
            Command.kind.in_([kind.value for kind in kinds]),
            CommandLevelRow.level == CommandLevel.APPLIED.value,
        )
        .order_by(CommandLevelRow.at.desc())
        .limit(1)
    ).one_or_none()
    return None if found is None else (CommandKind(found[0]), found[1])


def command_of_number(session: Session, robot: str, number: CommandNumber) -> CommandRecord | None:
    """Return the newest command of a robot that carries this number on the wire."""
    found = session.execute(
        select(Command, Robot.id)
        .join(Robot, Command.robot_key == Robot.key)
        .where(Robot.id == robot, (Command.key - 1) % _NUMBERS == number - 1)
        .order_by(Command.key.desc())
        .limit(1)
    ).one_or_none()
    return None if found is None else _record(session, *found)


def _record(session: Session, row: Command, robot: str) -> CommandRecord:
    levels = session.scalars(
        select(CommandLevelRow)
        .where(CommandLevelRow.command_key == row.key)
        .order_by(CommandLevelRow.key)
    )
    return same(
        CommandRecord,
        row,
        id=public_id("command", row.key),
        number=CommandNumber((row.key - 1) % _NUMBERS + 1),
        robot=robot,
        kind=CommandKind(row.kind),
        levels=tuple(
            ProvedLevel(CommandLevel(level.level), level.at, level.carrier, level.reason)
            for level in levels
        ),
    )
