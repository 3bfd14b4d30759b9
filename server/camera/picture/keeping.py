"""Pictures that a pilot has kept for a while: for one deployment, and no longer than that counts.

A deployment itself is never deleted. Its pictures are once it is void or was delivered, and with
them goes the last trace of people in them. Until then a pilot may delete them at any time.

They lie in the data folder as ``camera_pictures/<deployment>/<camera>-<time>.jpg``, and nowhere
else: no log, alarm, export or copy of the database holds any.
"""

import asyncio
import logging
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

from sqlalchemy.orm import Session

from db.fault import StoreError, UnknownIdError
from db.query.fleet.deployments import DeploymentRecord, get_deployment
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.problem import conflict
from server.camera.cameras import Cameras
from server.camera.picture.newest import Pictures

log = logging.getLogger(__name__)
FOLDER: Final = "camera_pictures"
MINUTES_MAX: Final = 10


@dataclass(frozen=True, slots=True)
class Keeping:
    """Pictures that are being kept."""

    deployment: str
    cameras: tuple[str, ...]
    until: datetime
    """By the station's clock."""
    by: str


class KeptPictures:
    """Belongs to one event loop."""

    def __init__(self, foundation: Foundation, cameras: Cameras, pictures: Pictures) -> None:
        self._foundation = foundation
        self._cameras, self._pictures = cameras, pictures
        self._folder: Path = foundation.settings.data_dir / FOLDER
        self._end: asyncio.TimerHandle | None = None
        self._writing: set[asyncio.Task[None]] = set()
        self.now: Keeping | None = None
        """What is being kept; None while nothing is."""

    async def begin(
        self, deployment: str, cameras: Sequence[str], minutes: float, *, by: str
    ) -> Keeping:
        """Keep pictures of cameras from now on, for some minutes.

        Raises:
            UnknownIdError: If there is no such deployment or camera.
            Problem: 409 while pictures are being kept already, or for a deployment that is void
                or was delivered.
        """
        if self.now is not None:
            raise conflict("Pictures are being kept already.")
        names = tuple(cameras) or tuple(record.id for record in self._cameras.records)
        for name in names:
            self._cameras.get(name)
        at, clock = self._foundation.clock.now(), self._foundation.clock
        until = at + timedelta(minutes=minutes) * clock.speed
        keeping = self.now = Keeping(deployment, names, until, by)
        folder = self._folder / deployment

        def write(session: Session) -> None:
            if _is_over(get_deployment(session, deployment)):
                raise conflict(f"{deployment} is void or was delivered: it keeps no pictures.")
            text = f"{by} keeps pictures of {', '.join(names)} for {minutes:g} min ({deployment})."
            data = {"deployment": deployment, "cameras": list(names), "minutes": minutes}
            add_event(session, at, "camera.pictures_kept", text, data=data)

        try:
            await self._foundation.store.write(write)
            await asyncio.to_thread(folder.mkdir, parents=True, exist_ok=True, mode=0o700)
        except BaseException:
            if self.now is keeping:
                self.now = None
            raise
        if self.now is keeping:  # nobody ended it meanwhile
            for name in names:
                self._pictures.listen(name, lambda camera, jpeg: self._keep(folder, camera, jpeg))
            self._end = asyncio.get_running_loop().call_later(60.0 * minutes, self._time_is_up)
        self._foundation.feed.mark("camera_pictures")
        return keeping

    async def end(self, *, by: str = "") -> None:
        """Keep no more pictures.

        Args:
            by: Who ends it; nobody where its time is up or the station ends.
        """
        ended = self.now
        if ended is None:
            return
        for name in ended.cameras:
            self._pictures.listen(name, None)
        if self._end is not None:
            self._end.cancel()
        self.now, self._end = None, None
        self._foundation.feed.mark("camera_pictures")
        at, names = self._foundation.clock.now(), ", ".join(ended.cameras)
        text = f"Pictures of {names} are kept no more ({ended.deployment})"

        def write(session: Session) -> None:
            said = f"{text}: {by} ended it." if by else f"{text}."
            data = {"deployment": ended.deployment, "cameras": list(ended.cameras)}
            add_event(session, at, "camera.pictures_ended", said, data=data)

        try:
            await self._foundation.store.write(write)
        except StoreError as error:
            log.warning("%s, which could not be written down: %s", text, error)

    async def counts(self) -> dict[str, int]:
        """Return how many pictures are kept of each deployment."""

        def count() -> dict[str, int]:
            folders = self._folder.iterdir() if self._folder.exists() else ()
            return {one.name: sum(1 for _ in one.glob("*.jpg")) for one in sorted(folders)}

        return await asyncio.to_thread(count)

    async def delete(self, deployment: str, *, by: str) -> None:
        """Delete the pictures of a deployment.

        Raises:
            UnknownIdError: If none are kept.
        """
        if not await self.forget(deployment, by=by):
            raise UnknownIdError("kept pictures of", deployment)

    async def forget(self, deployment: str, *, by: str) -> bool:
        """Delete the pictures of a deployment; return whether there were any."""
        if self.now is not None and self.now.deployment == deployment:
            await self.end(by=by)
        await self._settled()
        if deployment not in await self.counts():
            return False
        await asyncio.to_thread(shutil.rmtree, self._folder / deployment)
        at = self._foundation.clock.now()

        def write(session: Session) -> None:
            text = f"{by} deleted the pictures of {deployment}."
            add_event(session, at, "camera.pictures_deleted", text, data={"deployment": deployment})

        await self._foundation.store.write(write)
        self._foundation.feed.mark("camera_pictures")
        return True

    async def clean(self) -> None:
        """Delete pictures whose deployment is void, was delivered or is gone."""

        def gone(session: Session, names: Sequence[str]) -> list[str]:
            return [name for name in names if not _counts(session, name)]

        names = list(await self.counts())
        if names:
            left = await self._foundation.store.query(lambda session: gone(session, names))
            for name in left:
                await asyncio.to_thread(shutil.rmtree, self._folder / name)

    async def stop(self) -> None:
        """Keep no more, and wait until what came is written."""
        await self.end()
        await self._settled()

    def _time_is_up(self) -> None:
        self._foundation.background.start("end of kept pictures", self.end())

    def _keep(self, folder: Path, camera: str, jpeg: bytes) -> None:
        at = self._foundation.clock.now().strftime("%Y%m%dT%H%M%S.%fZ")
        file = folder / f"{camera}-{at}.jpg"
        task = asyncio.create_task(_write(file, jpeg), name=f"keep {file.name}")
        self._writing.add(task)
        task.add_done_callback(self._writing.discard)

    async def _settled(self) -> None:
        await asyncio.gather(*self._writing)


async def _write(file: Path, jpeg: bytes) -> None:
    try:
        await asyncio.to_thread(file.write_bytes, jpeg)
    except OSError as error:
        log.warning("a picture could not be kept: %s", error.strerror)


def _counts(session: Session, deployment: str) -> bool:
    try:
        return not _is_over(get_deployment(session, deployment))
    except UnknownIdError:
        return False


def _is_over(deployment: DeploymentRecord) -> bool:
    return bool(deployment.void_reason) or deployment.state == "delivered"
