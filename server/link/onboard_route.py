"""What robots keep on board: parameters and log files, asked for over radio only."""

from dataclasses import dataclass
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query
from fastapi.responses import FileResponse
from pydantic import Field

from db.fault import UnknownIdError
from server.access.dependency import Pilot, PilotInCharge, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import FoundationDep, service
from server.base.view import Body, View
from server.base.work.job_view import JobBegun, JobView
from server.link.onboard_view import (
    ParameterDifference,
    ParametersView,
    ParameterView,
    RobotLogsView,
)
from server.link.parameters import Parameters
from server.link.robot_logs import RobotLogs

router = APIRouter(prefix="/api/robots/{robot}", tags=["on board"], route_class=IdempotentRoute)

ParametersDep = Annotated[Parameters, Depends(service(Parameters))]
RobotLogsDep = Annotated[RobotLogs, Depends(service(RobotLogs))]


class ParameterRequest(Body):
    """What a parameter shall be."""

    value: float
    """What it is to be, in its own unit."""


class ParameterFileBody(Body):
    """A file about parameters."""

    text: str = Field(max_length=8 * 2**20)
    """Text of the file, one parameter a line."""


@dataclass(frozen=True, slots=True)
class DescribedView(View):
    """What came of a file."""

    parameters: int
    """How many it describes."""


class LogRequest(Body):
    """Which file is wanted."""

    path: str = Field(min_length=1, max_length=200)
    """Where on the robot the log is, as its list of logs names it."""


@router.get("/parameters")
async def list_parameters(
    caller: Viewer,
    robot: str,
    parameters: ParametersDep,
    against: Annotated[
        str | None, Query(description="Another robot, whose values stand beside.")
    ] = None,
) -> ParametersView:
    """Return the robot's parameters as it said them last, with what is known of their meaning."""
    if against is not None and not caller.rights.sees(against):
        raise UnknownIdError("robot", against)
    return await parameters.view(robot, against)


@router.put("/parameters-description")
async def describe_parameters(
    caller: Pilot, robot: str, body: ParameterFileBody, parameters: ParametersDep
) -> DescribedView:
    """Keep what a maker's file says of the parameters (JSON of MAVLink component metadata)."""
    count = await parameters.describe(robot, body.text.encode(), by=caller.name)
    return DescribedView(count)


@router.post("/parameters/compare")
async def compare_parameters(
    caller: Viewer,
    robot: str,
    body: ParameterFileBody,
    parameters: ParametersDep,
    against: Annotated[
        Literal["robot", "defaults"],
        Query(description="What the robot said last, or the defaults that its maker names."),
    ] = "robot",
) -> list[ParameterDifference]:
    """Return where a saved file (QGroundControl, ArduPilot) differs from the robot."""
    del caller
    return await parameters.compare(robot, body.text, with_defaults=against == "defaults")


@router.post("/parameters/read", status_code=202)
async def read_parameters(
    caller: Pilot, robot: str, parameters: ParametersDep, begun: JobBegun
) -> JobView:
    """Ask the robot for all of its parameters."""
    return await begun(await parameters.read(robot, by=caller.name))


@router.put("/parameters/{name}")
async def write_parameter(
    caller: PilotInCharge, robot: str, name: str, body: ParameterRequest, parameters: ParametersDep
) -> ParameterView:
    """Set a parameter and answer with what the robot says that it is now."""
    return await parameters.write(robot, name, body.value, by=caller.name)


@router.get("/logs")
async def list_logs(caller: Viewer, robot: str, logs: RobotLogsDep) -> RobotLogsView:
    """Return the files that the robot named last, and which of them are ashore."""
    del caller
    return await logs.view(robot)


@router.post("/logs/read", status_code=202)
async def read_logs(caller: Pilot, robot: str, logs: RobotLogsDep, begun: JobBegun) -> JobView:
    """Ask the robot which files it has."""
    return await begun(await logs.read(robot, by=caller.name))


@router.post("/logs/download", status_code=202)
async def download_log(
    caller: Pilot, robot: str, body: LogRequest, logs: RobotLogsDep, begun: JobBegun
) -> JobView:
    """Fetch a file; a transfer that broke off before goes on where it stopped."""
    return await begun(await logs.download(robot, body.path, by=caller.name))


@router.get(
    "/logs/{log}",
    response_class=FileResponse,
    responses={200: {"content": {"application/octet-stream": {}}}},
)
async def get_log(
    caller: Viewer, robot: str, log: str, logs: RobotLogsDep, foundation: FoundationDep
) -> FileResponse:
    """Return the copy of a file that was fetched."""
    del caller
    record, path = await logs.copy(robot, log)
    mark = "SIMULATION_" if foundation.settings.simulation else ""
    name = f"{mark}{robot}_{record.path.rsplit('/', 1)[-1]}"
    return FileResponse(path, media_type="application/octet-stream", filename=name)
