"""The fleet."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal, cast

from sqlalchemy import select
from sqlalchemy.orm import Session

from autonomy.site import Site
from db.fault import StoreError, UnknownIdError
from db.query.fleet.waters import row_of_site, water_row
from db.record import same, values
from db.tables import Deployment, Robot
from db.water_tables import WaterRow
from robot_link.messages import RobotId, SystemId
from robot_link.station.gateway.address import own_end

Protocol = Literal["grace", "mavlink"]
"""What a robot speaks by radio: this project's dialect, or standard MAVLink alone."""


class RobotExistsError(StoreError):
    """Another robot has this id, this system id or this modem already."""


class RobotStateError(StoreError):
    """The robot is retired, or in the water, and cannot do this then."""


@dataclass(frozen=True, slots=True)
class RobotRecord:
    """A robot that the station knows."""

    id: RobotId
    name: str
    model: str
    """Key of ``autonomy.vehicle.config.VEHICLES``; "" for a recording of something else, and for a
    MAVLink vehicle that the catalogue does not know."""
    kind: str
    """``real``, ``simulated`` or ``recorded``."""
    system_id: SystemId | None
    """MAVLink system id; a recording has none."""
    links: tuple[str, ...]
    """URIs of the transports by which it can be reached, the best first."""
    site: Site
    """The water that it works in."""
    created_at: datetime
    protocol: Protocol = "grace"
    water: str | None = None
    """Id of the water whose document ``site`` is; None where it is the robot's own."""
    retired_at: datetime | None = None
    """Since when it is retired, and has neither system id nor links that are served."""
    former_system_id: int | None = None
    """Of a retired robot."""

    @property
    def simulated(self) -> bool:
        """Whether the robot exists in the simulator only."""
        return self.kind == "simulated"

    @property
    def is_foreign(self) -> bool:
        """Whether it speaks standard MAVLink alone: a vehicle of another maker."""
        return self.protocol == "mavlink"


def add_robot(session: Session, robot: RobotRecord, *, is_deployed: bool = True) -> None:
    """Add a robot.

    Args:
        session: A session of a change.
        robot: The robot.
        is_deployed: Whether its first deployment begins at once; it is in the workshop otherwise.
            A recording is never deployed.

    A site that is the document of a water puts the robot there.

    Raises:
        RobotExistsError: If its id, its system id or one of its modems is taken; the sentence says
            by whom.
        UnknownIdError: If it names a water that there is not.
        WaterInUseError: If it names a retired one.
    """
    taken = session.scalar(select(Robot.id).where(Robot.id == robot.id))
    if taken is not None:
        raise RobotExistsError(f"There is a robot {robot.id!r} already.")
    _refuse_taken(session, robot.id, robot.system_id, robot.links)
    row = Robot(links=list(robot.links), **values(robot, but=["links", "site", "water"]))
    if robot.water is not None:
        _put_into_water(session, row, robot.water)
    else:
        _put_at_site(session, row, robot.site)
    session.add(row)
    session.flush()
    if is_deployed and robot.kind != "recorded":
        session.add(
            Deployment(
                robot_key=row.key,
                kind="live",
                state="in_water",
                title=first_title(robot.name, robot.created_at),
                purpose="",
                people=[],
                site={},
                started_at=robot.created_at,
                void_reason="",
                rows=0,
                variables=[],
                document={},
            )
        )
        session.flush()


def first_title(name: str, at: datetime) -> str:
    """Return what a deployment is called to which nobody gave a name."""
    return f"{name}, from {at:%Y-%m-%d}"


def retire_robot(session: Session, robot: str, at: datetime) -> RobotRecord:
    """Retire a robot: its system id and links become free, its past stays.

    Raises:
        UnknownIdError: If there is none of this id.
        RobotStateError: If it is retired, or in the water.
    """
    row = _row(session, robot)
    if row.retired_at is not None:
        raise RobotStateError(f"{robot} is retired already.")
    in_water = session.scalar(
        select(Deployment.title).where(
            Deployment.robot_key == row.key,
            Deployment.state == "in_water",
            Deployment.void_reason == "",
        )
    )
    if in_water is not None:
        raise RobotStateError(f"{robot} is in the water ({in_water}); end that deployment first.")
    row.retired_at, row.former_system_id, row.system_id = at, row.system_id, None
    session.flush()
    return get_robot(session, robot)


def restore_robot(session: Session, robot: str) -> RobotRecord:
    """Bring a retired robot back, into the workshop.

    Raises:
        UnknownIdError: If there is none of this id.
        RobotStateError: If it is not retired.
        RobotExistsError: If its system id or one of its modems is another's by now.
    """
    row = _row(session, robot)
    if row.retired_at is None:
        raise RobotStateError(f"{robot} is not retired.")
    _refuse_taken(session, robot, row.former_system_id, row.links)
    row.system_id, row.former_system_id, row.retired_at = row.former_system_id, None, None
    session.flush()
    return get_robot(session, robot)


