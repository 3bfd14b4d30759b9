"""Recordings of any maker by REST: sent, proposed, confirmed; and mappings that were kept."""

import asyncio
from collections.abc import Mapping as AnyMapping
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, File, UploadFile
from pydantic import Field
from sqlalchemy.orm import Session

from db.query.fleet.recordings import DeploymentExistsError
from db.query.station.settings import get_setting, put_setting
from server.access.dependency import Pilot, PilotOf, Viewer
from server.base.dependency import FoundationDep, StoreDep
from server.base.job import JobProgress
from server.base.problem import conflict, not_found
from server.base.text import shown
from server.base.view import Body, View
from server.base.work.job_view import JobBegun, JobView, leaves
from server.recording.foreign import (
    Confirmed,
    ImportReport,
    RecordingProposal,
    folder_of,
    hashes,
    read_upload,
    refuse_same,
    run_confirmed,
)
from server.recording.foreign_task import ReadOrder
from server.recording.keep import ROBOT_ID
from server.recording.kept_mapping import (
    TEMPLATES,
    MappingTakenError,
    refuse_taken,
    templates_in,
)
from server.recording.table import Policy
from server.recording.upload import forget_upload, keep_upload, upload_place
from server.recording_file.mapping import Mapping

router = APIRouter(prefix="/api/imports", tags=["data"])
_NAME_MAX = 60
_OFFSET_MAX_S = 4e9
"""A clock that was never set begins in 1970."""


@dataclass(frozen=True, slots=True)
class ImportTemplateView(View):
    """A mapping that was kept."""

    name: str
    columns: int
    """How many columns it takes."""
    by: str
    at: datetime


@dataclass(frozen=True, slots=True)
class ImportTemplatesView(View):
    """Mappings that were kept, by name."""

    templates: list[ImportTemplateView]


class Confirmation(Body):
    """What is to become of an upload."""

    robot: str = Field(pattern=ROBOT_ID)
    """Id of the robot whose recording it is; created if not known."""
    mapping: Mapping
    """What its columns become."""
    policy: Policy = Policy.REFUSE
    """What becomes of files that have broken rows."""
    into: str = Field(default="", max_length=_NAME_MAX)
    """Id of the deployment that the rows belong to, "" to go by their time."""
    template: str = Field(default="", max_length=_NAME_MAX)
    """Name under which the mapping is kept, "" to forget it."""
    template_at: str = Field(default="", max_length=_NAME_MAX)
    """When the mapping of this name was kept that is replaced, as the proposal said; 409 where
    another one is kept by the name."""
    clock_offset_s: float | None = Field(default=None, ge=-_OFFSET_MAX_S, le=_OFFSET_MAX_S)
    """How far the recorder's clock was ahead of the right time, s: every time becomes so much
    earlier. Without it times stay as they are; a card whose clock is over a second off from
    telemetry is refused until somebody says it, or 0."""


@router.post("/uploads", status_code=202, openapi_extra=leaves(RecordingProposal))
async def start_upload(
    caller: Pilot,
    files: Annotated[list[UploadFile], File(description="The files of one recording.")],
    foundation: FoundationDep,
    begun: JobBegun,
) -> JobView:
    """Read files of any maker and propose what their columns become; nothing is kept yet.

    `about` of the job names the upload where it is confirmed.

    Taken are tables with any columns, dives of a Seaglider, files of OG1.0, flight and science
    files of a Slocum with their cache files, and the card of a robot of ours, which needs no
    mapping; several at once, or in a ZIP archive. What each is, is found by its content.
    """
    folder = folder_of(foundation.settings.data_dir)
    named = [(shown(one.filename or "") or "file", one.file) for one in files]
    upload = await asyncio.to_thread(keep_upload, folder, named)
    order = await _order(foundation, upload)

    async def work(progress: JobProgress) -> RecordingProposal:
        try:
            return await read_upload(order, upload, foundation.workers, progress)
        except BaseException:
            await asyncio.to_thread(forget_upload, order.folder)
            raise

    job = await foundation.jobs.start("import reading", work, by=caller.name, about=upload)
    return await begun(job.id)


@router.post("/uploads/{upload}", status_code=202, openapi_extra=leaves(ImportReport))
async def confirm_upload(
    caller: Pilot,
    upload: str,
    body: Confirmation,
    pilot_of: PilotOf,
    foundation: FoundationDep,
    begun: JobBegun,
) -> JobView:
    """Import an upload by a mapping, whole or not at all.

    Rows that are kept already are not kept again: the report says how many of those that were read
    are new, duplicate, different or faulty. 404 for an upload that is not there any more, 409 for
    files that the robot has already; the sentence names the deployment. Measurements of a card are
    held against telemetry by the numbers that the robot gave them.
    """
    await pilot_of((body.robot,))
    order = await _order(foundation, upload, body.mapping)
    files = await asyncio.to_thread(hashes, order)
    try:
        await foundation.store.query(lambda session: refuse_same(session, body.robot, files))
    except DeploymentExistsError as error:
        raise conflict(str(error)) from error
    wanted = Confirmed(
        order,
        files,
        body.robot,
        body.policy,
        body.into,
        body.template,
        caller.name,
        body.clock_offset_s,
        body.template_at,
    )
    try:
        await foundation.store.query(
            lambda session: refuse_taken(session, body.template, body.mapping, body.template_at)
        )
    except MappingTakenError as error:
        raise conflict(str(error)) from error

    async def work(progress: JobProgress) -> ImportReport:
        return await run_confirmed(
            wanted, foundation.store, foundation.clock, foundation.workers, progress
        )

    job = await foundation.jobs.start("import", work, by=caller.name, robot=body.robot)
    return await begun(job.id)


@router.get("/templates")
async def list_templates(caller: Viewer, store: StoreDep) -> ImportTemplatesView:
    """Return the mappings that were kept; the one that fits most columns is proposed."""
    del caller
    kept = await store.query(lambda session: get_setting(session, TEMPLATES)) or {}
    return ImportTemplatesView([_template(name, one) for name, one in sorted(kept.items())])


@router.delete("/templates/{name}", status_code=204)
async def forget_template(caller: Pilot, name: str, store: StoreDep) -> None:
    """Forget a mapping."""
    del caller

    def forget(session: Session) -> bool:
        kept = dict(get_setting(session, TEMPLATES) or {})
        was = kept.pop(name, None)
        put_setting(session, TEMPLATES, kept)
        return was is not None

    if not await store.write(forget):
        raise not_found(f"There is no kept mapping {name!r}.")


def _template(name: str, kept: AnyMapping[str, Any]) -> ImportTemplateView:
    columns = [one for one in kept["mapping"]["columns"] if one["role"] != "ignore"]
    return ImportTemplateView(name, len(columns), kept["by"], datetime.fromisoformat(kept["at"]))


async def _order(
    foundation: FoundationDep, upload: str, mapping: Mapping | None = None
) -> ReadOrder:
    folder = folder_of(foundation.settings.data_dir)
    try:
        place, names = await asyncio.to_thread(upload_place, folder, upload)
    except OSError:
        raise not_found("This upload is not there any more; send the files again.") from None
    templates = await foundation.store.query(templates_in)
    return ReadOrder(place, names, foundation.channels.catalogue, templates, mapping)
