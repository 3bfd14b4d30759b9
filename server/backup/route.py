"""Backups by REST: what there is, the schedule, and one at once."""

import asyncio
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends
from sqlalchemy.orm import Session

from db.query.station.events import add_event
from db.record import same
from server.access.dependency import Admin, Pilot
from server.access.idempotency import IdempotentRoute
from server.backup.backups import BackupResult, Backups
from server.backup.failure import BackupError
from server.backup.settings import BackupSettings, save_settings
from server.base.dependency import FoundationDep, service
from server.base.problem import FieldError, unprocessable
from server.base.view import View
from server.base.work.job_view import JobBegun, JobView, leaves

router = APIRouter(prefix="/api/backups", tags=["backups"], route_class=IdempotentRoute)
BackupsDep = Annotated[Backups, Depends(service(Backups))]


@dataclass(frozen=True, slots=True)
class BackupView(View):
    """One whole backup."""

    name: str
    at: datetime
    """When it was begun: what the station acknowledged before is in it."""
    bytes: int
    is_encrypted: bool


@dataclass(frozen=True, slots=True)
class BackupsView(View):
    """The backups of the station, and what is to be known of them."""

    settings: BackupSettings
    key_fingerprint: str | None
    """Of the key that they are encrypted for."""
    backups: list[BackupView]
    """The newest first; each was read again after it was written."""
    last_good_at: datetime | None
    next_at: datetime | None
    """None where none is scheduled. In the past while one is due."""
    job: str | None
    """Id of the job that makes one now."""
    failed: str
    """Why the last one failed; empty if none did since the last good one."""
    fault: str
    """Why the folder cannot be read, or which backups in it are of a time to come, or empty."""
    free_bytes: int | None
    """Room in the folder."""
    is_same_disk: bool
    """Whether the folder is on the disk of the data: both are lost together."""


@router.get("")
async def get_backups(caller: Pilot, backups: BackupsDep) -> BackupsView:
    """Return the backups with their settings."""
    del caller
    return await _view(backups)


@router.put("/settings")
async def put_backup_settings(
    caller: Admin, body: BackupSettings, backups: BackupsDep, foundation: FoundationDep
) -> BackupsView:
    """Change the schedule, the folder, the rotation or the key."""
    if body.folder:
        try:
            await asyncio.to_thread(backups.shelf(body).check)
        except BackupError as error:
            wrong = FieldError(loc=["folder"], msg=str(error))
            raise unprocessable("The folder cannot be used.", errors=[wrong]) from error

    def write(session: Session) -> None:
        save_settings(session, body)
        text = f"{caller.name} changed when and where the station is backed up."
        add_event(session, foundation.clock.now(), "backup.settings", text)

    await foundation.store.write(write)
    await backups.change(body)
    return await _view(backups)


@router.post("", status_code=202, openapi_extra=leaves(BackupResult))
async def back_up(caller: Admin, backups: BackupsDep, begun: JobBegun) -> JobView:
    """Back the station up at once; the job tells how far it is, and can be called off."""
    return await begun(await backups.start(by=caller.name))


async def _view(backups: Backups) -> BackupsView:
    standing = await backups.standing()
    key, room = standing.settings.key, standing.room
    return same(
        BackupsView,
        standing,
        backups=[same(BackupView, one) for one in standing.backups],
        key_fingerprint=None if key is None else key.fingerprint,
        job=backups.job,
        free_bytes=None if room is None else room.free_bytes,
        is_same_disk=room is not None and room.is_same_disk,
    )