def list_robots(session: Session) -> list[RobotRecord]:
    """Return every robot in the order in which they were added."""
    rows = session.scalars(select(Robot).order_by(Robot.key)).all()
    waters = _waters(session, {row.water_key for row in rows})
    return [_record(row, waters) for row in rows]


def get_robot(session: Session, robot: str) -> RobotRecord:
    """Return one robot.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row = _row(session, robot)
    return _record(row, _waters(session, {row.water_key}))


def change_robot(session: Session, robot: str, **changes: Any) -> RobotRecord:  # noqa: ANN401 - the fields differ in type
    """Change ``name``, ``model``, ``protocol``, ``system_id``, ``links``, ``water`` or ``site``.

    Raises:
        UnknownIdError: If there is no robot, or no water, of this id.
        WaterInUseError: If the water is retired.
        RobotStateError: If the robot is retired.
        RobotExistsError: If the new system id, or a modem, belongs to another robot.
    """
    row = _row(session, robot)
    if row.retired_at is not None:
        raise RobotStateError(f"{robot} is retired; bring it back first.")
    _refuse_taken(session, robot, changes.get("system_id"), changes.get("links", ()))
    for field, value in changes.items():
        match field:
            case "site":
                _put_at_site(session, row, Site.model_validate(value))
            case "water":
                _put_into_water(session, row, value)
            case "links":
                row.links = list(value)
            case "name" | "model" | "system_id" | "protocol":
                setattr(row, field, value)
            case _:
                raise ValueError(f"{field} of a robot cannot be changed")
    session.flush()
    return _record(row, _waters(session, {row.water_key}))


def robot_key(session: Session, robot: str) -> int:
    """Return the database's key of a robot, for the queries of this package.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    key = session.scalar(select(Robot.key).where(Robot.id == robot))
    if key is None:
        raise UnknownIdError("robot", robot)
    return key


def robot_keys(session: Session, robots: Collection[str]) -> dict[str, int]:
    """Return the database's keys of robots, in their order.

    Raises:
        UnknownIdError: If there is none of an id.
    """
    rows = session.execute(select(Robot.id, Robot.key).where(Robot.id.in_(robots)))
    known = {robot: key for robot, key in rows}  # noqa: C416 - rows are no pairs to the checker
    for robot in robots:
        if robot not in known:
            raise UnknownIdError("robot", robot)
    return {robot: known[robot] for robot in robots}


def _refuse_taken(
    session: Session, robot: str, system_id: int | None, links: Iterable[str]
) -> None:
    """Refuse a system id or a modem of another robot; radios are shared by many."""
    if system_id is not None:
        other = session.scalar(
            select(Robot.id).where(Robot.system_id == system_id, Robot.id != robot)
        )
        if other is not None:
            raise RobotExistsError(f"System id {system_id} belongs to {other!r} already.")
    wanted = {end for uri in links if (end := own_end(uri)) is not None}
    if not wanted:
        return
    others = select(Robot).where(Robot.retired_at.is_(None), Robot.id != robot)
    for row in session.scalars(others):
        shared = wanted & {own_end(uri) for uri in row.links}
        if shared:
            raise RobotExistsError(f"{min(map(str, shared))} belongs to {row.id!r} already.")


def _row(session: Session, robot: str) -> Robot:
    row = session.scalar(select(Robot).where(Robot.id == robot))
    if row is None:
        raise UnknownIdError("robot", robot)
    return row


def _put_into_water(session: Session, row: Robot, water: str) -> None:
    row.water_key, row.site = water_row(session, water).key, {}


def _put_at_site(session: Session, row: Robot, site: Site) -> None:
    known = None if row.kind == "recorded" else row_of_site(session, site)
    row.water_key = None if known is None else known.key
    row.site = site.model_dump(mode="json") if known is None else {}


def _waters(session: Session, keys: set[int | None]) -> dict[int, tuple[str, Site]]:
    """Return id and document of waters by their keys."""
    rows = session.scalars(select(WaterRow).where(WaterRow.key.in_(keys - {None})))
    return {row.key: (row.id, Site.model_validate(row.document)) for row in rows}


def _record(row: Robot, waters: Mapping[int, tuple[str, Site]]) -> RobotRecord:
    water, site = None, None
    if row.water_key is not None:
        water, site = waters[row.water_key]
    return same(
        RobotRecord,
        row,
        id=RobotId(row.id),
        system_id=None if row.system_id is None else SystemId(row.system_id),
        links=tuple(row.links),
        site=Site.model_validate(row.site) if site is None else site,
        water=water,
        protocol=cast("Protocol", row.protocol),
    )
