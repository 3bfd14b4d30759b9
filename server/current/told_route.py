"""What is told of the current of a water: typed, or from an ocean model's file."""

import asyncio
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, File, Response, UploadFile
from pydantic import AwareDatetime, Field, ValidationError
from sqlalchemy.orm import Session

from db.query.station.events import add_event
from server.access.dependency import Admin, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import FoundationDep, service
from server.base.foundation import Foundation
from server.base.job import JobError, JobProgress
from server.base.problem import FieldError, unprocessable
from server.base.text import shown
from server.base.view import Body, View
from server.base.work.job_view import JobBegun, JobView, leaves
from server.base.worker import WORKER_FAILURES
from server.current.currents import Currents
from server.current.ocean_task import (
    PROPOSAL_FOLDER,
    TASK,
    CurrentProposal,
    OceanOrder,
    load_proposal,
    told_words,
)
from server.current.told import (
    FOLDER,
    LEVELS_MAX,
    KeptTold,
    ToldLevel,
    read_told,
    told_text,
    write_told,
)
from server.water.import_route import copied
from server.water.waters import Waters

router = APIRouter(
    prefix="/api/waters/{water}/current", tags=["waters"], route_class=IdempotentRoute
)

CurrentsDep = Annotated[Currents, Depends(service(Currents))]
WatersDep = Annotated[Waters, Depends(service(Waters))]


class NewTold(Body):
    """What is to be told of the current of a water: typed, or a proposal that is confirmed."""

    proposal: str | None = Field(default=None, pattern=r"^[0-9a-z]{8,64}$")
    """Name of a proposal of `POST /api/waters/{id}/current/imports`; null for a typed current."""
    kind: Literal["constant", "profile"] = "constant"
    """Whether a typed current is constant or a profile over depth."""
    levels: list[ToldLevel] = Field(default_factory=list, max_length=LEVELS_MAX)
    """Of a profile by ascending depth; of a constant one, whose depth does not matter."""
    std_m_s: float = Field(default=0.1, ge=0.005, le=1.0, allow_inf_nan=False)
    """Standard deviation of what it tells, per axis."""
    source: str | None = Field(default=None, max_length=200)
    """Who or what tells it; null for as the file says."""
    made_at: AwareDatetime | None = None
    """When the model ran, or it was seen; null for as the file says."""
    valid_from: AwareDatetime | None = None
    """From when on it holds; ``null`` from the beginning."""
    valid_until: AwareDatetime | None = None
    """Of a typed current: beyond these it says nothing; null for always."""


@dataclass(frozen=True, slots=True)
class ToldView(View):
    """What is told of the current of a water."""

    water: str
    told: KeptTold | None
    """Null where nothing is."""
    is_valid: bool
    """Whether it tells of now."""
    text: str
    """Where it comes from, how old it is, and until when it holds."""
    belief: float | None
    """How far the dives let one believe it, 0 to 1; null where no robot's current is mapped."""


@router.get("")
async def get_told_current(
    caller: Viewer, water: str, waters: WatersDep, currents: CurrentsDep, foundation: FoundationDep
) -> ToldView:
    """Return what is told of the current of a water, beside what its dives tell."""
    del caller
    await waters.get(water)
    return await _view(foundation, currents, water)


@router.put("")
async def put_told_current(
    caller: Admin,
    water: str,
    new: NewTold,
    waters: WatersDep,
    currents: CurrentsDep,
    foundation: FoundationDep,
) -> ToldView:
    """Tell the current of a water, in place of what was told before.

    It is the mean of the current where the dives of the water's robots do not tell otherwise.
    """
    await waters.get(water)
    told = await _kept(foundation, water, new)
    await _write(foundation, water, told, f"{caller.name} told the current of the water {water}.")
    await currents.retell(water)
    return await _view(foundation, currents, water)


@router.delete("", status_code=204, response_class=Response)
async def delete_told_current(
    caller: Admin, water: str, waters: WatersDep, currents: CurrentsDep, foundation: FoundationDep
) -> None:
    """Forget what was told of the current of a water."""
    await waters.get(water)
    text = f"{caller.name} took back what was told of the current of the water {water}."
    await _write(foundation, water, None, text)
    await currents.retell(water)


@router.post("/imports", status_code=202, openapi_extra=leaves(CurrentProposal))
async def start_current_reading(
    caller: Admin,
    water: str,
    file: Annotated[UploadFile, File(description="A CF NetCDF file of an ocean model.")],
    foundation: FoundationDep,
    waters: WatersDep,
    begun: JobBegun,
) -> JobView:
    """Read the current of a water from a CF NetCDF file of an ocean model; nothing is told yet.

    Taken are eastward and northward sea water velocity over latitude, longitude, time and, where
    there is one, depth. The job's result is a proposal, which `PUT /api/waters/{id}/current` takes
    by its name within a week, or it names the variable that is wrong.
    """
    record, _ = await waters.get(water)
    name = shown(file.filename or "") or "file"
    kept = await asyncio.to_thread(copied, file.file)
    folder = foundation.settings.data_dir
    order = OceanOrder(
        kept,
        name,
        water,
        record.site,
        folder / PROPOSAL_FOLDER,
        folder / FOLDER,
        secrets.token_hex(12),
    )

    async def work(progress: JobProgress) -> Mapping[str, Any]:
        progress.wait_for_process()
        try:
            found: Mapping[str, Any] = await foundation.workers.run(
                TASK, order, on_progress=lambda news: progress.report(*news)
            )
        except WORKER_FAILURES as error:
            raise JobError(f"The file could not be read: {error}") from error
        finally:
            kept.unlink(missing_ok=True)
        if "error" in found:
            raise JobError(found["error"], found)
        return found

    job = await foundation.jobs.start("current import", work, by=caller.name)
    return await begun(job.id)


async def _kept(foundation: Foundation, water: str, new: NewTold) -> KeptTold:
    """Return what is to be kept, from the request and the proposal that it names.

    Raises:
        Problem: 422 with the field that is wrong.
    """
    words = new.model_dump(exclude={"proposal", "kind"}, exclude_none=True)
    if new.proposal is None:
        try:
            return KeptTold.model_validate({**words, "kind": new.kind})
        except ValidationError as error:
            raise _wrong("levels", str(error.errors()[0]["msg"])) from error
    folder = foundation.settings.data_dir / PROPOSAL_FOLDER
    found = await asyncio.to_thread(load_proposal, folder, new.proposal)
    if found is None or found["water"] != water:
        raise _wrong("proposal", "there is no such proposal for this water; import the file again")
    if new.levels or new.valid_from or new.valid_until:
        raise _wrong("levels", "levels and times of an import are those of its file")
    del words["levels"]
    return KeptTold.model_validate(told_words(found) | words)


def _wrong(field: str, text: str) -> Exception:
    return unprocessable("1 field is wrong.", [FieldError(loc=[field], msg=text)])


async def _write(foundation: Foundation, water: str, told: KeptTold | None, text: str) -> None:
    at = foundation.clock.now()

    def write(session: Session) -> None:
        write_told(session, water, told)
        add_event(session, at, "water.current", text, data={"water": water})

    await foundation.store.write(write)


async def _view(foundation: Foundation, currents: Currents, water: str) -> ToldView:
    told = await foundation.store.query(lambda session: read_told(session, water))
    if told is None:
        return ToldView(water, None, False, "Nothing is told of the current of this water.", None)
    now = foundation.clock.now()
    is_valid = (told.valid_from or now) <= now <= (told.valid_until or now)
    return ToldView(water, told, is_valid, told_text(told, now), currents.belief(water))
