"""Imported recordings: deployments that have their rows from files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from db.delivery_tables import DeliveryFileRow
from db.fault import StoreError
from db.identity import public_id
from db.query.change import row_of
from db.query.fleet.deployments import DeploymentRecord, get_deployment
from db.query.fleet.robots import get_robot, robot_key
from db.tables import Deployment

_OPEN = ("in_water", "recovered")


class DeploymentExistsError(StoreError):
    """This very recording is there already; the sentence names it."""


class DeploymentClosedError(StoreError):
    """The deployment that the rows belong to was signed, or a file was written of it."""


@dataclass(frozen=True, slots=True)
class ImportedFile:
    """A file that came in."""

    name: str
    sha256: str


def refuse_known(session: Session, robot: str, log: int, files: Sequence[ImportedFile]) -> None:
    """Refuse files that are all kept already.

    Raises:
        DeploymentExistsError: With the deployment that has them.
    """
    key = robot_key(session, robot)
    present = session.scalar(
        select(Deployment.key).where(Deployment.robot_key == key, Deployment.log == log)
    )
    if present is None:
        wanted = {one.sha256 for one in files}
        statement = select(Deployment).where(
            Deployment.robot_key == key, Deployment.void_reason == ""
        )
        for row in session.scalars(statement):
            wanted -= {
                file["sha256"] for one in row.document.get("imports", ()) for file in one["files"]
            }
            if not wanted:
                present = row.key
                break
    if present is not None:
        raise DeploymentExistsError(
            f"This recording is there already, as {public_id('deployment', present)} of {robot}."
        )


def overlapping_deployment(
    session: Session, robot: str, first: datetime, last: datetime
) -> DeploymentRecord | None:
    """Return the newest deployment of a robot that has a part of a stretch of time."""
    found = session.scalar(
        select(Deployment.key)
        .where(
            Deployment.robot_key == robot_key(session, robot),
            Deployment.void_reason == "",
            Deployment.started_at <= last,
            or_(Deployment.ended_at.is_(None), Deployment.ended_at >= first),
        )
        .order_by(Deployment.key.desc())
        .limit(1)
    )
    return None if found is None else get_deployment(session, public_id("deployment", found))


def live_deployments_between(
    session: Session, robot: str, first: datetime, last: datetime
) -> list[DeploymentRecord]:
    """Return the deployments of a robot itself that have a part of a stretch of time, by time."""
    found = session.scalars(
        select(Deployment.key)
        .where(
            Deployment.robot_key == robot_key(session, robot),
            Deployment.kind == "live",
            Deployment.void_reason == "",
            Deployment.started_at <= last,
            or_(Deployment.ended_at.is_(None), Deployment.ended_at > first),
        )
        .order_by(Deployment.started_at)
    )
    return [get_deployment(session, public_id("deployment", one)) for one in found]


def add_recorded_deployment(
    session: Session,
    robot: str,
    *,
    title: str,
    log: int,
    variables: Sequence[str],
    document: Mapping[str, Any],
    rows: int,
    first: datetime,
    last: datetime,
) -> DeploymentRecord:
    """Add a deployment whose samples are those of a log.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    deployment = Deployment(
        robot_key=robot_key(session, robot),
        kind="recorded",
        state="recovered",
        title=title,
        purpose="",
        people=[],
        site=get_robot(session, robot).site.model_dump(mode="json"),
        void_reason="",
        log=log,
        started_at=first,
        ended_at=last,
        rows=rows,
        variables=list(variables),
        document=dict(document),
    )
    session.add(deployment)
    session.flush()
    return get_deployment(session, public_id("deployment", deployment.key))


def refuse_closed(session: Session, deployment: DeploymentRecord) -> None:
    """Refuse a deployment that takes no more rows.

    Raises:
        DeploymentClosedError: If it was reviewed, or a file was written of it.
    """
    if deployment.state not in _OPEN:
        raise DeploymentClosedError(
            f"{deployment.id} is {deployment.state}; reopen it, then import into it."
        )
    key = row_of(session, Deployment, "deployment", deployment.id).key
    written = select(DeliveryFileRow.key).where(DeliveryFileRow.deployment_key == key).limit(1)
    if deployment.kind == "recorded" and session.scalar(written) is not None:
        raise DeploymentClosedError(
            f"A file was written of {deployment.id}, whose times stay; it takes no more rows."
        )


def extend_deployment(
    session: Session,
    deployment: str,
    *,
    variables: Sequence[str],
    imported: Mapping[str, Any],
    rows: int,
    first: datetime,
    last: datetime,
) -> DeploymentRecord:
    """Note that further rows belong to a deployment; of a recorded one the times grow.

    Raises:
        UnknownIdError: If there is no such deployment.
    """
    row = row_of(session, Deployment, "deployment", deployment)
    imports = [*row.document.get("imports", ()), dict(imported)]
    row.document = {**row.document, "imports": imports}
    if row.kind == "recorded":
        row.started_at = min(first, row.started_at or first)
        row.ended_at = max(last, row.ended_at or last)
        row.rows += rows
        row.variables = [*row.variables, *(key for key in variables if key not in row.variables)]
        robot = get_deployment(session, deployment).robot
        row.site = get_robot(session, robot).site.model_dump(mode="json")
    session.flush()
    return get_deployment(session, deployment)


def note_on_deployment(session: Session, deployment: str, document: Mapping[str, Any]) -> None:
    """Add to what is known of a deployment; keys that are there are replaced.

    Raises:
        UnknownIdError: If there is no such deployment.
    """
    row = row_of(session, Deployment, "deployment", deployment)
    row.document = {**row.document, **document}
