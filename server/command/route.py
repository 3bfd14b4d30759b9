"""Commands to robots, and how far each is proved to have come."""

from dataclasses import dataclass
from typing import Annotated, Literal

from fastapi import APIRouter, Query

from robot_link.messages import CommandKind
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.body import Body
from server.base.view import View
from server.command.view import CommandView
from server.station_dependency import StationDep

router = APIRouter(prefix="/api", tags=["commands"], route_class=IdempotentRoute)


class CommandRequest(Body):
    """An order to a robot."""

    kind: Literal["surface", "hold", "resume", "quiet", "ping"]
    """``surface`` aborts the mission and ends its automation, ``hold`` suspends it at the next
    surfacing, ``resume`` goes on; ``quiet`` lets a robot that follows a target stop pinging it,
    ``ping`` go on with that."""
    route: Literal["auto", "radio", "satellite"] = "auto"
    """The link that it is to take; ``auto`` is what the robot's settings say. ``surface`` goes by
    every link whatever is asked for."""


@dataclass(frozen=True, slots=True)
class CommandIdView(View):
    """Where to ask how far the command is."""

    id: str


@router.post("/robots/{robot}/commands", status_code=202)
async def create_command(
    caller: Pilot, robot: str, body: CommandRequest, station: StationDep
) -> CommandIdView:
    """Send an order; the answer says that it was written down, not that anyone has it.

    409 if the robot has no link of the route that is asked for.
    """
    kind = CommandKind(body.kind)
    command = await station.commands.send(robot, kind, by=caller.name, requested=body.route)
    return CommandIdView(command)


@router.get("/robots/{robot}/commands")
async def list_commands(
    caller: Viewer,
    robot: str,
    station: StationDep,
    limit: Annotated[int, Query(ge=1, le=1000)] = 50,
) -> list[CommandView]:
    """Return the newest commands of a robot, the newest first."""
    del caller
    station.fleet.status(robot)
    return await station.commands.latest(robot, limit)


@router.get("/commands/{command}")
async def get_command(caller: Viewer, command: str, station: StationDep) -> CommandView:
    """Return a command with every level that was proved, and one sentence about it."""
    del caller
    return await station.commands.view(command)
