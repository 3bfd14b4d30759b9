"""Designs from plan files of other programs, and as such files."""

import asyncio
import json
from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Depends, File, Form, Query, Response, UploadFile
from pydantic import ValidationError

from autonomy.design.document import Design
from autonomy.design.way import waypoints_of
from db.record import same
from server.access.dependency import Pilot, Viewer
from server.base.dependency import service
from server.base.problem import FieldError, Problem, below, invalid, unprocessable
from server.base.text import shown
from server.base.view import View
from server.design.designs import Designs
from server.design.outline import Surroundings, whole_manner
from server.fleet.dependency import FleetDep
from server.plan_file.loss import Format, Loss
from server.plan_file.proposal import (
    PlanFileProposal,
    Question,
    ReadArea,
    ReadChoices,
    ReadMark,
    Refusal,
)
from server.plan_file.reading import read_plan_file
from server.plan_file.writing import NothingToWriteError, WrittenPlan, write_plan_file
from server.water.proposal import ReadingError

router = APIRouter(prefix="/api", tags=["designs"])

DesignsDep = Annotated[Designs, Depends(service(Designs))]
FormatQuery = Annotated[Format, Query()]


@dataclass(frozen=True, slots=True)
class PlanFileView(View):
    """What a plan file would bring; nothing of it is kept."""

    format: str
    """In words."""
    document: Design
    """The design that could be made of it, as the choices are now."""
    distance_m: float
    """From the first waypoint to the last, along the surface."""
    notes: list[str]
    refused: list[Refusal]
    """Every part that is not taken."""
    needs: list[Question]
    """Questions that are open, or may be answered otherwise."""
    areas: list[ReadArea]
    marks: list[ReadMark]
    is_ready: bool
    """Whether a design may be made of it: nothing that is needed is open."""


@dataclass(frozen=True, slots=True)
class LossView(View):
    """One thing of a design that other programs will not see."""

    text: str
    is_kept: bool
    """Whether the file keeps it for this station, so that reading it again brings it back."""


@router.post("/robots/{robot}/designs/read")
async def read_file(
    caller: Pilot,
    robot: str,
    fleet: FleetDep,
    file: Annotated[UploadFile, File(description="The plan file, as another program wrote it.")],
    choices: Annotated[
        str, Form(max_length=2000, description="JSON object that answers what it asks.")
    ] = "{}",
) -> PlanFileView:
    """Read a plan file: QGroundControl `.plan`, `QGC WPL 110`, KML, KMZ, GeoJSON or CSV.

    The answer names every part that is not taken, and asks what the file leaves open; `choices` is
    a JSON object that answers it. Nothing is kept: `POST /api/robots/{robot}/designs` takes the
    document once somebody confirmed it. 422 names line, item or feature of a file that is refused.
    """
    del caller
    site = fleet.status(robot).record.site
    name, content = shown(file.filename or "") or "file", await file.read()
    wanted = _choices(choices)
    try:
        found = await asyncio.to_thread(read_plan_file, name, content, site, wanted)
    except ReadingError as error:
        faults = [FieldError(loc=["file", place], msg=reason) for place, reason in error.faults]
        raise unprocessable(f"{name} is not taken: {error}.", faults) from error
    return _view(found)


@router.get("/designs/{design}/file", response_class=Response)
async def write_file(
    caller: Viewer,
    design: str,
    format: FormatQuery,
    designs: DesignsDep,
    version: Annotated[int | None, Query(ge=1)] = None,
) -> Response:
    """Return a design, or a version of it, as a file for other programs."""
    del caller
    written = await _written(design, format, designs, version)
    headers = {"Content-Disposition": f'attachment; filename="{written.file_name}"'}
    return Response(written.content, media_type=written.media_type, headers=headers)


@router.get("/designs/{design}/file/losses")
async def list_losses(
    caller: Viewer,
    design: str,
    format: FormatQuery,
    designs: DesignsDep,
    version: Annotated[int | None, Query(ge=1)] = None,
) -> list[LossView]:
    """Return what a format does not express of a design, before it is saved."""
    del caller
    written = await _written(design, format, designs, version)
    return [_loss(one) for one in written.losses]


async def _written(
    design: str, format: Format, designs: Designs, number: int | None
) -> WrittenPlan:
    record = await designs.get(design)
    values = record.document
    if number is not None:
        values = (await designs.version(design, number)).document
    document = Design.model_validate(values)
    _, around = await designs.laid(record.robot, document)
    return await asyncio.to_thread(_write, format, document, around, record.name)


def _write(format: Format, document: Design, around: Surroundings, name: str) -> WrittenPlan:
    try:
        way = waypoints_of(document, around.site, around.spacing_m)
        usual = whole_manner(document, around)
        return write_plan_file(format, document, way, usual, around.site, name)
    except NothingToWriteError as error:
        raise Problem(409, str(error)) from error
    except ValueError as error:
        wrong = [FieldError(loc=["content"], msg=str(error))]
        raise unprocessable("The design cannot be laid out.", wrong) from error


def _choices(text: str) -> ReadChoices:
    try:
        return ReadChoices.model_validate(json.loads(text))
    except ValidationError as error:
        raise below(invalid(error, ReadChoices), "choices") from error
    except ValueError as error:
        wrong = [FieldError(loc=["choices"], msg="it is no JSON")]
        raise unprocessable("1 field is wrong.", wrong) from error


def _view(found: PlanFileProposal) -> PlanFileView:
    return same(
        PlanFileView,
        found,
        notes=list(found.notes),
        refused=list(found.refused),
        needs=list(found.needs),
        areas=list(found.areas),
        marks=list(found.marks),
    )


def _loss(loss: Loss) -> LossView:
    return same(LossView, loss)
