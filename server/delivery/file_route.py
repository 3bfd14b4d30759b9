"""Files of deployments by REST: written as a job, told with their checks, taken away."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends
from fastapi.responses import FileResponse
from pydantic import Field
from sqlalchemy.orm import Session
from typing_extensions import TypedDict

from db.query.fleet.deployments import get_deployment
from db.query.measured.delivery_files import DeliveryFile, delivery_files, get_delivery_file
from db.record import same
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import FoundationDep, StoreDep, service
from server.base.problem import not_found
from server.base.view import Body, View, one_of
from server.base.work.job_view import JobBegun, JobView, leaves
from server.delivery.file_task import kept_path
from server.delivery.files import FOLDER, DeliveryFiles, FileResult, metadata_of, mode_of

router = APIRouter(prefix="/api/deployments", tags=["data"], route_class=IdempotentRoute)
FilesDep = Annotated[DeliveryFiles, Depends(service(DeliveryFiles))]
_SHOWN_MAX = 50
_MEDIA_TYPE = "application/x-netcdf"


class FindingView(TypedDict):
    """One thing that is wrong with a file, and what to do about it."""

    check: str
    variable: str
    message: str
    fix: str


class CheckView(TypedDict):
    """What one suite of checks said."""

    suite: str
    version: str
    state: Annotated[
        str,
        one_of("passed", "findings", "unchecked"),
        Field(
            description="``unchecked`` wherever the suite did not come to its end; that is never "
            "``passed``."
        ),
    ]
    findings: list[FindingView]
    message: Annotated[str, Field(description="Why it could not be checked.")]
    seconds: float


@dataclass(frozen=True, slots=True)
class FileView(View):
    """A file as it was written."""

    id: str
    name: str
    mode: Annotated[str, one_of("R", "P", "D")]
    """R from telemetry, P recovered and not reviewed, D reviewed."""
    sha256: str
    bytes: int
    rows: int
    at: datetime
    by: str
    left_out: int
    """Further measurements of a channel at a moment that has one already."""
    raised: int
    """Depths just above the surface that stand as 0."""
    checks: list[CheckView]


@dataclass(frozen=True, slots=True)
class MissingField(View):
    """A field of the metadata that a file cannot do without."""

    path: str
    title: str


@dataclass(frozen=True, slots=True)
class FilesView(View):
    """The files of a deployment."""

    mode: Annotated[str, one_of("R", "P", "D")]
    """Of a file that would be written now."""
    missing: list[MissingField]
    """What the metadata of the robot lack; see `GET /api/config/delivery`."""
    files: list[FileView]
    """The newest first."""


class NewFile(Body):
    """What is to be written."""

    no_better_data: bool = False
    """Confirms, for a reviewed deployment, that nothing better exists than telemetry."""


@router.get("/{deployment}/files")
async def list_files(caller: Viewer, deployment: str, store: StoreDep) -> FilesView:
    """Return the files that were written of a deployment, with what the checks say."""
    del caller
    return await store.query(lambda session: _views(session, deployment))


@router.post("/{deployment}/files", status_code=202, openapi_extra=leaves(FileResult))
async def write_file(
    caller: Pilot, deployment: str, files: FilesDep, begun: JobBegun, body: NewFile | None = None
) -> JobView:
    """Write a NetCDF file of OG1.0 and CF-1.10, check it, and keep it.

    422 names what the metadata lack; nothing is written then. 409 while one is being written.
    """
    wish = body or NewFile()
    return await begun(
        await files.start(deployment, no_better_data=wish.no_better_data, by=caller.name)
    )


@router.get(
    "/{deployment}/files/{file}",
    response_class=FileResponse,
    responses={200: {"content": {_MEDIA_TYPE: {}}}},
)
async def get_file(
    caller: Viewer, deployment: str, file: str, store: StoreDep, foundation: FoundationDep
) -> FileResponse:
    """Return the content of a file as it was written."""
    del caller
    record = await store.query(lambda session: get_delivery_file(session, deployment, file))
    path = kept_path(foundation.settings.data_dir / FOLDER, record.sha256)
    if not path.is_file():
        raise not_found(f"{record.name} is no more in the data folder; write it anew.")
    headers = {"ETag": f'"{record.sha256}"'}
    return FileResponse(path, media_type=_MEDIA_TYPE, filename=record.name, headers=headers)


def _views(session: Session, deployment: str) -> FilesView:
    record = get_deployment(session, deployment)
    metadata = metadata_of(session, record.robot)
    return FilesView(
        mode=mode_of(record),
        missing=[MissingField(path, title) for path, title in metadata.missing()],
        files=[file_view(one) for one in delivery_files(session, deployment, _SHOWN_MAX)],
    )


def file_view(file: DeliveryFile) -> FileView:
    """Return a file as REST tells it."""
    kept = file.document
    return same(
        FileView,
        file,
        left_out=int(kept["left_out"]),
        raised=int(kept["raised"]),
        checks=list(kept["checks"]),
    )
