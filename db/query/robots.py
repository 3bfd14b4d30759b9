"""The fleet."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from autonomy.site import Site
from db.fault import StoreError, UnknownIdError
from db.record import same, values
from db.tables import Deployment, Robot
from robot_link.messages import RobotId, SystemId


class RobotExistsError(StoreError):
    """Another robot has this id or this system id already."""


@dataclass(frozen=True, slots=True)
class RobotRecord:
    """A robot that the station knows."""

    id: RobotId
    name: str
    model: str
    """Key of ``autonomy.vehicle.config.VEHICLES``, or "" for a recording of something else."""
    kind: str
    """``real``, ``simulated`` or ``recorded``."""
    system_id: SystemId | None
    """MAVLink system id; a recording has none."""
    links: tuple[str, ...]
    """URIs of the transports by which it can be reached, the best first."""
    site: Site
    created_at: datetime

    @property
    def simulated(self) -> bool:
        """Whether the robot exists in the simulator only."""
        return self.kind == "simulated"


def add_robot(session: Session, robot: RobotRecord) -> None:
    """Add a robot; one that is not a recording is deployed from now on.

    Raises:
        RobotExistsError: If its id or its system id is taken; the sentence says which.
    """
    taken = session.scalar(select(Robot.id).where(Robot.id == robot.id))
    if taken is not None:
        raise RobotExistsError(f"There is a robot {robot.id!r} already.")
    if robot.system_id is not None:
        other = session.scalar(select(Robot.id).where(Robot.system_id == robot.system_id))
        if other is not None:
            raise RobotExistsError(f"System id {robot.system_id} belongs to {other!r} already.")
    row = Robot(
        links=list(robot.links),
        site=robot.site.model_dump(mode="json"),
        **values(robot, but=["links", "site"]),
    )
    session.add(row)
    session.flush()
    if robot.kind != "recorded":
        session.add(
            Deployment(
                robot_key=row.key,
                kind="live",
                title=f"{robot.name}, from {robot.created_at:%Y-%m-%d}",
                started_at=robot.created_at,
                rows=0,
                variables=[],
                document={},
            )
        )
        session.flush()


def list_robots(session: Session) -> list[RobotRecord]:
    """Return every robot in the order in which they were added."""
    return [_record(row) for row in session.scalars(select(Robot).order_by(Robot.key))]


def get_robot(session: Session, robot: str) -> RobotRecord:
    """Return one robot.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(_row(session, robot))


def change_robot(session: Session, robot: str, **changes: Any) -> RobotRecord:  # noqa: ANN401 - the fields differ in type
    """Change ``name``, ``model``, ``system_id``, ``links`` or ``site`` of a robot.

    Raises:
        UnknownIdError: If there is none of this id.
        RobotExistsError: If the new system id belongs to another robot.
    """
    row = _row(session, robot)
    system_id = changes.get("system_id")
    if system_id is not None:
        other = session.scalar(
            select(Robot.id).where(Robot.system_id == system_id, Robot.key != row.key)
        )
        if other is not None:
            raise RobotExistsError(f"System id {system_id} belongs to {other!r} already.")
    for field, value in changes.items():
        match field:
            case "site":
                row.site = Site.model_validate(value).model_dump(mode="json")
            case "links":
                row.links = list(value)
            case "name" | "model" | "system_id":
                setattr(row, field, value)
            case _:
                raise ValueError(f"{field} of a robot cannot be changed")
    session.flush()
    return _record(row)


def robot_key(session: Session, robot: str) -> int:
    """Return the database's key of a robot, for the queries of this package.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    key = session.scalar(select(Robot.key).where(Robot.id == robot))
    if key is None:
        raise UnknownIdError("robot", robot)
    return key


def _row(session: Session, robot: str) -> Robot:
    row = session.scalar(select(Robot).where(Robot.id == robot))
    if row is None:
        raise UnknownIdError("robot", robot)
    return row


def _record(row: Robot) -> RobotRecord:
    return same(
        RobotRecord,
        row,
        id=RobotId(row.id),
        system_id=None if row.system_id is None else SystemId(row.system_id),
        links=tuple(row.links),
        site=Site.model_validate(row.site),
    )
