"""Designs of missions: listed, begun, changed step by step, saved, compared, made plans of."""

from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query, Response
from pydantic import TypeAdapter

from autonomy.design.document import Design
from db.query.mission.designs import DesignChangedError, DesignRecord, DesignVersion
from db.record import same
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.access.subject import refuse_unseen
from server.base.dependency import FoundationDep, service
from server.base.problem import Problem
from server.base.work.started import CalculationStarted, StartedView
from server.design.designs import Designs
from server.design.sides import Sides
from server.design.view import (
    Checking,
    DesignSummaryView,
    DesignView,
    DifferenceView,
    DocumentChange,
    NewDesign,
    OutlineView,
    Planning,
    Renaming,
    Restoring,
    Saving,
    VersionDocumentView,
    VersionView,
)

router = APIRouter(prefix="/api", tags=["designs"], route_class=IdempotentRoute)

DesignsDep = Annotated[Designs, Depends(service(Designs))]
SidesDep = Annotated[Sides, Depends(service(Sides))]
_SIDE = "`working`, `version:3`, `plan:plan-12`, or `on_board` for what the robot has on board."
Side = Annotated[str, Query(description=_SIDE, max_length=80)]


_OUTLINE = TypeAdapter(OutlineView)


async def revision_of(if_match: Annotated[str | None, Header()] = None) -> int:
    """Return the revision that a change was made from.

    Raises:
        Problem: 428 if none is named, 400 if it is no revision.
    """
    if if_match is None:
        raise Problem(428, 'Say which revision was changed, such as `If-Match: "4"`.')
    digits = if_match.strip().removeprefix("W/").strip('"')
    if not digits.isascii() or not digits.isdigit() or len(digits) > 15:
        raise Problem(400, f"If-Match names no revision: {if_match!r}.")
    return int(digits)


Revision = Annotated[int, Depends(revision_of)]


@router.get("/robots/{robot}/designs")
async def list_designs(
    caller: Viewer, robot: str, designs: DesignsDep, *, archived: bool = False
) -> list[DesignSummaryView]:
    """Return the designs of a robot, those that were changed last first."""
    del caller
    found = await designs.of_robot(robot, archived=archived)
    versions = await designs.count_versions(robot)
    return [_summary(one, versions.get(one.id, 0)) for one in found]


@router.post("/robots/{robot}/designs", status_code=201)
async def create_design(
    caller: Pilot,
    robot: str,
    body: NewDesign,
    designs: DesignsDep,
    foundation: FoundationDep,
    response: Response,
) -> DesignView:
    """Begin a design: empty, from a document, a copy, a plan that was flown, or a template."""
    if body.design is not None:
        await refuse_unseen(foundation.store, caller, "design", body.design)
    if body.plan is not None:
        await refuse_unseen(foundation.store, caller, "plan", body.plan)
    record = await designs.add(robot, body, by=caller.name)
    return await _answer(designs, record, response)


@router.post("/robots/{robot}/designs/check", response_model=OutlineView)
async def check_document(
    caller: Viewer, robot: str, body: Checking, designs: DesignsDep
) -> Response:
    """Lay a document out for a robot as it is now; nothing is kept."""
    del caller
    # Asked for with every change that somebody drags: written without a second look at each leg.
    outline = await designs.outline(robot, body.document)
    return Response(_OUTLINE.dump_json(outline), media_type="application/json")


@router.get("/designs/{design}")
async def get_design(
    caller: Viewer, design: str, designs: DesignsDep, response: Response
) -> DesignView:
    """Return one design; its revision is the ``ETag``."""
    del caller
    return await _answer(designs, await designs.get(design), response)


@router.patch("/designs/{design}")
async def patch_design(
    caller: Pilot, design: str, body: Renaming, designs: DesignsDep, response: Response
) -> DesignView:
    """Name a design otherwise, put it away, or bring it back."""
    record = await designs.rename(
        design, name=body.name, is_archived=body.is_archived, by=caller.name
    )
    return await _answer(designs, record, response)


@router.put("/designs/{design}/document")
async def put_document(
    caller: Pilot,
    design: str,
    body: DocumentChange,
    revision: Revision,
    designs: DesignsDep,
    response: Response,
) -> DesignView:
    """Change the working document: one step, which can be undone.

    412 tells who was faster, when and what he did; `POST .../difference` then shows how the two
    differ. Nothing was changed.
    """
    try:
        record = await designs.change(
            design, body.document, body.what, revision=revision, by=caller.name
        )
    except DesignChangedError as error:
        raise _overtaken(error) from error
    return await _answer(designs, record, response)


@router.post("/designs/{design}/undo")
async def undo(
    caller: Pilot, design: str, revision: Revision, designs: DesignsDep, response: Response
) -> DesignView:
    """Undo the last change."""
    return await _moved(designs, design, -1, revision, caller.name, response)


