"""Outlines, keep-outs, places and depths come in from files, as proposals."""

import asyncio
import os
import secrets
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Annotated, Any, Literal

from fastapi import APIRouter, Depends, File, Form, UploadFile

from server.access.dependency import Admin
from server.base.dependency import FoundationDep, service
from server.base.foundation import Foundation
from server.base.job import JobError, JobProgress
from server.base.text import shown
from server.base.work.job_view import JobBegun, JobView, leaves
from server.base.worker import WORKER_FAILURES
from server.water.proposal import ImportProposal
from server.water.reading_task import TASK, ReadingOrder
from server.water.waters import Waters

router = APIRouter(prefix="/api/waters/imports", tags=["waters"])

WatersDep = Annotated[Waters, Depends(service(Waters))]
Format = Literal["", "geojson", "kml", "kmz", "gpx", "geotiff", "netcdf", "xyz"]


@router.post("", status_code=202, openapi_extra=leaves(ImportProposal))
async def start_reading(
    caller: Admin,
    file: Annotated[UploadFile, File(description="A file of shapes or of depths.")],
    foundation: FoundationDep,
    waters: WatersDep,
    begun: JobBegun,
    format: Annotated[Format, Form(description="How it is written; empty to find out.")] = "",
    crs: Annotated[
        str, Form(max_length=2000, description="Such as ``EPSG:32617``; empty for its own.")
    ] = "",
) -> JobView:
    """Read outline, keep-outs and places, or depths, from a file; nothing of it is kept yet.

    Taken are GeoJSON, KML, KMZ and GPX, and depths as GeoTIFF, NetCDF and XYZ text; ``format`` is
    needed where the file's name does not tell. ``crs``, such as ``EPSG:32617``, says what the
    coordinates are where the file does not, or is wrong. The job's result is a proposal, which
    `POST` or `PATCH /api/waters` takes by its name within a week, or it names the faults by feature
    or line.
    """
    name = shown(file.filename or "") or "file"
    kept = await asyncio.to_thread(copied, file.file)
    order = ReadingOrder(kept, name, format, crs, waters.proposal_folder, secrets.token_hex(12))

    async def work(progress: JobProgress) -> Mapping[str, Any]:
        try:
            return await _read(foundation, order, progress)
        finally:
            kept.unlink(missing_ok=True)

    job = await foundation.jobs.start("water import", work, by=caller.name)
    return await begun(job.id)


async def _read(
    foundation: Foundation, order: ReadingOrder, progress: JobProgress
) -> Mapping[str, Any]:
    progress.wait_for_process()
    try:
        found = await foundation.workers.run(
            TASK, order, on_progress=lambda news: progress.report(*news)
        )
    except WORKER_FAILURES as error:
        raise JobError(f"The file could not be read: {error}") from error
    if "errors" in found:
        first = found["errors"][0]
        place = f"{first['place']}: " if first["place"] else ""
        more = len(found["errors"]) - 1
        rest = f" ({more} more)" if more else ""
        raise JobError(f"{order.file}: {place}{first['reason']}{rest}.", found)
    return found


def copied(source: IO[bytes]) -> Path:
    """Copy an upload into a file of its own: the request's is gone before the job has read it."""
    handle, path = tempfile.mkstemp(prefix="grace-water-")
    try:
        with os.fdopen(handle, "wb") as kept:
            source.seek(0)
            shutil.copyfileobj(source, kept)
    except BaseException:
        Path(path).unlink(missing_ok=True)
        raise
    return Path(path)
