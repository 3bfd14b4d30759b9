"""What changes a deployment: it is planned, begins, ends, is split, corrected, or made void.

===================  ======================  ==============================================
from                 step                    to
===================  ======================  ==============================================
(none)               ``add_deployment``      planned; with a start in_water, with both recovered
planned              ``begin_deployment``    in_water
in_water             ``end_deployment``      recovered
recovered            ``review_deployment``   reviewed: a named person looked at its data
reviewed             ``deliver_deployment``  delivered: its data were handed over
reviewed, delivered  ``reopen_deployment``   recovered, with a reason
any                  ``void_deployment``     the same, void: it holds nothing any more
===================  ======================  ==============================================

Imported recordings are recovered from the beginning. Deployments of one robot never overlap.
What a robot said belongs to one by its time alone, so every change of times moves nothing but the
counts of its samples.
"""

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.delivery_tables import DeliveryFileRow
from db.fault import StoreError
from db.identity import public_id
from db.query.change import row_and_robot
from db.query.fleet.deployments import DeploymentRecord, deployment_record
from db.query.fleet.robots import get_robot
from db.query.measured.samples import sampled_variables
from db.tables import Deployment, Robot

BEGUN = ("in_water", "recovered")
"""States whose times may be corrected, as long as no file was written: nobody signed them yet."""
STATES = ("planned", "in_water", "recovered", "reviewed", "delivered")
"""Every state, in the order of a deployment's life."""


class DeploymentStateError(StoreError):
    """The deployment is not in a state from which this step leads on."""


class DeploymentOverlapError(StoreError):
    """Another deployment of the robot has this time; the sentence names it."""


class DeploymentTimesError(StoreError):
    """The times do not fit together."""


def add_deployment(
    session: Session,
    robot: str,
    *,
    title: str,
    purpose: str = "",
    people: Sequence[str] = (),
    started_at: datetime | None = None,
    ended_at: datetime | None = None,
) -> DeploymentRecord:
    """Plan a deployment; with a start it has begun, with an end it is over.

    Raises:
        DeploymentStateError: If the robot is retired or a recording.
        DeploymentTimesError: If the end is not after the start.
        DeploymentOverlapError: If another deployment of the robot has this time.
    """
    if started_at is None and ended_at is not None:
        raise DeploymentTimesError("A deployment that ended has begun: say when.")
    owner = session.scalar(select(Robot).where(Robot.id == robot))
    if owner is None or owner.kind == "recorded":
        raise DeploymentStateError(f"{robot} is a recording; it is never in the water.")
    if owner.retired_at is not None:
        raise DeploymentStateError(f"{robot} is retired; bring it back first.")
    row = Deployment(
        robot_key=owner.key,
        kind="live",
        state="planned",
        title=title,
        purpose=purpose,
        people=list(people),
        site={},
        void_reason="",
        rows=0,
        variables=[],
        document={},
    )
    session.add(row)
    session.flush()
    if started_at is not None:
        _set_times(session, row, robot, started_at, ended_at)
    return deployment_record(session, row, robot)


def begin_deployment(session: Session, deployment: str, at: datetime) -> DeploymentRecord:
    """Begin a planned deployment.

    Raises:
        UnknownIdError: If there is none of this id.
        DeploymentStateError: If it is not planned.
        DeploymentOverlapError: If another deployment of the robot has this time.
    """
    row, robot = _row(session, deployment, "planned")
    if get_robot(session, robot).retired_at is not None:
        raise DeploymentStateError(f"{robot} is retired; bring it back first.")
    _set_times(session, row, robot, at, None)
    return deployment_record(session, row, robot)


def end_deployment(session: Session, deployment: str, at: datetime) -> DeploymentRecord:
    """End a deployment; from then on its robot is in the workshop.

    Raises:
        UnknownIdError: If there is none of this id.
        DeploymentStateError: If the robot is not in the water.
        DeploymentTimesError: If the end is not after the start.
    """
    row, robot = _row(session, deployment, "in_water")
    _set_times(session, row, robot, row.started_at, at)
    return deployment_record(session, row, robot)


