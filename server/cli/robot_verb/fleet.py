"""Robots join, are listed, retire and come back: in a data folder, or at a station."""

import asyncio
from argparse import Namespace
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from pydantic import ValidationError
from sqlalchemy.orm import Session

from autonomy.site import Site
from autonomy.vehicle.config import VEHICLES
from db.query.fleet.deployments import deployment_in_water
from db.query.fleet.robots import RobotRecord, list_robots
from db.query.fleet.vehicles import list_vehicles
from db.query.fleet.waters import get_water
from db.record import values
from db.store import Store
from robot_link.station.gateway.address import check_link
from server.base.secret import SecretStore
from server.base.settings import Settings
from server.cli.data import checked, clock_of, open_remote, open_store, settings_of
from server.cli.data_folder import DataFolderError, DataFolderTakenError, hold_data_folder
from server.cli.failure import CommandError
from server.cli.option import TOKEN_VARIABLE
from server.deployment.robot_route import (
    NewRobot,
    record_of,
    write_added,
    write_restored,
    write_retired,
)

_BY = "command line"
_DONE = {"retire": "is retired; its past stays", "restore": "is back, in the workshop"}
_OPTION = {"id": "robot", "system_id": "--system", "links": "--link"}
"""Where a field of a new robot is said, unless in an option of its name."""


def run(arguments: Namespace) -> int:
    """Do the action on a data folder that no station uses, or through the station at ``--url``."""
    if arguments.action == "list":
        for robot in _listed(arguments):
            print(_line(robot))
        return 0
    if arguments.action == "add":
        key = _add(arguments, _new_robot(arguments))
        print(f"{arguments.robot} is added.")
        if key is not None:
            print("Write this into signing.key of its memory; it is never shown again:")
            print(key)
        return 0
    if arguments.url:
        with open_remote(arguments) as client:
            checked(client.post(f"/api/robots/{arguments.robot}/{arguments.action}"))
    else:
        _move(arguments)
    print(f"{arguments.robot} {_DONE[arguments.action]}.")
    return 0


def _new_robot(arguments: Namespace) -> NewRobot:
    if arguments.signed and arguments.unsigned:
        raise CommandError("Say --signed or --unsigned, not both.", status=2)
    first = {
        "name": arguments.deployment,
        "purpose": arguments.purpose,
        "people": arguments.person,
    }
    is_ashore = arguments.workshop or arguments.recorded
    if is_ashore and any(first.values()):
        raise CommandError("--deployment, --purpose and --person are of one that begins.", status=2)
    try:
        robot = NewRobot(
            id=arguments.robot,
            name=arguments.name or arguments.robot,
            protocol=arguments.protocol,
            model=arguments.model,
            system_id=arguments.system,
            links=arguments.link,
            water=arguments.water,
            kind="recorded" if arguments.recorded else "real",
            signing=True if arguments.signed else False if arguments.unsigned else None,
            deployment=None if is_ashore else first,  # pyright: ignore[reportArgumentType] - validated
        )
    except ValidationError as error:
        raise CommandError(_fault(error), status=2) from error
    for uri in robot.links:
        try:
            check_link(uri)
        except ValueError as error:
            raise CommandError(f"--link {uri}: {error}", status=2) from error
    return robot


def _fault(error: ValidationError) -> str:
    first = error.errors()[0]
    message = first["msg"].removeprefix("Value error, ")
    if not first["loc"]:
        return message
    field = str(first["loc"][-1] if first["loc"][0] == "deployment" else first["loc"][0])
    return f"{_OPTION.get(field, f'--{field}')}: {message}"


def _add(arguments: Namespace, robot: NewRobot) -> str | None:
    """Add a robot and return its signing key, None where it has none."""
    if arguments.url:
        with open_remote(arguments) as client:
            answer = client.post("/api/robots", json=robot.model_dump(mode="json"))
            key = checked(answer).json()["signing_key"]
        return None if key is None else key["key"]

    with _held(arguments) as (settings, store):
        with store.read() as session:
            site = _checked_site(session, robot)
        record = record_of(robot, site, clock_of(settings).now())
        secrets = SecretStore(settings.secret_dir)
        key = asyncio.run(
            secrets.decide_with(
                store,
                robot.id,
                lambda session: write_added(session, robot, record, secrets, _BY),
            )
        )
    return None if key is None else key.hex()


def _checked_site(session: Session, robot: NewRobot) -> Site:
    """Return the water of a new robot, whose vehicle is one of the catalogue.

    Raises:
        CommandError: If there is no such vehicle, or the water is retired.
    """
    models = [*VEHICLES, *(vehicle.key for vehicle in list_vehicles(session))]
    needs_model = robot.protocol == "grace" and robot.kind != "recorded"
    if (robot.model or needs_model) and robot.model not in models:
        raise CommandError(f"--model must be one of {', '.join(models)}.", status=2)
    water = get_water(session, str(robot.water))
    if water.retired_at is not None:
        raise CommandError(f"{water.id} is retired; bring it back first.")
    return water.site


def _move(arguments: Namespace) -> None:
    """Retire a robot of a data folder, or bring it back."""
    write = write_retired if arguments.action == "retire" else write_restored
    with _held(arguments) as (settings, store):
        at = clock_of(settings).now()
        store.change(lambda session: write(session, arguments.robot, at, _BY)).result()


@contextmanager
def _held(arguments: Namespace) -> Generator[tuple[Settings, Store]]:
    """Hold a data folder: a station that runs on it would not know of the change."""
    settings = settings_of(arguments)
    try:
        with (
            hold_data_folder(settings.data_dir),
            open_store(settings, is_held=True) as store,
        ):
            yield settings, store
    except DataFolderTakenError as error:
        raise CommandError(f"{error} Say it to the station: --url and {TOKEN_VARIABLE}.") from error
    except DataFolderError as error:
        raise CommandError(str(error)) from error


def _listed(arguments: Namespace) -> Sequence[Mapping[str, Any]]:
    if arguments.url:
        with open_remote(arguments) as client:
            parts = [
                checked(client.get("/api/robots", params={"retired": retired})).json()
                for retired in (False, True)
            ]
        return [
            {
                **robot,
                "water": robot["site"]["name"],
                "deployment": (robot["deployment"] or {}).get("name"),
            }
            for part in parts
            for robot in part
        ]
    with open_store(settings_of(arguments)) as store, store.read() as session:
        robots = [_told(session, robot) for robot in list_robots(session)]
    return sorted(robots, key=lambda robot: robot["retired_at"] is not None)


def _told(session: Session, robot: RobotRecord) -> Mapping[str, Any]:
    deployment = deployment_in_water(session, robot.id)
    return {
        **values(robot, but=["site", "water", "links"]),
        "water": robot.site.name,
        "deployment": None if deployment is None else deployment.title,
    }


def _line(robot: Mapping[str, Any]) -> str:
    if robot["kind"] == "recorded":
        where = "a recording"
    elif robot["retired_at"] is not None:
        where = f"retired since {str(robot['retired_at'])[:10]}"
    elif robot["deployment"]:
        where = f"in the water: {robot['deployment']}"
    else:
        where = "in the workshop"
    system = f"system {robot['system_id']}" if robot["system_id"] is not None else ""
    facts = [robot["name"], robot["model"], system, robot["water"], where]
    return f"{robot['id']}: {', '.join(fact for fact in facts if fact)}"
