"""Commands to robots, and how far each is proved to have come."""

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query

from robot_link.messages import CommandKind
from server.access.dependency import InChargeOf, PilotAtOnce, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import DeploymentDep, period_of, service
from server.base.view import Body
from server.base.work.changes import WaitingDep
from server.base.work.started import Started, StartedView
from server.command.commands import Commands
from server.command.state import SETTLED
from server.command.view import CommandView
from server.fleet.dependency import FleetDep

router = APIRouter(prefix="/api", tags=["commands"], route_class=IdempotentRoute)

CommandsDep = Annotated[Commands, Depends(service(Commands))]


class CommandRequest(Body):
    """An order to a robot."""

    kind: Literal["surface", "hold", "resume", "quiet", "ping", "arm", "disarm", "zero_depth"]
    """``surface`` aborts the mission and ends its automation, ``hold`` suspends it at the next
    surfacing, ``resume`` goes on; ``quiet`` lets a robot that follows a target stop pinging it,
    ``ping`` go on with that; ``arm`` lets the motors of a vehicle of another maker turn, ``disarm``
    stops them; ``zero_depth`` takes the depth sensor's present reading as the surface, which the
    robot refuses under water and where the reading cannot be that."""
    route: Literal["auto", "radio", "satellite"] = "auto"
    """The link that it is to take; ``auto`` is what the robot's settings say. ``surface`` goes by
    every link whatever is asked for."""


@router.post("/robots/{robot}/commands", status_code=202)
async def create_command(
    caller: PilotAtOnce,
    robot: str,
    body: CommandRequest,
    commands: CommandsDep,
    in_charge_of: InChargeOf,
    started: Started,
) -> StartedView:
    """Send an order; the answer says that it was written down, not that anyone has it.

    409 if the robot has no link of the route that is asked for, or somebody else is in charge of
    it. To ``surface`` a robot is every pilot's right at any time.
    """
    kind = CommandKind(body.kind)
    if kind is not CommandKind.SURFACE:
        await in_charge_of((robot,))
    command = await commands.send(robot, kind, by=caller.name, requested=body.route)
    return started(command)


@router.get("/robots/{robot}/commands")
async def list_commands(
    caller: Viewer,
    robot: str,
    commands: CommandsDep,
    fleet: FleetDep,
    deployment: DeploymentDep,
    limit: Annotated[int, Query(ge=1, le=1000)] = 50,
) -> list[CommandView]:
    """Return the newest commands of a robot, the newest first."""
    del caller
    fleet.status(robot)
    return await commands.latest(robot, limit, period_of(deployment, robot))


@router.get("/commands/{command}")
async def get_command(
    caller: Viewer, command: str, commands: CommandsDep, waiting: WaitingDep
) -> CommandView:
    """Return a command with every level that was proved, and one sentence about it."""
    del caller
    return await waiting.told(
        command, lambda: commands.view(command), has_ended=lambda one: one.level in SETTLED
    )
