"""Robots join the fleet, retire, and come back."""

from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal

from fastapi import APIRouter, Request
from pydantic import Field, TypeAdapter, model_validator
from sqlalchemy.orm import Session

from autonomy.site import Site
from db.query.fleet.deployment_change import add_deployment
from db.query.fleet.robots import RobotRecord, add_robot, first_title, restore_robot, retire_robot
from db.query.station.events import add_event
from db.record import same
from robot_link.messages import RobotId, SystemId
from server.access.dependency import Admin
from server.access.idempotency import IdempotentRoute, keep_answer
from server.base.dependency import FoundationDep
from server.base.secret import SecretStore
from server.base.settings import LINK_FOLDER
from server.base.text import Name, Title
from server.base.view import Body
from server.fleet.dependency import FleetDep
from server.fleet.event import SigningChanged
from server.fleet.route import (
    FleetViewsDep,
    RosterDep,
    VehiclesDep,
    WatersDep,
    check_links,
    check_model,
    keep,
    site_of,
)
from server.fleet.signing_route import SigningKeyView, shown_key
from server.fleet.view import RobotView

router = APIRouter(prefix="/api/robots", tags=["robots"], route_class=IdempotentRoute)


class FirstDeployment(Body):
    """What is known of the deployment that begins when a robot is added."""

    name: Title | None = None
    """By default the robot's name and the day."""
    purpose: str = Field(default="", max_length=500)
    """What it is for."""
    people: list[Name] = Field(default_factory=list[str], max_length=50)
    """Who takes part."""


class NewRobot(Body):
    """A robot that the station should know."""

    id: str = Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")
    """Short name: lower-case letters, digits and dashes."""
    name: Title
    """What operators call it."""
    protocol: Literal["grace", "mavlink"] = "grace"
    """What it speaks by radio; ``mavlink`` is any vehicle of another maker."""
    model: str = ""
    """Key of a vehicle of the catalogue, such as ``miniglider``; see `GET /api/vehicles`. A robot
    of protocol ``mavlink``, and a recording, may have none."""
    system_id: int | None = Field(default=None, ge=1, le=249)
    """Its MAVLink system id; a recording has none."""
    links: list[str] = Field(default_factory=list[str], max_length=8)
    """URIs of its links, the best first, such as ``xbee:///dev/ttyUSB0?baud=115200`` or
    ``rockblock://300234010753370``; a recording has none. A simulated robot of protocol ``grace``
    without any has the radio that `grace simulate` makes for it."""
    water: str | None = None
    """Id of the water that it works in; see `GET /api/waters`."""
    site: Site | None = None
    """A water of its own, where no ``water`` is named; one that is a water's document is that."""
    kind: Literal["real", "simulated", "recorded"] = "real"
    """Whether it exists in a simulator only, or is a name under which recordings are kept."""
    signing: bool | None = None
    """Whether frames of its radio are signed with a key that is made now; ``false`` for a robot
    that cannot sign, as whom anybody with such a radio can then pose. By default robots of protocol
    ``grace`` sign and others do not."""
    deployment: FirstDeployment | None = Field(default_factory=FirstDeployment)
    """Its first deployment, which begins now; ``null`` leaves it in the workshop."""

    @model_validator(mode="after")
    def _has_what_its_kind_needs(self) -> "NewRobot":
        if self.kind == "recorded":
            if self.links or self.system_id is not None:
                raise ValueError("a recording has neither system id nor links")
        elif self.system_id is None:
            raise ValueError("a robot needs a system id")
        elif not self.links and (self.kind != "simulated" or self.protocol != "grace"):
            raise ValueError("a robot needs a link")
        return self

    @property
    def is_signing(self) -> bool:
        """Whether its radio is to be signed."""
        by_default = self.protocol == "grace" if self.signing is None else self.signing
        return by_default and self.kind != "recorded"


def record_of(robot: NewRobot, site: Site, at: datetime) -> RobotRecord:
    """Return what the database keeps of a new robot."""
    return same(
        RobotRecord,
        robot,
        id=RobotId(robot.id),
        system_id=None if robot.system_id is None else SystemId(robot.system_id),
        links=tuple(robot.links),
        site=site,
        created_at=at,
        retired_at=None,
        former_system_id=None,
    )


