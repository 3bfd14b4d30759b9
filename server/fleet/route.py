"""The fleet: who there is, how each robot is now, and what it said before."""

import math
from collections.abc import Awaitable
from dataclasses import replace
from typing import Annotated, Literal, TypeVar, cast

import numpy as np
from fastapi import APIRouter, Depends, Query, Response
from pydantic import AwareDatetime, Field
from sqlalchemy.orm import Session

from autonomy.channel import ChannelCatalogue
from autonomy.field.fidelity import fidelity_level
from autonomy.frames import wgs84_from_ned
from autonomy.seawater import DERIVED, can_derive
from autonomy.site import Site
from db.column import microseconds, moments
from db.fault import UnknownIdError
from db.query.fleet.channels import told_counts
from db.query.fleet.robots import (
    RobotExistsError,
    RobotStateError,
    change_robot,
)
from db.query.measured.derived import derivable, derived_places
from db.query.measured.flags_at import flags_at
from db.query.measured.sample_places import SamplePlaces, sample_places
from db.query.measured.samples import sampled_variables
from db.query.measured.telemetry import history, track
from db.query.station.events import add_event
from db.query.storage.told import pruned_of_channel
from robot_link.messages import STATE
from robot_link.station.gateway.address import check_link
from server.access.dependency import Admin, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import DeploymentDep, FoundationDep, cut_to, service
from server.base.problem import FieldError, Problem, conflict, not_found, unprocessable
from server.base.text import Title
from server.base.view import Body, encoded
from server.fleet.dependency import FleetDep, refuse_recording
from server.fleet.panel import FleetViews
from server.fleet.roster import Roster
from server.fleet.status import RobotStatus
from server.fleet.trail import DRIFT_MODES
from server.fleet.view import (
    AnnouncedView,
    RobotView,
    SamplesView,
    StateView,
    ToldChannelView,
    TrackView,
    to_the_public,
)
from server.vehicle.vehicles import Vehicles
from server.water.waters import Waters

router = APIRouter(prefix="/api/robots", tags=["robots"], route_class=IdempotentRoute)

FleetViewsDep = Annotated[FleetViews, Depends(service(FleetViews))]
RosterDep = Annotated[Roster, Depends(service(Roster))]
VehiclesDep = Annotated[Vehicles, Depends(service(Vehicles))]

WatersDep = Annotated[Waters, Depends(service(Waters))]

T = TypeVar("T")
MaxPoints = Annotated[
    int, Query(ge=2, le=20_000, description="Thin the series to at most this many points.")
]
Start = Annotated[AwareDatetime | None, Query(description="First moment; RFC 3339.")]
End = Annotated[AwareDatetime | None, Query(description="Last moment; RFC 3339.")]


class RobotChanges(Body):
    """What is to be changed of a robot."""

    name: Title | None = None
    """What pages call it."""
    protocol: Literal["grace", "mavlink"] | None = None
    """How it speaks: our own program, or standard MAVLink alone."""
    model: str | None = None
    """Key of a vehicle of the catalogue: what holds for the robot from now on."""
    system_id: int | None = Field(default=None, ge=1, le=249)
    """Its MAVLink system id, 1 to 249; no two robots share one."""
    links: list[str] | None = Field(default=None, min_length=1, max_length=8)
    """Addresses of its links, 1 to 8."""
    water: str | None = None
    """Id of the water that it works in from now on."""
    site: Site | None = None
    """A water of its own, in place of one that has an id."""


@router.get("")
async def list_robots(
    caller: Viewer,
    fleet: FleetDep,
    views: FleetViewsDep,
    retired: Annotated[bool, Query(description="Those that are retired, instead.")] = False,
) -> list[RobotView]:
    """Return every robot with what it is doing, when it is heard next, and its worst alarm."""
    statuses = fleet.retired if retired else fleet.statuses
    robots = [status.record.id for status in statuses]
    return [views.robot_view(robot) for robot in robots if caller.rights.sees(robot)]


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
    waters: WatersDep,
    foundation: FoundationDep,
) -> RobotView:
    """Change a robot's name, model, protocol, links or water."""
    status = fleet.status(robot)
    if any(one is not None for one in (changes.system_id, changes.links, changes.protocol)):
        refuse_recording(status, "has no radio")
    given = changes.model_dump(exclude_unset=True, exclude_none=True)
    if changes.model is not None or changes.protocol is not None:
        model = status.record.model if changes.model is None else changes.model
        if status.record.system_id is None:
            vehicles.check_model(model)
        else:
            check_model(model, changes.protocol or status.record.protocol, vehicles)
    if changes.links is not None:
        check_links(changes.links)
    if changes.water is not None:
        refuse_recording(status, "has a water of its own")
        await site_of(changes.water, changes.site, waters)
    at = foundation.clock.now()

    def write(session: Session) -> None:
        change_robot(session, robot, **given)
        text = f"{caller.name} changed {robot}."
        add_event(session, at, "robot.changed", text, robot=robot, data={"fields": list(given)})

    await keep(foundation.store.write(write))
    await roster.refresh(robot)
    return views.robot_view(robot)