def split_deployment(
    session: Session, deployment: str, at: datetime, title: str
) -> tuple[DeploymentRecord, DeploymentRecord]:
    """End a deployment at a moment within it and let another go on from there.

    Raises:
        UnknownIdError: If there is none of this id.
        DeploymentStateError: If it has not begun, is a recording, or a file was made of it.
        DeploymentTimesError: If the moment is not within it.
    """
    row, robot = _row(session, deployment, *BEGUN)
    _refuse_written(session, row, deployment)
    end = row.ended_at
    if row.started_at is None or at <= row.started_at or (end is not None and at >= end):
        raise DeploymentTimesError(f"{at:%Y-%m-%d %H:%M:%S}Z is not within {deployment}.")
    site = deployment_record(session, row, robot).site.model_dump(mode="json")
    row.state, row.ended_at, row.site = "recovered", at, site
    other = Deployment(
        robot_key=row.robot_key,
        kind=row.kind,
        state="planned",
        title=title,
        purpose=row.purpose,
        people=list(row.people),
        site={} if end is None else site,
        void_reason="",
        rows=0,
        variables=[],
        document={},
    )
    session.add(other)
    session.flush()
    _set_times(session, other, robot, at, end)
    return deployment_record(session, row, robot), deployment_record(session, other, robot)


def correct_deployment(
    session: Session,
    deployment: str,
    **changes: Any,  # noqa: ANN401 - the fields differ in type
) -> DeploymentRecord:
    """Change ``title``, ``purpose``, ``people``, ``started_at`` or ``ended_at`` of a deployment.

    Raises:
        UnknownIdError: If there is none of this id.
        DeploymentStateError: If it is void, or its times cannot be changed any more.
        DeploymentTimesError: If the end is not after the start, or it has not ended yet.
        DeploymentOverlapError: If another deployment of the robot has this time.
    """
    row, robot = row_and_robot(session, Deployment, "deployment", deployment)
    _refuse_void(row, deployment)
    for field in ("title", "purpose", "people"):
        if field in changes:
            value = changes.pop(field)
            setattr(row, field, list(value) if field == "people" else value)
    if changes.keys() - {"started_at", "ended_at"}:
        raise ValueError(f"{', '.join(changes)} of a deployment cannot be changed")
    if changes:
        _refuse_state(row, deployment, BEGUN)
        _refuse_written(session, row, deployment)
        if "ended_at" in changes and row.ended_at is None:
            raise DeploymentTimesError(f"{deployment} has not ended yet; end it first.")
        started_at = changes.get("started_at", row.started_at)
        _set_times(session, row, robot, started_at, changes.get("ended_at", row.ended_at))
    session.flush()
    return deployment_record(session, row, robot)


def review_deployment(
    session: Session, deployment: str, note: str, at: datetime, by: str
) -> DeploymentRecord:
    """Sign that the data of a deployment were looked at, and keep how many measurements there were.

    Raises:
        UnknownIdError: If there is none of this id.
        DeploymentStateError: If it is not recovered.
    """
    row, robot = _any_row(session, deployment, "recovered")
    seen = deployment_record(session, row, robot)
    samples = sampled_variables(session, robot, start=seen.begun_at, end=seen.last_at, log=seen.log)
    signature = {"by": by, "at": at.isoformat(), "note": note, "samples": sum(samples.values())}
    _sign(session, row, "reviewed", "review", signature)
    return deployment_record(session, row, robot)


def deliver_deployment(
    session: Session, deployment: str, to: str, at: datetime, by: str
) -> DeploymentRecord:
    """Note to whom the data of a deployment were handed over.

    Raises:
        UnknownIdError: If there is none of this id.
        DeploymentStateError: If it is not reviewed.
    """
    row, robot = _any_row(session, deployment, "reviewed")
    _sign(session, row, "delivered", "delivery", {"by": by, "at": at.isoformat(), "note": to})
    return deployment_record(session, row, robot)


def reopen_deployment(session: Session, deployment: str) -> DeploymentRecord:
    """Take the signatures back, so that the deployment is reviewed anew.

    Raises:
        UnknownIdError: If there is none of this id.
        DeploymentStateError: If it is neither reviewed nor delivered.
    """
    row, robot = _any_row(session, deployment, "reviewed", "delivered")
    _sign(session, row, "recovered", "review", None)
    _sign(session, row, "recovered", "delivery", None)
    return deployment_record(session, row, robot)