def write_added(
    session: Session, robot: NewRobot, record: RobotRecord, secrets: SecretStore, by: str
) -> bytes | None:
    """Add a robot with its first deployment and its event; decide how it signs.

    For a change of ``SecretStore.decide_with``.

    Returns:
        Its signing key; None where frames are not signed.

    Raises:
        RobotExistsError: If its id, its system id or one of its modems is taken.
    """
    at, first = record.created_at, robot.deployment if robot.kind != "recorded" else None
    add_robot(session, record, is_deployed=False)
    if first is not None:
        add_deployment(
            session,
            robot.id,
            title=first.name or first_title(robot.name, at),
            purpose=first.purpose,
            people=first.people,
            started_at=at,
        )
    add_event(session, at, "robot.added", f"{by} added {robot.id}.", robot=robot.id)
    if robot.is_signing:
        return secrets.new_signing_key(robot.id)
    secrets.turn_signing_off(robot.id)
    return None


def write_retired(session: Session, robot: str, at: datetime, by: str) -> None:
    """Retire a robot, with its event.

    Raises:
        UnknownIdError: If there is none of this id.
        RobotStateError: If it is retired, or in the water.
    """
    retire_robot(session, robot, at)
    add_event(session, at, "robot.retired", f"{by} retired {robot}.", robot=robot)


def write_restored(session: Session, robot: str, at: datetime, by: str) -> None:
    """Bring a robot back, with its event.

    Raises:
        UnknownIdError: If there is none of this id.
        RobotStateError: If it is not retired.
        RobotExistsError: If its system id or one of its modems is another's by now.
    """
    restore_robot(session, robot)
    add_event(session, at, "robot.restored", f"{by} brought {robot} back.", robot=robot)


@dataclass(frozen=True, slots=True)
class NewRobotView(RobotView):
    """A robot that was added, with the key that its radio is to sign with."""

    signing_key: SigningKeyView | None
    """Shown here and never again; ``null`` where signing is off, and of a repeated request."""


@router.post("", status_code=201)
async def create_robot(
    caller: Admin,
    robot: NewRobot,
    request: Request,
    views: FleetViewsDep,
    roster: RosterDep,
    vehicles: VehiclesDep,
    waters: WatersDep,
    foundation: FoundationDep,
) -> NewRobotView:
    """Add a robot; the station listens for it at once, and shows its signing key this once."""
    if robot.kind != "recorded" or robot.model:
        check_model(robot.model, robot.protocol, vehicles)
    if robot.kind == "simulated" and not robot.links:
        radio = foundation.settings.data_dir.resolve() / LINK_FOLDER / robot.id
        robot = robot.model_copy(update={"links": [f"xbee://{radio}"]})
    check_links(robot.links)
    site = await site_of(robot.water, robot.site, waters)
    record = record_of(robot, site, foundation.clock.now())
    secrets = foundation.secrets

    def write(session: Session) -> bytes | None:
        return write_added(session, robot, record, secrets, caller.name)

    key = await keep(secrets.decide_with(foundation.store, robot.id, write))
    foundation.bus.publish(SigningChanged(record.id))
    await roster.refresh(robot.id)
    added = same(NewRobotView, views.robot_view(robot.id), signing_key=None)
    keep_answer(request, TypeAdapter(NewRobotView).dump_json(added))
    return added if key is None else replace(added, signing_key=shown_key(robot.id, key))


@router.post("/{robot}/retire")
async def retire(
    caller: Admin,
    robot: str,
    fleet: FleetDep,
    views: FleetViewsDep,
    roster: RosterDep,
    foundation: FoundationDep,
) -> RobotView:
    """Take a robot out of the fleet: its system id and links become free, its past stays.

    409 while it is in the water.
    """
    fleet.status(robot)
    at = foundation.clock.now()

    def write(session: Session) -> None:
        write_retired(session, robot, at, caller.name)

    await keep(foundation.store.write(write))
    await roster.refresh(robot)
    return views.robot_view(robot)


@router.post("/{robot}/restore")
async def restore(
    caller: Admin,
    robot: str,
    fleet: FleetDep,
    views: FleetViewsDep,
    roster: RosterDep,
    foundation: FoundationDep,
) -> RobotView:
    """Bring a retired robot back into the workshop.

    409 if its system id or one of its modems is another's by now; the answer names it.
    """
    fleet.status(robot)
    at = foundation.clock.now()

    def write(session: Session) -> None:
        write_restored(session, robot, at, caller.name)

    await keep(foundation.store.write(write))
    await roster.refresh(robot)
    return views.robot_view(robot)
