"""Deliveries: what is packed of a deployment, how long it is kept, and what is cleared away."""

import asyncio
import logging
import math
import shutil
import time
from collections.abc import Collection
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

from sqlalchemy.orm import Session
from typing_extensions import TypedDict

from db.query.measured.delivery_files import DeliveryFile, delivery_files, kept_files
from db.query.measured.delivery_packages import (
    DeliveryPackage,
    add_delivery_package,
    kept_packages,
)
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.job import JobProgress
from server.base.retry_queue import every
from server.base.study import worked_out
from server.delivery.file_task import PART, KeptFile
from server.delivery.files import FOLDER, Wish, Writing, order_of, refuse_changed, write_kept
from server.delivery.finding import CheckReport, Finding
from server.delivery.package import task as package_task
from server.delivery.package.order import EarlierFile, PackageOrder, words_sha256
from server.delivery.package.task import KeptPackage

log = logging.getLogger(__name__)

JOB: Final = "delivery"
KEPT: Final = timedelta(days=7)
"""How long a delivery is kept once it is packed; the data stay."""
_CLEAN_EVERY_S: Final = 3600.0


class PackageResult(TypedDict):
    """Which delivery was packed."""

    deployment: str
    package: str
    file: str
    sha256: str
    expires_at: str


def package_order_of(session: Session, wish: Wish, *, has_journal: bool) -> PackageOrder:
    """Return what is to be packed of a deployment now; raises as ``order_of`` does."""
    file = order_of(session, wish)
    words = words_sha256(file)
    newest = delivery_files(session, wish.deployment, 1)
    same = [one for one in newest if one.document.get("words_sha256") == words]
    earlier = _earlier(same[0]) if same else None
    return PackageOrder(file, earlier, has_journal, wish.data_dir)


def write_package(
    session: Session, order: PackageOrder, kept: KeptPackage, at: datetime, by: str
) -> DeliveryPackage:
    """Note a delivery that is kept, and the file in it, with their events.

    Raises:
        JobError: If the deployment is not what it was when the delivery was begun.
    """
    if kept.is_new_file or order.earlier is None:
        file = write_kept(session, order.file, kept.file, at, by).id
    else:
        refuse_changed(session, order.file)
        file = order.earlier.id
    record = order.file.wanted.deployment
    package = add_delivery_package(
        session,
        file,
        name=kept.name,
        sha256=kept.sha256,
        size=kept.bytes,
        has_journal=order.has_journal,
        at=at,
        by=by,
        expires_at=at + KEPT,
    )
    text = f"{by}: {kept.name} was packed of {record.id}."
    data = {"deployment": record.id, "package": package.id, "sha256": kept.sha256}
    add_event(session, at, "deployment.packed", text, robot=record.robot, data=data)
    return package


class DeliveryPackages:
    """Has deliveries packed, and clears away what expired. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, writing: Writing) -> None:
        self._foundation = foundation
        self._writing = writing
        self.folder = foundation.settings.data_dir / FOLDER

    def job(self, deployment: str) -> str | None:
        """Return the id of the job that writes something of a deployment, if one does."""
        return self._writing.job(deployment)

    async def start(
        self, deployment: str, *, no_better_data: bool, has_journal: bool, by: str
    ) -> str:
        """Begin to pack a delivery; return the id of the job.

        Raises:
            UnknownIdError: If there is no such deployment.
            Problem: 409 if it has not begun, is void, or something is being written of it; 422
                for what the metadata lack.
        """
        return await self._writing.start(
            deployment,
            lambda session, wish: package_order_of(session, wish, has_journal=has_journal),
            lambda order, progress: self._work(order, by, progress),
            no_better_data=no_better_data,
            by=by,
        )

    async def load(self) -> None:
        """Clear away what a station that was killed had not finished."""
        await self._clean_once(math.inf)

    async def clean(self) -> None:
        """Clear away what expired, until cancelled."""
        await every(
            "clearing away deliveries",
            _CLEAN_EVERY_S,
            lambda: self._clean_once(time.time() - _CLEAN_EVERY_S),
        )

    async def _clean_once(self, before_s: float) -> None:
        """Clear away what is older than a time of the wall: what is new may be in no table yet."""
        now = self._foundation.clock.now()
        files, packages = await self._foundation.store.query(
            lambda session: (kept_files(session), kept_packages(session, now))
        )
        gone = await asyncio.to_thread(cleared, self.folder, files, packages, before_s)
        if gone:
            log.info("%d files of deliveries that nobody knows any more were removed", gone)

    async def _work(self, order: PackageOrder, by: str, progress: JobProgress) -> PackageResult:
        foundation = self._foundation
        kept: KeptPackage = await worked_out(
            foundation.study_workers,
            package_task.TASK,
            order,
            lambda news: progress.report(*news),
        )
        at = foundation.clock.now()
        package = await foundation.store.write(
            lambda session: write_package(session, order, kept, at, by)
        )
        return {
            "deployment": order.file.wanted.deployment.id,
            "package": package.id,
            "file": package.file,
            "sha256": package.sha256,
            "expires_at": package.expires_at.isoformat(),
        }


def cleared(
    folder: Path, files: Collection[str], packages: Collection[str], before_s: float
) -> int:
    """Remove what is not whole, and whole files that no table names; return how many went.

    Args:
        folder: Where they lie.
        files: Hashes of the files that are kept.
        packages: Hashes of the deliveries that are kept.
        before_s: Only what was changed before this time of the wall.
    """
    gone = 0
    for path in folder.iterdir() if folder.is_dir() else ():
        try:
            is_new = path.stat().st_mtime >= before_s
        except FileNotFoundError:
            continue  # a worker has just renamed it
        if is_new:
            continue
        known = files if path.suffix == ".nc" else packages
        is_part = path.name.startswith(".") and PART in path.name
        is_orphan = path.suffix in (".nc", ".zip") and path.stem not in known
        if is_part and path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        elif is_part or is_orphan:
            path.unlink(missing_ok=True)
        else:
            continue
        gone += 1
    return gone


def _earlier(file: DeliveryFile) -> EarlierFile:
    said = file.document
    checks = [
        CheckReport(
            one["suite"],
            one["version"],
            one["state"],
            tuple(Finding(**each) for each in one["findings"]),
            one["message"],
            one["seconds"],
        )
        for one in said["checks"]
    ]
    kept = KeptFile(
        name=file.name,
        sha256=file.sha256,
        bytes=file.bytes,
        rows=file.rows,
        source_sha256=said["source_sha256"],
        raised=said["raised"],
        left_out=said["left_out"],
        checks=tuple(checks),
    )
    return EarlierFile(
        file.id, kept, datetime.fromisoformat(said["written_at"]), str(said["history"])
    )
