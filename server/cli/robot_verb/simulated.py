"""Robots of a team in the simulator: those that a station knows and nobody delivered."""

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from sqlalchemy.orm import Session

from autonomy.site import Site
from autonomy.vehicle.config import VEHICLES, Vehicle
from db.query.fleet.robots import RobotRecord, list_robots
from db.query.fleet.vehicles import get_vehicle
from robot_link.messages import RobotId
from robot_link.transport.datagram import Address
from server.base.vehicle_catalogue import entry_of, nearest_built_in
from server.cli.data import open_store, settings_of
from server.cli.failure import CommandError
from simulator.fleet import FLEET, RobotDefinition, expanded, is_known

_TRIES = 400
"""Places of a water among which the one farthest from its shore is sought."""
_LEAST_FLOOR_SHARE = 0.3
"""A robot begins where the floor is at least so deep, of the deepest."""


def admit_own(folder: Path, names: Sequence[str]) -> tuple[RobotId, ...]:
    """Let the simulator know the robots among ``names`` that only the station of a folder knows.

    Each is what the station has of it: its vehicle, its water as it goes on board, its system id.
    Instruments and radio are those of the delivered robot that is nearest in mass.

    Returns:
        Those that were made known.

    Raises:
        CommandError: If the station has no such robot, or one that cannot be simulated.
    """
    wanted = [name for name in expanded(names) if not is_known(name)]
    if not wanted:
        return ()

    def read(session: Session) -> list[RobotDefinition]:
        known = {robot.id: robot for robot in list_robots(session)}
        return [_definition(session, _found(known, name)) for name in wanted]

    with open_store(settings_of(Namespace(data=folder))) as store:
        definitions = store.change(read).result()
    FLEET.update({definition.robot: definition for definition in definitions})
    return tuple(definition.robot for definition in definitions)


def _found(known: dict[RobotId, RobotRecord], name: str) -> RobotRecord:
    record = known.get(RobotId(name))
    if record is None:
        raise CommandError(f"--robots: the station has no robot {name}.", status=2)
    if record.kind != "simulated" or record.is_foreign or record.system_id is None:
        raise CommandError(
            f"--robots: {name} is not simulated. In the browser, Settings, Add a robot, choose"
            " 'In the simulator'.",
            status=2,
        )
    return record


def _definition(session: Session, record: RobotRecord) -> RobotDefinition:
    vehicle = _vehicle(session, record.model)
    key = nearest_built_in(vehicle)
    like = next(one for one in FLEET.values() if one.vehicle.key == key)
    system = record.system_id
    assert system is not None  # noqa: S101 - the caller looked
    site = record.site
    carried = tuple(one for one in like.instruments if one.channel != site.variable)
    return replace(
        like,
        robot=record.id,
        system_id=system,
        radio_address=Address(0x0013A20041F00000 + system),
        station_address=Address(0x0013A20041F20000 + system),
        link_name=record.id,
        vehicle=replace(vehicle, key=key),
        site=site,
        start_ne_m=_open_water(site),
        instruments=carried,
        radio_range_m=float("inf"),
        antenna_ne_m=(0.0, 0.0),
        far_ne_m=None,
        imei="",
        acoustic_address=None,
        has_station_acoustics=False,
        targets=(),
        tag_receiver=None,
        tags=(),
    )


def _vehicle(session: Session, model: str) -> Vehicle:
    if model in VEHICLES:
        return VEHICLES[model]
    record = get_vehicle(session, model)
    if record is None:
        raise CommandError(f"The station has no vehicle {model!r} any more.")
    return entry_of(record).vehicle


def _open_water(site: Site) -> tuple[float, float]:
    """Return the place farthest from the shore, of some all over the domain that are deep enough.

    Raises:
        CommandError: If none is in the water.
    """
    domain, side = site.domain, round(_TRIES**0.5)
    north, east = (
        each.ravel()
        for each in np.meshgrid(
            np.linspace(domain.x_min_m, domain.x_max_m, side),
            np.linspace(domain.y_min_m, domain.y_max_m, side),
        )
    )
    deep = site.floor_m(north, east) >= _LEAST_FLOOR_SHARE * site.water.depth_max_m
    room = [
        site.clearance_m(float(x), float(y)) if is_deep else -1.0
        for x, y, is_deep in zip(north, east, deep, strict=True)
    ]
    best = int(np.argmax(room))
    if room[best] <= 0.0:
        raise CommandError(f"{site.name} has no open water in its domain.")
    return round(float(north[best]), 2), round(float(east[best]), 2)
