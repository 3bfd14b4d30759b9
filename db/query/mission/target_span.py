"""Which reports on a target belong to which plan."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise

from sqlalchemy import ColumnElement, UnaryExpression, case, func, select
from sqlalchemy.orm import Session

from autonomy.tracking.phase import TargetPhase
from db.query.fleet.robots import robot_key
from db.tables import PlanReportRow
from db.target_tables import TargetReportRow
from robot_link.messages import OnboardPlanState

_RUNNING = int(OnboardPlanState.RUNNING)
_FLOWN = (_RUNNING, int(OnboardPlanState.DONE), int(OnboardPlanState.FAILED))
"""A robot that says one of these of a plan has begun it, or at least has tried to."""


@dataclass(frozen=True, slots=True)
class TargetSpan:
    """Which reports are asked for, by the robot's clock."""

    after: datetime | None = None
    """Not included."""
    until: datetime | None = None
    """Included."""


EVERYTHING = TargetSpan()


@dataclass(frozen=True, slots=True)
class _Flight:
    """What a robot said of one plan that it flew."""

    first: datetime
    """Its first word of that."""
    has_run: bool
    """Whether it was heard while it flew."""


@dataclass(frozen=True, slots=True)
class _Mark:
    """What tells one report's mission from that of the next."""

    at: datetime
    is_over: bool
    ranges_heard: int


def range_of_plan(session: Session, robot: str, sha256: str) -> TargetSpan | None:
    """Return the time in which a robot flew a plan, ``None`` if it never began it.

    It ends where the next plan's begins. What a robot still says of its target once the mission is
    over belongs to that mission, whatever is on board by then.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    mine = _flights(session, key, PlanReportRow.sha256 == sha256)
    if not mine or (begin := _begin(session, key, mine[0])) is None:
        return None
    later = PlanReportRow.measured_at > mine[0].first
    for other in _flights(session, key, later & (PlanReportRow.sha256 != sha256)):
        end = _begin(session, key, other)
        if end is not None:
            return TargetSpan(begin.after, end.after)
    return TargetSpan(begin.after)


def _flights(session: Session, key: int, which: ColumnElement[bool]) -> list[_Flight]:
    """Return flights in order of time."""
    first = func.min(PlanReportRow.measured_at)
    runs = func.sum(case((PlanReportRow.state == _RUNNING, 1), else_=0))
    mine = PlanReportRow.robot_key == key
    statement = (
        select(first, runs)
        .where(mine, PlanReportRow.state.in_(_FLOWN), which)
        .group_by(PlanReportRow.sha256)
        .order_by(first)
    )
    return [_Flight(at, bool(count)) for at, count in session.execute(statement)]


def _begin(session: Session, key: int, flight: _Flight) -> TargetSpan | None:
    """Return what follows the last report of the mission before; ``None`` if this never began.

    Between the robot's last word of something else and its first of this flight, reports of both
    may lie. Another mission begins where one that was over is not, or where fewer ranges were heard
    than before. Where nothing tells, all of them belong to this flight.
    """
    at = TargetReportRow.measured_at
    told = select(func.max(PlanReportRow.measured_at)).where(
        PlanReportRow.robot_key == key, PlanReportRow.measured_at < flight.first
    )
    word = session.scalar(told)
    before = [] if word is None else _marks(session, key, at <= word, at.desc())
    since = at <= flight.first if word is None else (at > word) & (at <= flight.first)
    between = _marks(session, key, since, at.asc(), limit=None)
    behind = _marks(session, key, at > flight.first, at.asc()) if flight.has_run else []
    marks = [*before, *between, *behind]
    for old, new in reversed(list(pairwise(marks))):
        if (old.is_over and not new.is_over) or new.ranges_heard < old.ranges_heard:
            return TargetSpan(old.at)
    if not flight.has_run and (before or not between):
        return None
    is_over = bool(before) and bool(between) and all(mark.is_over for mark in between)
    return TargetSpan(between[-1].at if is_over else word)


def _marks(
    session: Session,
    key: int,
    which: ColumnElement[bool],
    order: UnaryExpression[datetime],
    limit: int | None = 1,
) -> Sequence[_Mark]:
    statement = (
        select(TargetReportRow.measured_at, TargetReportRow.phase, TargetReportRow.ranges_heard)
        .where(TargetReportRow.robot_key == key, which)
        .order_by(order)
        .limit(limit)
    )
    ended = int(TargetPhase.ENDED)
    return [_Mark(at, phase == ended, heard) for at, phase, heard in session.execute(statement)]
