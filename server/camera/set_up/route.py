"""Setting cameras up: the board, the lens, the place, the latency, and how good it became."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query

from db.identity import public_id
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import ClockDep, service
from server.base.work.job_view import JobBegun, JobView
from server.camera.calibrations import CALIBRATION
from server.camera.cameras import Cameras
from server.camera.rig import CameraRig
from server.camera.set_up.boards import Boards
from server.camera.set_up.jobs import CalibrationJobs
from server.camera.set_up.view import (
    AdjustOrder,
    BoardsView,
    LatencyCheckView,
    LensOrder,
    RigView,
    accuracy_view,
    boards_view,
    latency_view,
)
from server.camera.tags import Tags
from server.camera.watch import CameraWatch

router = APIRouter(prefix="/api", tags=["cameras"], route_class=IdempotentRoute)

BoardsDep = Annotated[Boards, Depends(service(Boards))]
CamerasDep = Annotated[Cameras, Depends(service(Cameras))]
JobsDep = Annotated[CalibrationJobs, Depends(service(CalibrationJobs))]
Number = Annotated[int | None, Query(ge=1, description="Only this picture; by default all.")]


@router.post("/cameras/adjust", status_code=202)
async def adjust(caller: Pilot, body: AdjustOrder, jobs: JobsDep, begun: JobBegun) -> JobView:
    """Place all cameras at once by 50 pictures of the fixed tags, or one that was moved.

    The job's result is the calibration, which is in use then; or it says why none was taken, with
    the number of the tag to blame.
    """
    return await begun(
        await jobs.adjust(body.camera, body.level_m, body.level_std_m, by=caller.name)
    )


@router.post("/cameras/{camera}/boards", status_code=202)
async def take_board(
    caller: Pilot, camera: str, body: LensOrder, jobs: JobsDep, begun: JobBegun
) -> JobView:
    """Take one picture of the board that is held before a camera, in air."""
    return await begun(await jobs.take_board(camera, body.kind, by=caller.name))


@router.get("/cameras/{camera}/boards")
async def get_boards(
    caller: Viewer, camera: str, cameras: CamerasDep, boards: BoardsDep
) -> BoardsView:
    """Return what was seen of the board, and what is missing yet."""
    del caller
    cameras.get(camera)
    return boards_view(boards, camera)


@router.delete("/cameras/{camera}/boards")
async def delete_boards(
    caller: Pilot, camera: str, cameras: CamerasDep, boards: BoardsDep, number: Number = None
) -> BoardsView:
    """Forget one picture of the board, or begin anew."""
    del caller
    cameras.get(camera)
    await boards.remove(camera, number)
    return boards_view(boards, camera)


@router.post("/cameras/{camera}/lens", status_code=202)
async def calibrate_lens(
    caller: Pilot, camera: str, body: LensOrder, jobs: JobsDep, begun: JobBegun
) -> JobView:
    """Calibrate a lens by the pictures of the board; the cameras are to be adjusted then."""
    return await begun(await jobs.calibrate_lens(camera, body.kind, by=caller.name))


@router.post("/cameras/{camera}/latency", status_code=202)
async def check_latency(caller: Pilot, camera: str, jobs: JobsDep, begun: JobBegun) -> JobView:
    """Measure how late a camera's pictures come, while it looks at a page that shows the tags.

    What the page is to show is told by `GET`.
    """
    check = await jobs.check_latency(camera, by=caller.name)
    return await begun(check.job)


@router.get("/cameras/{camera}/latency")
async def get_latency(
    caller: Viewer, camera: str, jobs: JobsDep, clock: ClockDep
) -> LatencyCheckView:
    """Return what the page is to show that a camera looks at."""
    del caller
    return latency_view(jobs.latency_check(camera), clock.now())


@router.get("/camera-rig")
async def get_rig(
    caller: Viewer,
    rig: Annotated[CameraRig, Depends(service(CameraRig))],
    tags: Annotated[Tags, Depends(service(Tags))],
    watch: Annotated[CameraWatch, Depends(service(CameraWatch))],
    jobs: JobsDep,
) -> RigView:
    """Return the cameras that robots are found by, the water's level, and how good they are."""
    del caller
    record, used, kept = rig.record, rig.calibrated, jobs.accuracy
    level_m = None if used is None else used.level_m
    before_m = None if record is None else record.result["level_m"]
    measured = None if kept is None else kept["calibration"]
    return RigView(
        None if record is None else public_id(CALIBRATION, record.key),
        None if record is None else record.at,
        None if record is None else record.by,
        [] if used is None else list(used.cameras),
        sorted(rig.left_out),
        None if record is None else record.result["rms"],
        None if record is None else record.result["index"],
        level_m,
        None if level_m is None or before_m is None else level_m - before_m,
        watch.level_words,
        watch.ripple_deg,
        record is not None and record.tag_set_key != tags.version,
        None
        if kept is None
        else accuracy_view(kept, None if measured is None else public_id(CALIBRATION, measured)),
    )


@router.post("/camera-rig/accuracy", status_code=202)
async def measure_accuracy(caller: Pilot, jobs: JobsDep, begun: JobBegun) -> JobView:
    """Find each fixed tag as if it were a robot, by cameras that were adjusted without it."""
    return await begun(await jobs.measure_accuracy(by=caller.name))