@router.get("/{robot}/state")
async def get_state(caller: Viewer, robot: str, views: FleetViewsDep) -> StateView:
    """Return the newest value of every channel, each with its age."""
    view = views.state_view(robot)
    return to_the_public(view) if caller.is_link else view


@router.get("/{robot}/samples", response_model=SamplesView)
async def get_samples(
    caller: Viewer,
    robot: str,
    channel: Annotated[
        str, Query(description="Key of a channel of the state, or of a field variable.")
    ],
    foundation: FoundationDep,
    fleet: FleetDep,
    deployment: DeploymentDep,
    start: Start = None,
    end: End = None,
    max_points: MaxPoints = 2000,
    positions: Annotated[
        bool, Query(description="Say where each was taken; of a field variable only.")
    ] = False,
) -> Response:
    """Return the history of one channel, thinned so that every extreme stays.

    Of a deployment each value has the flag of its quality, if there are any.
    """
    del caller
    thresholds_m = fleet.status(robot).track.thresholds_m
    start, end = cut_to(deployment, robot, start, end)
    store, known = foundation.store, foundation.channels.catalogue
    unit = _unit(channel, known)
    is_derived = channel in DERIVED and await store.query(
        lambda session: derivable(session, robot, channel)
    )
    if is_derived or (positions and channel in known):
        read = derived_places if is_derived else sample_places

        def read_placed(session: Session) -> SamplesView:
            placed = read(session, robot, channel, start, end, max_points)
            pruned = pruned_of_channel(session, robot, channel, start, end)
            view = _placed(robot, channel, unit, placed, thresholds_m)
            return replace(view, is_derived=is_derived, pruned=pruned)

        return encoded(await store.query(read_placed))

    def read_flagged(session: Session) -> SamplesView:
        found = history(session, robot, channel, start, end, max_points)
        flags = None
        if deployment is not None:
            at_us = np.array([microseconds(at) for at in found.measured_at], dtype=np.int64)
            flags = flags_at(session, deployment.id, channel, at_us)
        return SamplesView(
            robot,
            channel,
            unit,
            found.measured_at,
            found.value,
            found.decimated,
            pruned_of_channel(session, robot, channel, start, end),
            received_at=found.received_at,
            flag=None if flags is None else flags.tolist(),
        )

    return encoded(await store.query(read_flagged))


@router.get("/{robot}/channels")
async def list_told_channels(
    caller: Viewer, robot: str, foundation: FoundationDep, fleet: FleetDep
) -> list[ToldChannelView]:
    """Return the channels that a robot has told or announced, and those that follow of them.

    What was announced and not told has 0 samples; what was told and not announced, or by a robot
    that announces nothing, is understood by the catalogue alone.
    """
    del caller
    status, known = fleet.status(robot), foundation.channels.catalogue
    counts = await foundation.store.query(lambda session: told_counts(session, robot))
    placed = await foundation.store.query(lambda session: sampled_variables(session, robot))
    gauges = {key: gauge for key, gauge in STATE.gauges.items() if _tells(status, key)}
    told = [
        ToldChannelView(key, gauge.title, STATE[key].unit, None, is_derived=False, can_map=False)
        for key, gauge in gauges.items()
    ]
    for key, channel in known.items():
        is_derived = can_derive(key, set(placed))
        announced = _announced(status, channel.wire_number)
        if key in counts or is_derived or announced:
            told.append(
                ToldChannelView(
                    key,
                    channel.title,
                    channel.unit,
                    counts.get(key, 0 if announced else None),
                    is_derived,
                    channel.can_map,
                    announced,
                    status.channel_faults.get(channel.wire_number, ""),
                )
            )
    return told + _unknown(status, known)


def _announced(status: RobotStatus, number: int) -> AnnouncedView | None:
    """Return what a robot announced under a number of the wire."""
    announced = status.announced
    row = None if announced is None else announced.table.row(number)
    if announced is None or row is None:
        return None
    return AnnouncedView(
        number=row.number,
        key=row.key,
        unit=row.unit,
        period_s=row.period_s or None,
        version=announced.version,
        since_at=announced.since_at,
        heard_at=announced.heard_at,
    )


