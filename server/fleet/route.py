"""The fleet: who there is, how each robot is now, and what it said before."""

from collections.abc import Awaitable
from dataclasses import dataclass, replace
from typing import Annotated, Literal, TypeVar

from fastapi import APIRouter, Depends, Query, Request, Response
from pydantic import AwareDatetime, Field, TypeAdapter
from sqlalchemy.orm import Session

from autonomy.field.fidelity import fidelity_level
from autonomy.field.variable import VARIABLES
from autonomy.frames import wgs84_from_ned
from autonomy.site import Site
from db.query.events import add_event
from db.query.robots import (
    RobotExistsError,
    RobotRecord,
    add_robot,
    change_robot,
)
from db.query.sample_places import SamplePlaces, sample_places
from db.query.telemetry import history, track
from db.record import same
from robot_link.messages import STATE, RobotId, SystemId
from robot_link.station.gateway.address import check_link
from server.access.dependency import Admin, Viewer
from server.access.idempotency import IdempotentRoute, keep_answer
from server.base.dependency import FoundationDep, StoreDep, service
from server.base.problem import FieldError, Problem, conflict, not_found, unprocessable
from server.base.text import Title
from server.base.view import Body, encoded
from server.fleet.dependency import FleetDep
from server.fleet.event import SigningChanged
from server.fleet.panel import FleetViews
from server.fleet.recorded import refuse_recording
from server.fleet.roster import Roster
from server.fleet.signing_route import SigningKeyView, shown_key
from server.fleet.trail import DRIFT_MODES
from server.fleet.view import RobotView, SamplesView, StateView, TrackView
from server.vehicle.vehicles import Vehicles

router = APIRouter(prefix="/api/robots", tags=["robots"], route_class=IdempotentRoute)

FleetViewsDep = Annotated[FleetViews, Depends(service(FleetViews))]
RosterDep = Annotated[Roster, Depends(service(Roster))]
VehiclesDep = Annotated[Vehicles, Depends(service(Vehicles))]

T = TypeVar("T")
MaxPoints = Annotated[
    int, Query(ge=2, le=20_000, description="Thin the series to at most this many points.")
]
Start = Annotated[AwareDatetime | None, Query(description="First moment; RFC 3339.")]
End = Annotated[AwareDatetime | None, Query(description="Last moment; RFC 3339.")]


class NewRobot(Body):
    """A robot that the station should know."""

    id: str = Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")
    """Short name: lower-case letters, digits and dashes."""
    name: Title
    """What operators call it."""
    model: str
    """Key of a vehicle of the catalogue, such as ``miniglider``; see `GET /api/vehicles`."""
    system_id: int = Field(ge=1, le=249)
    """Its MAVLink system id."""
    links: list[str] = Field(min_length=1, max_length=8)
    """URIs of its links, the best first, such as ``xbee:///dev/ttyUSB0?baud=115200`` or
    ``rockblock://300234010753370``."""
    site: Site
    """The water that it works in."""
    kind: Literal["real", "simulated"] = "real"
    """Whether it exists in a simulator only."""
    signing: bool = True
    """Whether frames of its radio are signed with a key that is made now; ``false`` for a robot
    that cannot sign, as whom anybody with such a radio can then pose."""


@dataclass(frozen=True, slots=True)
class NewRobotView(RobotView):
    """A robot that was added, with the key that its radio is to sign with."""

    signing_key: SigningKeyView | None
    """Shown here and never again; ``null`` where signing is off, and of a repeated request."""


class RobotChanges(Body):
    """What is to be changed of a robot."""

    name: Title | None = None
    model: str | None = None
    """Key of a vehicle of the catalogue: what holds for the robot from now on."""
    system_id: int | None = Field(default=None, ge=1, le=249)
    links: list[str] | None = Field(default=None, min_length=1, max_length=8)
    site: Site | None = None


@router.get("")
async def list_robots(caller: Viewer, fleet: FleetDep, views: FleetViewsDep) -> list[RobotView]:
    """Return every robot with what it is doing, when it is heard next, and its worst alarm."""
    del caller
    return [views.robot_view(status.record.id) for status in fleet.statuses]


@router.post("", status_code=201)
async def create_robot(
    caller: Admin,
    robot: NewRobot,
    request: Request,
    views: FleetViewsDep,
    roster: RosterDep,
    vehicles: VehiclesDep,
    foundation: FoundationDep,
) -> NewRobotView:
    """Add a robot; the station listens for it at once, and shows its signing key this once."""
    vehicles.check_model(robot.model)
    _check_links(robot.links)
    at = foundation.clock.now()
    secrets = foundation.secrets
    record = same(
        RobotRecord,
        robot,
        id=RobotId(robot.id),
        system_id=SystemId(robot.system_id),
        links=tuple(robot.links),
        created_at=at,
    )

    def write(session: Session) -> bytes | None:
        add_robot(session, record)
        add_event(session, at, "robot.added", f"{caller.name} added {robot.id}.", robot=robot.id)
        if robot.signing:
            return secrets.new_signing_key(robot.id)
        secrets.turn_signing_off(robot.id)
        return None

    key = await _keep(secrets.decide_with(foundation.store, robot.id, write))
    foundation.bus.publish(SigningChanged(record.id))
    await roster.refresh(robot.id)
    added = same(NewRobotView, views.robot_view(robot.id), signing_key=None)
    keep_answer(request, TypeAdapter(NewRobotView).dump_json(added))
    return added if key is None else replace(added, signing_key=shown_key(robot.id, key))


