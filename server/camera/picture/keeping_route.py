"""Pictures that are kept on purpose: begun, ended, counted, deleted."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import Field

from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.access.subject import refuse_unseen
from server.base.dependency import StoreDep, service
from server.base.view import Body, View
from server.camera.picture.keeping import MINUTES_MAX, KeptPictures
from server.camera.view import CameraId

router = APIRouter(prefix="/api/camera-pictures", tags=["cameras"], route_class=IdempotentRoute)

KeptDep = Annotated[KeptPictures, Depends(service(KeptPictures))]


class KeepOrder(Body):
    """Which pictures are to be kept."""

    deployment: str = Field(max_length=40)
    """To which they belong: they are deleted once it is void or was delivered."""
    cameras: list[CameraId] = Field(default_factory=list, max_length=20)
    """Of which cameras; by default of all."""
    minutes: float = Field(gt=0.0, le=MINUTES_MAX, allow_inf_nan=False)
    """For so long."""


@dataclass(frozen=True, slots=True)
class KeptView(View):
    """Pictures of one deployment."""

    deployment: str
    count: int


@dataclass(frozen=True, slots=True)
class KeepingView(View):
    """What is being kept now, and what was."""

    deployment: str | None
    """For which pictures are kept now; ``null`` while none are."""
    cameras: list[str]
    until: datetime | None
    by: str | None
    kept: list[KeptView]


@router.get("")
async def get_kept(caller: Viewer, pictures: KeptDep) -> KeepingView:
    """Return whether pictures are being kept, and how many are."""
    del caller
    return await _view(pictures)


@router.post("")
async def keep(caller: Pilot, body: KeepOrder, pictures: KeptDep, store: StoreDep) -> KeepingView:
    """Keep two pictures a second of cameras, for ten minutes at most; everybody is told.

    They lie on the station's machine alone. They are deleted once their deployment is voided or
    delivered, and earlier where a pilot deletes them; a deployment itself is never deleted.
    """
    await refuse_unseen(store, caller, "deployment", body.deployment)
    await pictures.begin(body.deployment, body.cameras, body.minutes, by=caller.name)
    return await _view(pictures)


@router.delete("")
async def end_keeping(caller: Pilot, pictures: KeptDep) -> KeepingView:
    """Keep no more pictures."""
    await pictures.end(by=caller.name)
    return await _view(pictures)


@router.delete("/{deployment}")
async def delete_kept(caller: Pilot, deployment: str, pictures: KeptDep) -> KeepingView:
    """Delete the pictures that are kept of a deployment."""
    await pictures.delete(deployment, by=caller.name)
    return await _view(pictures)


async def _view(pictures: KeptPictures) -> KeepingView:
    now = pictures.now
    counts = await pictures.counts()
    return KeepingView(
        None if now is None else now.deployment,
        [] if now is None else list(now.cameras),
        None if now is None else now.until,
        None if now is None else now.by,
        [KeptView(deployment, count) for deployment, count in counts.items()],
    )
