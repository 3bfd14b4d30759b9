"""Recorded deployments come in."""

import asyncio
import os
from typing import Annotated

from fastapi import APIRouter, File, Form, UploadFile

from server.access.dependency import Pilot, PilotOf
from server.base.dependency import FoundationDep
from server.base.job import JobProgress, kept_upload
from server.base.text import shown
from server.base.work.job_view import JobBegun, JobView, leaves
from server.recording.intake import ImportOrder, ImportResult, run_import
from server.recording.keep import ROBOT_ID
from server.recording.table import Policy

router = APIRouter(prefix="/api/imports", tags=["data"])


@router.post("", status_code=202, openapi_extra=leaves(ImportResult))
async def start_import(
    caller: Pilot,
    file: Annotated[UploadFile, File(description="The CSV file of a recording.")],
    robot: Annotated[
        str, Form(pattern=ROBOT_ID, description="Id of the robot whose recording it is.")
    ],
    pilot_of: PilotOf,
    foundation: FoundationDep,
    begun: JobBegun,
    policy: Annotated[
        Policy, Form(description="What becomes of a file that has broken rows.")
    ] = Policy.REFUSE,
) -> JobView:
    """Import a CSV file as a recorded deployment of a robot, which is created if not known.

    The columns are ``time,latitude,longitude,depth`` and variables. With ``roll_deg``,
    ``pitch_deg``, ``heading_deg``, ``net_buoyancy_g``, ``mass_position_mm``, ``tail_deg`` and,
    where a position was measured, ``position_std_m``, the recording can be identified.
    With ``policy=skip`` broken rows are left out and named in the job's result; with
    ``policy=refuse`` one broken row refuses the whole file. Nothing is ever imported by half.
    """
    await pilot_of((robot,))
    kept = await asyncio.to_thread(kept_upload, file.file)
    order = ImportOrder(
        file=kept,
        size=os.fstat(kept.fileno()).st_size,
        title=shown(file.filename or "") or "recording.csv",
        robot=robot,
        policy=policy,
        by=caller.name,
        channels=foundation.channels.catalogue,
    )
    store, clock = foundation.store, foundation.clock

    async def work(progress: JobProgress) -> ImportResult:
        with kept:
            return await run_import(order, store, clock, progress)

    job = await foundation.jobs.start("import", work, by=caller.name, robot=robot)
    return await begun(job.id)
