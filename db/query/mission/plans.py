"""Plans and their life cycle; the legs and figures of a plan are one document."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

from sqlalchemy import func, or_, select
from sqlalchemy.orm import Session

from db.claim import note_made
from db.deployment_span import Period
from db.fault import StoreError
from db.identity import key_of, public_id
from db.query.change import row_and_robot, row_of
from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import Plan, Robot

ENDED_STATES = ("done", "failed", "superseded", "cancelled")
"""States that a plan never leaves."""
_LADDER = {
    "draft": "draft_at",
    "sent": "sent_at",
    "waiting": "waiting_at",
    "on_board": "on_board_at",
    "running": "running_at",
    **dict.fromkeys(ENDED_STATES, "ended_at"),
}


class PlanStateError(StoreError):
    """The plan is not in a state from which this step leads on."""


@dataclass(frozen=True, slots=True)
class PlanRecord:
    """A plan as the database keeps it."""

    id: str
    robot: str
    kind: str
    mission: str | None
    round: int
    state: str
    """``planning, draft, sent, waiting, on_board, running, done, failed, superseded, cancelled``;
    ``waiting`` is on board behind the plan being flown."""
    sha256: str | None
    config: Mapping[str, Any]
    """The full configuration that the plan was made with."""
    document: Mapping[str, Any]
    """Legs, points, account, violations, history, message: what the planner left."""
    created_at: datetime
    created_by: str
    draft_at: datetime | None
    sent_at: datetime | None
    on_board_at: datetime | None
    running_at: datetime | None
    ended_at: datetime | None
    waiting_at: datetime | None = None


def add_plan(
    session: Session,
    robot: str,
    kind: str,
    *,
    config: Mapping[str, Any],
    at: datetime,
    by: str,
    mission: str | None = None,
    round_number: int = 1,
) -> str:
    """Add a plan in the state ``planning`` and return its id.

    Raises:
        UnknownIdError: If there is no such robot or mission.
    """
    row = Plan(
        robot_key=robot_key(session, robot),
        mission_key=None if mission is None else key_of("mission", mission),
        round=round_number,
        kind=kind,
        state="planning",
        config=dict(config),
        document={},
        created_at=at,
        created_by=by,
    )
    session.add(row)
    session.flush()
    plan = public_id("plan", row.key)
    note_made(session, plan)
    return plan


def change_plan(
    session: Session,
    plan: str,
    *,
    at: datetime,
    state: str | None = None,
    only_from: tuple[str, ...] | None = None,
    sha256: str | None = None,
    document: Mapping[str, Any] | None = None,
) -> PlanRecord:
    """Change what is given; a new state notes its moment, keys of ``document`` replace old ones.

    Args:
        session: A session of a change.
        plan: Id of the plan.
        at: Moment of the change.
        state: State that the plan enters.
        only_from: States that the plan may be in.
        sha256: Hash of the plan's canonical bytes.
        document: Parts of the document that are new.

    Raises:
        UnknownIdError: If there is no such plan.
        PlanStateError: If the plan is in a state that is not in ``only_from``.
    """
    row = row_of(session, Plan, "plan", plan)
    if only_from is not None and row.state not in only_from:
        raise PlanStateError(f"{plan} is {row.state.replace('_', ' ')}.")
    if state is not None and state != row.state:
        row.state = state
        if state in _LADDER:
            setattr(row, _LADDER[state], at)
    if sha256 is not None:
        row.sha256 = sha256
    if document is not None:
        row.document = {**row.document, **document}
    session.flush()
    return get_plan(session, plan)


def get_plan(session: Session, plan: str) -> PlanRecord:
    """Return one plan.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(*row_and_robot(session, Plan, "plan", plan))


def plan_by_hash(session: Session, robot: str, sha256: str) -> PlanRecord | None:
    """Return the newest plan of a robot whose bytes have this hash (or begin of a hash)."""
    found = session.execute(
        select(Plan, Robot.id)
        .join(Robot, Plan.robot_key == Robot.key)
        .where(Robot.id == robot, Plan.sha256.startswith(sha256, autoescape=True))
        .order_by(Plan.key.desc())
        .limit(1)
    ).one_or_none()
    return None if found is None else _record(*found)


def plan_on_board_at(session: Session, robot: str, at: datetime) -> PlanRecord | None:
    """Return the plan that a robot held at a moment, by what the station had proof of then.

    Its state is as it was: ``running`` or ``on_board``; the rest of it as it is now.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    held_from = func.coalesce(Plan.on_board_at, Plan.running_at)
    row = session.scalar(
        select(Plan)
        .where(
            Plan.robot_key == robot_key(session, robot),
            held_from <= at,
            or_(Plan.ended_at.is_(None), Plan.ended_at > at),
        )
        .order_by(held_from.desc(), Plan.key.desc())
        .limit(1)
    )
    if row is None:
        return None
    was_running = row.running_at is not None and row.running_at <= at
    return replace(_record(row, robot), state="running" if was_running else "on_board")


def list_plans(
    session: Session,
    *,
    robot: str | None = None,
    mission: str | None = None,
    states: tuple[str, ...] | None = None,
    period: Period | None = None,
    before: str | None = None,
    limit: int = 100,
) -> list[PlanRecord]:
    """Return plans, the newest first; ``before`` continues a list after its last id.

    A plan belongs to a period in which it was made, sent, flown or ended.
    """
    statement = (
        select(Plan, Robot.id)
        .join(Robot, Plan.robot_key == Robot.key)
        .order_by(Plan.key.desc())
        .limit(limit)
    )
    if robot is not None:
        statement = statement.where(Plan.robot_key == robot_key(session, robot))
    if mission is not None:
        statement = statement.where(Plan.mission_key == key_of("mission", mission))
    if states is not None:
        statement = statement.where(Plan.state.in_(states))
    if period is not None:
        moments = (Plan.created_at, Plan.sent_at, Plan.running_at, Plan.ended_at)
        statement = statement.where(period.holds(*moments))
    if before is not None:
        statement = statement.where(Plan.key < key_of("plan", before))
    return [_record(row, name) for row, name in session.execute(statement)]


def flown_plans(
    session: Session, robot: str, states: tuple[str, ...], period: Period, limit: int
) -> list[PlanRecord]:
    """Return plans that a robot flew within a period, be it for a part of it, the newest first.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(Plan)
        .where(
            Plan.robot_key == robot_key(session, robot),
            Plan.state.in_(states),
            period.overlaps(Plan.running_at, Plan.ended_at),
        )
        .order_by(Plan.key.desc())
        .limit(limit)
    )
    return [_record(row, robot) for row in session.scalars(statement)]


def newest_begun(session: Session, robot: str, kind: str) -> str | None:
    """Return the newest plan of a kind that a robot began, ``None`` if there is none.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = session.scalar(
        select(Plan.key)
        .where(Plan.robot_key == robot_key(session, robot), Plan.kind == kind)
        .where(Plan.running_at.is_not(None))
        .order_by(Plan.key.desc())
        .limit(1)
    )
    return None if key is None else public_id("plan", key)


def _record(row: Plan, robot: str) -> PlanRecord:
    return same(
        PlanRecord,
        row,
        id=public_id("plan", row.key),
        robot=robot,
        mission=None if row.mission_key is None else public_id("mission", row.mission_key),
    )
