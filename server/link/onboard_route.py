"""What robots keep on board: parameters and log files, asked for over radio only."""

from dataclasses import dataclass

from fastapi import APIRouter
from fastapi.responses import FileResponse
from pydantic import Field

from server.access.dependency import FoundationDep, Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.body import Body
from server.base.view import View
from server.link.onboard_view import ParametersView, ParameterView, RobotLogsView
from server.station_dependency import StationDep

router = APIRouter(prefix="/api/robots/{robot}", tags=["on board"], route_class=IdempotentRoute)


class ParameterRequest(Body):
    """What a parameter shall be."""

    value: float


class LogRequest(Body):
    """Which file is wanted."""

    path: str = Field(min_length=1, max_length=200)


@dataclass(frozen=True, slots=True)
class JobIdView(View):
    """Where to ask how far the work is."""

    job: str


@router.get("/parameters")
async def list_parameters(caller: Viewer, robot: str, station: StationDep) -> ParametersView:
    """Return the robot's parameters as it said them last."""
    del caller
    return await station.parameters.view(robot)


@router.post("/parameters/read", status_code=202)
async def read_parameters(caller: Pilot, robot: str, station: StationDep) -> JobIdView:
    """Ask the robot for all of its parameters."""
    return JobIdView(await station.parameters.read(robot, by=caller.name))


@router.put("/parameters/{name}")
async def write_parameter(
    caller: Pilot, robot: str, name: str, body: ParameterRequest, station: StationDep
) -> ParameterView:
    """Set a parameter and answer with what the robot says that it is now."""
    return await station.parameters.write(robot, name, body.value, by=caller.name)


@router.get("/logs")
async def list_logs(caller: Viewer, robot: str, station: StationDep) -> RobotLogsView:
    """Return the files that the robot named last, and which of them are ashore."""
    del caller
    return await station.robot_logs.view(robot)


@router.post("/logs/read", status_code=202)
async def read_logs(caller: Pilot, robot: str, station: StationDep) -> JobIdView:
    """Ask the robot which files it has."""
    return JobIdView(await station.robot_logs.read(robot, by=caller.name))


@router.post("/logs/download", status_code=202)
async def download_log(
    caller: Pilot, robot: str, body: LogRequest, station: StationDep
) -> JobIdView:
    """Fetch a file; a transfer that broke off before goes on where it stopped."""
    return JobIdView(await station.robot_logs.download(robot, body.path, by=caller.name))


@router.get(
    "/logs/{log}",
    response_class=FileResponse,
    responses={200: {"content": {"application/octet-stream": {}}}},
)
async def get_log(
    caller: Viewer, robot: str, log: str, station: StationDep, foundation: FoundationDep
) -> FileResponse:
    """Return the copy of a file that was fetched."""
    del caller
    record, path = await station.robot_logs.copy(robot, log)
    mark = "SIMULATION_" if foundation.settings.simulation else ""
    name = f"{mark}{robot}_{record.path.rsplit('/', 1)[-1]}"
    return FileResponse(path, media_type="application/octet-stream", filename=name)
