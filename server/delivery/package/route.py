"""Deliveries by REST: packed as a job, told with what the checks say, taken away as one ZIP."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends
from fastapi.responses import FileResponse
from sqlalchemy.orm import Session

from db.query.fleet.deployments import get_deployment
from db.query.measured.delivery_files import delivery_files
from db.query.measured.delivery_packages import (
    DeliveryPackage,
    delivery_packages,
    get_delivery_package,
)
from db.record import same
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import FoundationDep, StoreDep, service
from server.base.problem import Problem, not_found
from server.base.view import Body, View, one_of
from server.base.work.job_view import JobBegun, JobView, leaves
from server.delivery.file_route import CheckView, FileView, FindingView, file_view
from server.delivery.file_task import OWN_SUITE
from server.delivery.package.packages import DeliveryPackages, PackageResult
from server.delivery.package.task import package_path

router = APIRouter(prefix="/api/deployments", tags=["data"], route_class=IdempotentRoute)
PackagesDep = Annotated[DeliveryPackages, Depends(service(DeliveryPackages))]
_SHOWN_MAX = 50
_MEDIA_TYPE = "application/zip"


@dataclass(frozen=True, slots=True)
class PackageView(View):
    """A delivery as it was packed."""

    id: str
    file: str
    """Id of the NetCDF file in it."""
    name: str
    sha256: str
    bytes: int
    has_journal: bool
    """Whether the packets of the robot are in it."""
    at: datetime
    by: str
    expires_at: datetime
    """From then on it is gone; the data are not, and can be delivered anew."""
    is_expired: bool


@dataclass(frozen=True, slots=True)
class DeliveryView(View):
    """How far the delivery of a deployment is."""

    state: Annotated[str, one_of("none", "being_made", "ready", "expired")]
    job: str | None
    """Id of the job that writes something of it now."""
    file: FileView | None
    """The newest NetCDF file."""
    checks: list[CheckView]
    """What the field's checkers say of it."""
    own: list[FindingView]
    """What the station's own checks found in it."""
    packages: list[PackageView]
    """Deliveries, the newest first."""


class NewPackage(Body):
    """What is to be packed."""

    no_better_data: bool = False
    """Confirms, for a reviewed deployment, that nothing better exists than telemetry."""
    has_journal: bool = False
    """Adds every packet of the robot, without those that carry keys."""


@router.get("/{deployment}/delivery")
async def get_delivery(
    caller: Viewer,
    deployment: str,
    store: StoreDep,
    packages: PackagesDep,
    foundation: FoundationDep,
) -> DeliveryView:
    """Return how far the delivery of a deployment is, and what the checks say of its file."""
    del caller
    job, now = packages.job(deployment), foundation.clock.now()
    return await store.query(lambda session: _view(session, deployment, job, now))


@router.post("/{deployment}/delivery", status_code=202, openapi_extra=leaves(PackageResult))
async def make_delivery(
    caller: Pilot,
    deployment: str,
    packages: PackagesDep,
    begun: JobBegun,
    body: NewPackage | None = None,
) -> JobView:
    """Pack all that is to be handed over of a deployment as one ZIP, a bag of BagIt 1.0.

    It holds NetCDF, CSV, track, log book, report, plans, settings, rules and checks. The same
    content makes the same bytes. A deployment that still runs is delivered in mode R, as it
    stands. 422 names what the metadata lack. 409 while something is being written of it.
    """
    wish = body or NewPackage()
    return await begun(
        await packages.start(
            deployment,
            no_better_data=wish.no_better_data,
            has_journal=wish.has_journal,
            by=caller.name,
        )
    )


@router.get(
    "/{deployment}/delivery/{package}",
    response_class=FileResponse,
    responses={200: {"content": {_MEDIA_TYPE: {}}}},
)
async def get_package(
    caller: Viewer,
    deployment: str,
    package: str,
    store: StoreDep,
    packages: PackagesDep,
    foundation: FoundationDep,
) -> FileResponse:
    """Return a delivery as it was packed; 410 once it has expired."""
    del caller
    found = await store.query(lambda session: get_delivery_package(session, deployment, package))
    if found.expires_at <= foundation.clock.now():
        at = f"{found.expires_at:%Y-%m-%d %H:%M}Z"
        raise Problem(410, f"{found.name} expired at {at}; deliver the deployment anew.")
    path = package_path(packages.folder, found.sha256)
    if not path.is_file():
        raise not_found(f"{found.name} is no more in the data folder; deliver it anew.")
    headers = {"ETag": f'"{found.sha256}"'}
    return FileResponse(path, media_type=_MEDIA_TYPE, filename=found.name, headers=headers)


def _view(session: Session, deployment: str, job: str | None, now: datetime) -> DeliveryView:
    get_deployment(session, deployment)
    newest = [file_view(one) for one in delivery_files(session, deployment, 1)]
    file = newest[0] if newest else None
    checks = [] if file is None else file.checks
    packed = [_package(one, now) for one in delivery_packages(session, deployment, _SHOWN_MAX)]
    state = "none" if not packed else "expired" if packed[0].is_expired else "ready"
    return DeliveryView(
        state="being_made" if job is not None else state,
        job=job,
        file=file,
        checks=[one for one in checks if one["suite"] != OWN_SUITE],
        own=[found for one in checks if one["suite"] == OWN_SUITE for found in one["findings"]],
        packages=packed,
    )


def _package(package: DeliveryPackage, now: datetime) -> PackageView:
    return same(PackageView, package, is_expired=package.expires_at <= now)