def void_deployment(
    session: Session, deployment: str, reason: str, at: datetime
) -> DeploymentRecord:
    """Hide a deployment that was made by mistake; what its robot said then belongs to none.

    Raises:
        UnknownIdError: If there is none of this id.
        DeploymentStateError: If it is void already.
    """
    row, robot = row_and_robot(session, Deployment, "deployment", deployment)
    _refuse_void(row, deployment)
    row.void_reason = reason
    if row.state == "in_water":
        row.state, row.ended_at = "recovered", at
        row.site = get_robot(session, robot).site.model_dump(mode="json")
    session.flush()
    return deployment_record(session, row, robot)


def _row(session: Session, deployment: str, *states: str) -> tuple[Deployment, str]:
    """Return the row of a live deployment that counts and is in one of these states."""
    row, robot = row_and_robot(session, Deployment, "deployment", deployment)
    _refuse_void(row, deployment)
    _refuse_state(row, deployment, states)
    return row, robot


def _any_row(session: Session, deployment: str, *states: str) -> tuple[Deployment, str]:
    """Return the row of a deployment, live or recorded, that is in one of these states."""
    row, robot = row_and_robot(session, Deployment, "deployment", deployment)
    _refuse_void(row, deployment)
    _refuse_other_state(row, deployment, states)
    return row, robot


def _sign(
    session: Session, row: Deployment, state: str, key: str, signature: Mapping[str, Any] | None
) -> None:
    """Move a deployment and keep who did it, when, and what they said."""
    kept = {name: value for name, value in row.document.items() if name != key}
    row.state, row.document = state, kept if signature is None else {**kept, key: signature}
    session.flush()


def _refuse_void(row: Deployment, deployment: str) -> None:
    if row.void_reason:
        raise DeploymentStateError(f"{deployment} is void: {row.void_reason}")


def _refuse_state(row: Deployment, deployment: str, states: Sequence[str]) -> None:
    if row.kind != "live":
        raise DeploymentStateError(f"{deployment} is a recording; its times are those of its rows.")
    _refuse_other_state(row, deployment, states)


def _refuse_written(session: Session, row: Deployment, deployment: str) -> None:
    """Refuse other times once a file was written: its name tells when the deployment began."""
    written = select(DeliveryFileRow.name).where(DeliveryFileRow.deployment_key == row.key)
    name = session.scalar(written.limit(1))
    if name is not None:
        raise DeploymentStateError(
            f"{deployment} keeps its times: {name} was written of it. Void it and note another."
        )


def _refuse_other_state(row: Deployment, deployment: str, states: Sequence[str]) -> None:
    if row.state not in states:
        wanted = " or ".join(states).replace("_", " ")
        raise DeploymentStateError(
            f"{deployment} is {row.state.replace('_', ' ')}, and would have to be {wanted}."
        )


def _set_times(
    session: Session,
    row: Deployment,
    robot: str,
    started_at: datetime | None,
    ended_at: datetime | None,
) -> None:
    """Set both times, and with them the state; refuse those of another deployment."""
    if started_at is None or (ended_at is not None and ended_at <= started_at):
        raise DeploymentTimesError("A deployment ends after it began.")
    others = session.scalars(
        select(Deployment).where(
            Deployment.robot_key == row.robot_key,
            Deployment.key != row.key,
            Deployment.kind == "live",
            Deployment.void_reason == "",
            Deployment.started_at.is_not(None),
        )
    )
    for other in others:
        begins_before = ended_at is None or other.started_at is None or other.started_at < ended_at
        if begins_before and (other.ended_at is None or other.ended_at > started_at):
            until = "now" if other.ended_at is None else f"{other.ended_at:%Y-%m-%d %H:%M}Z"
            raise DeploymentOverlapError(
                f"{robot} is in the water in {public_id('deployment', other.key)} "
                f"({other.title}), from {other.started_at:%Y-%m-%d %H:%M}Z to {until}."
            )
    row.started_at, row.ended_at = started_at, ended_at
    row.state = "in_water" if ended_at is None else "recovered"
    if ended_at is not None and not row.site:
        row.site = get_robot(session, robot).site.model_dump(mode="json")
    session.flush()