@router.get("/{robot}")
async def get_robot(caller: Viewer, robot: str, views: FleetViewsDep) -> RobotView:
    """Return one robot."""
    del caller
    return views.robot_view(robot)


@router.patch("/{robot}")
async def patch_robot(
    caller: Admin,
    robot: str,
    changes: RobotChanges,
    fleet: FleetDep,
    views: FleetViewsDep,
    roster: RosterDep,
    vehicles: VehiclesDep,
    foundation: FoundationDep,
) -> RobotView:
    """Change a robot's name, model, links or site."""
    status = fleet.status(robot)
    if changes.system_id is not None or changes.links is not None:
        refuse_recording(status, "has no radio")
    given = changes.model_dump(exclude_unset=True, exclude_none=True)
    if changes.model is not None:
        vehicles.check_model(changes.model)
    if changes.links is not None:
        _check_links(changes.links)
    at = foundation.clock.now()

    def write(session: Session) -> None:
        change_robot(session, robot, **given)
        text = f"{caller.name} changed {robot}."
        add_event(session, at, "robot.changed", text, robot=robot, data={"fields": list(given)})

    await _keep(foundation.store.write(write))
    await roster.refresh(robot)
    return views.robot_view(robot)


@router.get("/{robot}/state")
async def get_state(caller: Viewer, robot: str, views: FleetViewsDep) -> StateView:
    """Return the newest value of every channel, each with its age."""
    del caller
    return views.state_view(robot)


@router.get("/{robot}/samples", response_model=SamplesView)
async def get_samples(
    caller: Viewer,
    robot: str,
    channel: Annotated[
        str, Query(description="Key of a channel of the state, or of a field variable.")
    ],
    store: StoreDep,
    fleet: FleetDep,
    start: Start = None,
    end: End = None,
    max_points: MaxPoints = 2000,
    positions: Annotated[
        bool, Query(description="Say where each was taken; of a field variable only.")
    ] = False,
) -> Response:
    """Return the history of one channel, thinned so that every extreme stays."""
    del caller
    thresholds_m = fleet.status(robot).track.thresholds_m
    unit = _unit(channel)
    if positions and channel in VARIABLES:
        placed = await store.query(
            lambda session: sample_places(session, robot, channel, start, end, max_points)
        )
        return encoded(_placed(robot, channel, placed, thresholds_m))
    found = await store.query(
        lambda session: history(session, robot, channel, start, end, max_points)
    )
    return encoded(
        SamplesView(robot, channel, unit, found.measured_at, found.value, found.decimated)
    )


@router.get("/{robot}/track", response_model=TrackView)
async def get_track(
    caller: Viewer,
    robot: str,
    foundation: FoundationDep,
    fleet: FleetDep,
    start: Start = None,
    end: End = None,
    max_points: MaxPoints = 2000,
) -> Response:
    """Return where the robot believed to be, with uncertainty and fidelity level."""
    del caller
    site = fleet.status(robot).record.site
    found = await foundation.store.query(
        lambda session: track(session, robot, start, end, max_points)
    )
    thresholds_m = fleet.status(robot).track.thresholds_m
    positions, std_m = found.position_ned, found.position_std_m
    geodetic = wgs84_from_ned(positions[:, :2], site.origin_latitude_deg, site.origin_longitude_deg)
    return encoded(
        TrackView(
            robot=robot,
            measured_at=found.measured_at,
            north_m=positions[:, 0].tolist(),
            east_m=positions[:, 1].tolist(),
            depth_m=positions[:, 2].tolist(),
            std_m=std_m.tolist(),
            fidelity=fidelity_level(std_m, thresholds_m).tolist(),
            adrift=[mode in DRIFT_MODES for mode in found.mode],
            latitude_deg=geodetic[:, 0].tolist(),
            longitude_deg=geodetic[:, 1].tolist(),
            decimated=found.decimated,
        )
    )


def _placed(
    robot: str, channel: str, found: SamplePlaces, thresholds_m: tuple[float, ...]
) -> SamplesView:
    return SamplesView(
        robot=robot,
        channel=channel,
        unit=_unit(channel),
        measured_at=found.measured_at,
        value=found.value,
        decimated=found.decimated,
        north_m=found.position_ned[:, 0].tolist(),
        east_m=found.position_ned[:, 1].tolist(),
        depth_m=found.position_ned[:, 2].tolist(),
        std_m=found.position_std_m.tolist(),
        fidelity=fidelity_level(found.position_std_m, thresholds_m).tolist(),
        smoothed=found.is_smoothed.tolist(),
    )


def _unit(channel: str) -> str:
    if channel in STATE.gauges:
        return STATE[channel].unit
    if channel in VARIABLES:
        return VARIABLES[channel].unit
    known = ", ".join([*STATE.gauges, *VARIABLES])
    raise not_found(f"There is no channel {channel!r}; there are {known}.")


def _check_links(links: list[str]) -> None:
    errors: list[FieldError] = []
    for i, uri in enumerate(links):
        try:
            check_link(uri)
        except ValueError as error:
            errors.append(FieldError(loc=["links", i], msg=str(error)))
    if errors:
        raise unprocessable(f"{len(errors)} links are wrong.", errors)


async def _keep(change: Awaitable[T]) -> T:
    try:
        return await change
    except RobotExistsError as error:
        raise conflict(str(error)) from error
    except OSError as error:
        raise Problem(503, f"The robot's key cannot be kept: {error.strerror}.") from error