def _unknown(status: RobotStatus, known: ChannelCatalogue) -> list[ToldChannelView]:
    """Return what a robot announced and the catalogue does not have."""
    rows = () if status.announced is None else status.announced.table.rows
    return [
        ToldChannelView(
            key=f"#{row.number}",
            title=row.key,
            unit=row.unit,
            samples=0,
            is_derived=False,
            can_map=False,
            announced=_announced(status, row.number),
            problem=status.channel_faults.get(row.number, ""),
        )
        for row in rows
        if known.numbered(row.number) is None
    ]


@router.get("/{robot}/track", response_model=TrackView)
async def get_track(
    caller: Viewer,
    robot: str,
    foundation: FoundationDep,
    fleet: FleetDep,
    deployment: DeploymentDep,
    start: Start = None,
    end: End = None,
    max_points: MaxPoints = 2000,
    arrivals: Annotated[
        bool, Query(description="Say when the station heard of each point.")
    ] = False,
) -> Response:
    """Return where the robot believed to be, with uncertainty and fidelity level."""
    del caller
    site = fleet.status(robot).record.site if deployment is None else deployment.site
    start, end = cut_to(deployment, robot, start, end)
    found, pruned = await foundation.store.query(
        lambda session: (
            track(session, robot, start, end, max_points),
            pruned_of_channel(session, robot, None, start, end),
        )
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
            std_m=[one if math.isfinite(one) else None for one in std_m.tolist()],
            fidelity=fidelity_level(std_m, thresholds_m).tolist(),
            adrift=[mode in DRIFT_MODES for mode in found.mode],
            received_at=moments(found.received_us) if arrivals else None,
            latitude_deg=geodetic[:, 0].tolist(),
            longitude_deg=geodetic[:, 1].tolist(),
            decimated=found.decimated,
            pruned=pruned,
        )
    )


def _placed(
    robot: str, channel: str, unit: str, found: SamplePlaces, thresholds_m: tuple[float, ...]
) -> SamplesView:
    return SamplesView(
        robot=robot,
        channel=channel,
        unit=unit,
        measured_at=found.measured_at,
        value=found.value,
        decimated=found.decimated,
        pruned=[],
        north_m=found.position_ned[:, 0].tolist(),
        east_m=found.position_ned[:, 1].tolist(),
        depth_m=found.position_ned[:, 2].tolist(),
        std_m=found.position_std_m.tolist(),
        fidelity=fidelity_level(found.position_std_m, thresholds_m).tolist(),
        smoothed=found.is_smoothed.tolist(),
    )


def _unit(channel: str, catalogue: ChannelCatalogue) -> str:
    if channel in STATE.gauges:
        return STATE[channel].unit
    if channel in catalogue:
        return catalogue[channel].unit
    known = ", ".join([*STATE.gauges, *catalogue])
    raise not_found(f"There is no channel {channel!r}; there are {known}.")


def check_model(model: str, protocol: str, vehicles: Vehicles) -> None:
    """Refuse a model that is not in the catalogue; another maker's vehicle needs none."""
    if model or protocol == "grace":
        vehicles.check_model(model)


def _tells(status: RobotStatus, key: str) -> bool:
    """Tell whether a robot has told a channel of the state; a recording has at least its depth."""
    return status.state is not None or (status.record.kind == "recorded" and key == "depth_m")


def check_links(links: list[str]) -> None:
    """Refuse links that are none, each by its place in the list."""
    errors: list[FieldError] = []
    for i, uri in enumerate(links):
        try:
            check_link(uri)
        except ValueError as error:
            errors.append(FieldError(loc=["links", i], msg=str(error)))
    if errors:
        raise unprocessable(f"{len(errors)} links are wrong.", errors)


async def site_of(water: str | None, site: Site | None, waters: Waters) -> Site:
    """Return where a robot is to work.

    Raises:
        Problem: 422 if it names no water, or two, or one that there is not; 409 if that is retired.
    """
    if (water is None) == (site is None):
        message = "name the water that the robot works in, or give its site, not both"
        raise unprocessable("1 field is wrong.", [FieldError(loc=["water"], msg=message)])
    if water is None:
        return cast("Site", site)
    try:
        found, _ = await waters.get(water)
    except UnknownIdError as error:
        raise unprocessable(
            "1 field is wrong.", [FieldError(loc=["water"], msg=str(error))]
        ) from error
    if found.retired_at is not None:
        raise conflict(f"{water} is retired; bring it back first.")
    return found.site


async def keep(change: Awaitable[T]) -> T:
    """Return what a change of a robot returns; a refusal becomes a problem of status 409."""
    try:
        return await change
    except (RobotExistsError, RobotStateError) as error:
        raise conflict(str(error)) from error
    except OSError as error:
        raise Problem(503, f"The robot's key cannot be kept: {error.strerror}.") from error