@router.post("/designs/{design}/redo")
async def redo(
    caller: Pilot, design: str, revision: Revision, designs: DesignsDep, response: Response
) -> DesignView:
    """Do again what was undone last."""
    return await _moved(designs, design, 1, revision, caller.name, response)


@router.post("/designs/{design}/versions", status_code=201)
async def save_version(
    caller: Pilot,
    design: str,
    revision: Revision,
    designs: DesignsDep,
    response: Response,
    body: Saving | None = None,
) -> DesignView:
    """Save the working document as a version."""
    comment = "" if body is None else body.comment
    try:
        record = await designs.save(design, comment, revision=revision, by=caller.name)
    except DesignChangedError as error:
        raise _overtaken(error) from error
    return await _answer(designs, record, response)


@router.get("/designs/{design}/versions/{number}")
async def get_version(
    caller: Viewer, design: str, number: int, designs: DesignsDep
) -> VersionDocumentView:
    """Return one version with its document."""
    del caller
    version = await designs.version(design, number)
    document = Design.model_validate(version.document)
    return same(
        VersionDocumentView, version, at=version.saved_at, by=version.saved_by, document=document
    )


@router.post("/designs/{design}/restore")
async def restore(
    caller: Pilot,
    design: str,
    body: Restoring,
    revision: Revision,
    designs: DesignsDep,
    response: Response,
) -> DesignView:
    """Make a version the working document; that is one step, which can be undone."""
    version = await designs.version(design, body.version)
    document = Design.model_validate(version.document)
    what = f"Back to version {body.version}"
    try:
        record = await designs.change(design, document, what, revision=revision, by=caller.name)
    except DesignChangedError as error:
        raise _overtaken(error) from error
    return await _answer(designs, record, response)


@router.get("/designs/{design}/check")
async def check_design(caller: Viewer, design: str, designs: DesignsDep) -> OutlineView:
    """Lay the working document out for its robot as it is now."""
    del caller
    record = await designs.get(design)
    return await designs.outline(record.robot, Design.model_validate(record.document))


@router.get("/designs/{design}/difference")
async def get_difference(
    caller: Viewer,
    design: str,
    sides: SidesDep,
    foundation: FoundationDep,
    first: Side,
    second: Side = "working",
) -> DifferenceView:
    """Compare two versions, or one with a plan or with what is on board, leg by leg."""
    for side in (first, second):
        kind, _, plan = side.partition(":")
        if kind == "plan" and plan:
            await refuse_unseen(foundation.store, caller, "plan", plan)
    return await sides.difference(design, first, second)


@router.post("/designs/{design}/difference")
async def post_difference(
    caller: Viewer, design: str, body: Checking, sides: SidesDep
) -> DifferenceView:
    """Compare the working document (first) with one that was not taken (second)."""
    del caller
    return await sides.difference_with(design, body.document)


@router.post("/designs/{design}/plan", status_code=202)
async def make_plan(
    caller: Pilot,
    design: str,
    designs: DesignsDep,
    started: CalculationStarted,
    body: Planning | None = None,
) -> StartedView:
    """Make a plan of a version: checked, flown ahead, then a draft that can be sent."""
    number = None if body is None else body.version
    try:
        plan = await designs.plan(design, number, by=caller.name)
    except DesignChangedError as error:
        raise _overtaken(error) from error
    return started(plan.id)


async def _moved(
    designs: Designs, design: str, step: int, revision: int, by: str, response: Response
) -> DesignView:
    try:
        record = await designs.move(design, step, revision=revision, by=by)
    except DesignChangedError as error:
        raise _overtaken(error) from error
    return await _answer(designs, record, response)


def _overtaken(error: DesignChangedError) -> Problem:
    newest = error.design
    when = newest.changed_at.isoformat(timespec="seconds").replace("+00:00", "Z")
    return Problem(
        412,
        f"{newest.id} was changed by {newest.changed_by} at {when} ({newest.what}); "
        f"it has revision {newest.revision} now. Nothing of yours was taken.",
        headers={"ETag": f'"{newest.revision}"'},
    )


async def _answer(designs: Designs, record: DesignRecord, response: Response) -> DesignView:
    response.headers["ETag"] = f'"{record.revision}"'
    return same(
        DesignView,
        record,
        document=Design.model_validate(record.document),
        undo=list(record.undo),
        redo=list(record.redo),
        versions=[_version(one) for one in await designs.versions(record.id)],
    )


def _version(version: DesignVersion) -> VersionView:
    return same(VersionView, version, at=version.saved_at, by=version.saved_by)


def _summary(record: DesignRecord, versions: int) -> DesignSummaryView:
    kind = str(record.document.get("content", {}).get("kind", "waypoints"))
    return same(DesignSummaryView, record, kind=kind, versions=versions)
