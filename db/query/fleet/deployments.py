"""Deployments: the stretches of time that robots spend in the water, and imported recordings.

A deployment is planned, begins, ends and is kept; ``db.query.fleet.deployment_change`` changes it.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final

from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from autonomy.site import Site
from db.deployment_span import LiveSpan, Period, live_spans
from db.fault import StoreError
from db.identity import key_of, public_id
from db.query.change import row_and_robot
from db.query.fleet.robots import get_robot, robot_key, robot_keys
from db.record import same
from db.tables import Deployment, Robot

INSTANT: Final = timedelta(microseconds=1)
"""What time is kept to."""


class NotBegunError(StoreError):
    """A planned deployment has no time yet, and nothing in it."""


@dataclass(frozen=True, slots=True)
class DeploymentRecord:
    """A stretch of time that a robot spent in the water, or one imported recording."""

    id: str
    robot: str
    kind: str
    """``live`` or ``recorded``."""
    state: str
    """``planned``, ``in_water``, ``recovered``, ``reviewed`` or ``delivered``."""
    title: str
    purpose: str
    people: tuple[str, ...]
    site: Site
    """The water: as it was described in the end, while it lasts as it is described now."""
    log: int | None
    """Sample log of an imported recording."""
    started_at: datetime | None
    """``None`` while it is planned."""
    ended_at: datetime | None
    """The first moment that is no more of it, of a recording its last; ``None`` while it lasts."""
    void_reason: str
    """Why it does not count, "" if it does."""
    rows: int
    variables: tuple[str, ...]
    document: Mapping[str, Any]
    """What else is known: the file's name, rows that were skipped, scores of its maps; who
    reviewed it, and to whom it was delivered."""

    @property
    def begun_at(self) -> datetime:
        """When it began.

        Raises:
            NotBegunError: If it has not.
        """
        if self.started_at is None:
            raise NotBegunError(f"{self.id} of {self.robot} has not begun.")
        return self.started_at

    @property
    def period(self) -> Period:
        """Its time.

        Raises:
            NotBegunError: If it has not begun.
        """
        return Period(self.begun_at, self.last_at)

    @property
    def last_at(self) -> datetime | None:
        """Its last moment, ``None`` while it lasts."""
        if self.ended_at is None or self.kind == "recorded":
            return self.ended_at
        return self.ended_at - INSTANT


def get_deployment(session: Session, deployment: str) -> DeploymentRecord:
    """Return one deployment.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row, robot = row_and_robot(session, Deployment, "deployment", deployment)
    return deployment_record(session, row, robot)


def list_deployments(
    session: Session,
    *,
    robot: str | None = None,
    robots: Collection[str] | None = None,
    state: str | None = None,
    is_void: bool = False,
    before: str | None = None,
    limit: int = 100,
) -> list[DeploymentRecord]:
    """Return deployments, the newest first; ``before`` continues a list after its last id.

    Args:
        session: A reading session.
        robot: Only those of this robot.
        robots: Only those of these robots.
        state: Only those in this state.
        is_void: Void ones instead of those that count.
        before: Public id of the last one of the list so far.
        limit: At most so many.
    """
    is_of_kind = Deployment.void_reason != "" if is_void else Deployment.void_reason == ""
    statement = (
        select(Deployment, Robot.id)
        .join(Robot, Deployment.robot_key == Robot.key)
        .where(is_of_kind)
        .order_by(Deployment.key.desc())
        .limit(limit)
    )
    if robot is not None:
        statement = statement.where(Deployment.robot_key == robot_key(session, robot))
    if robots is not None:
        statement = statement.where(Robot.id.in_(robots))
    if state is not None:
        statement = statement.where(Deployment.state == state)
    if before is not None:
        statement = statement.where(Deployment.key < key_of("deployment", before))
    return [deployment_record(session, row, name) for row, name in session.execute(statement)]


def deployment_in_water(session: Session, robot: str) -> DeploymentRecord | None:
    """Return the deployment that a robot is in, ``None`` for one in the workshop.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = session.scalar(
        select(Deployment).where(
            Deployment.robot_key == robot_key(session, robot),
            Deployment.state == "in_water",
            Deployment.void_reason == "",
        )
    )
    return None if row is None else deployment_record(session, row, robot)


def deployment_at(session: Session, robot: str, at: datetime) -> DeploymentRecord | None:
    """Return the deployment that a robot was in at a moment, ``None`` for the workshop.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = session.scalar(
        select(Deployment)
        .where(
            Deployment.robot_key == robot_key(session, robot),
            Deployment.void_reason == "",
            Deployment.started_at <= at,
            or_(Deployment.ended_at.is_(None), Deployment.ended_at > at),
        )
        .order_by(Deployment.started_at.desc())
        .limit(1)
    )
    return None if row is None else deployment_record(session, row, robot)


def newest_span(session: Session, robot: str) -> LiveSpan | None:
    """Return when a robot was in the water last, ``None`` for one that never was.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    return next(iter(live_spans(session, [key])[key]), None)


def joint_spans(session: Session, robots: Sequence[str]) -> dict[str, LiveSpan]:
    """Return the newest deployments of robots that are, or were last, in the water together.

    Those that last now belong together with every newest one that one of them met; where none
    lasts, the last that ended takes their place.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    keys = robot_keys(session, robots)
    found = live_spans(session, list(keys.values()))
    spans = {robot: found[key][0] for robot, key in keys.items() if found.get(key)}
    if not spans:
        return {}
    lasting = [span for span in spans.values() if span.ended_at is None]
    last = lasting or [max(spans.values(), key=lambda span: span.ended_at or span.started_at)]
    since = min(span.started_at for span in last)
    return {
        robot: span
        for robot, span in spans.items()
        if span.ended_at is None or span.ended_at > since
    }


def deployment_record(session: Session, row: Deployment, robot: str) -> DeploymentRecord:
    """Return a row as it leaves the database."""
    return same(
        DeploymentRecord,
        row,
        id=public_id("deployment", row.key),
        robot=robot,
        people=tuple(row.people),
        site=Site.model_validate(row.site) if row.site else get_robot(session, robot).site,
        variables=tuple(row.variables),
    )
