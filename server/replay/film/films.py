"""Films of robots: made in a worker, kept for a week, cleared away when they expire."""

import asyncio
import logging
import math
import os
import secrets
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from sqlalchemy.orm import Session
from typing_extensions import TypedDict

from autonomy.vehicle.hull import Hull
from db.query.fleet.deployments import deployment_at
from robot_link.messages import RobotId
from server.base.foundation import Foundation
from server.base.job import JobPerKey, JobProgress
from server.base.problem import FieldError, not_found, unprocessable
from server.base.retry_queue import every
from server.base.study import worked_out
from server.fleet.fleet import Fleet
from server.replay.film import task
from server.replay.film.order import ENDINGS, PART, FilmOrder, KeptFilm, Kind
from server.scene.replay_host import moment_asked
from server.scene.replay_source import Clock
from server.vehicle.vehicles import Vehicles

log = logging.getLogger(__name__)

JOB: Final = "film"
FOLDER: Final = "film"
"""Of the data folder; below it one of each robot, and in that one of each film."""
KEPT: Final = timedelta(days=7)
_CLEAN_EVERY_S: Final = 3600.0
_SHORTEST: Final = timedelta(seconds=1)


class FilmResult(TypedDict):
    """Which film was made."""

    robot: str
    film: str
    name: str
    sha256: str


@dataclass(frozen=True, slots=True)
class FilmFile:
    """A film that is kept."""

    id: str
    kind: Kind
    path: Path
    bytes: int
    at: datetime
    """When it was made, by the clock of the computer."""

    @property
    def expires_at(self) -> datetime:
        """When it goes."""
        return self.at + KEPT


class Films:
    """Has films made, one of a robot at a time. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet, vehicles: Vehicles) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._vehicles = vehicles
        self._jobs = JobPerKey[RobotId](foundation.jobs, JOB)
        self._folder = foundation.settings.data_dir / FOLDER

    def job(self, robot: RobotId) -> str | None:
        """Return the id of the job that makes a film of a robot, if one does."""
        return self._jobs.get(robot)

    async def start(
        self,
        robot: RobotId,
        stretch: tuple[datetime, datetime],
        *,
        clock: Clock,
        kind: Kind,
        lasts_s: int,
        by: str,
    ) -> str:
        """Begin to make a film; return the id of the job.

        Raises:
            UnknownIdError: If there is no such robot.
            Problem: 422 for a stretch that cannot be replayed, 409 while one is being made.
        """
        status, now = self._fleet.status(robot), self._foundation.clock.now()
        first, last = moment_asked(stretch[0], now), moment_asked(stretch[1], now)
        await self._foundation.store.query(
            lambda session: refuse_stretch(session, robot, first, last)
        )
        vehicle = self._vehicles.find(status.record.model)
        order = FilmOrder(
            id=secrets.token_hex(8),
            robot=status.record,
            first=first,
            last=last,
            clock="measured" if status.record.kind == "recorded" else clock,
            kind=kind,
            lasts_s=lasts_s,
            made_at=now,
            database_url=self._foundation.settings.resolved_database_url,
            folder=self._folder / robot,
            hull=Hull() if vehicle is None else vehicle.hull,
            thresholds_m=status.track.thresholds_m,
            channels=self._foundation.channels.catalogue,
        )
        return await self._jobs.start_alone(
            robot,
            lambda progress: self._work(order, progress),
            refusal=f"A film of {robot} is being made; wait for it, or cancel it.",
            by=by,
            robot=robot,
        )

    async def films(self, robot: RobotId) -> list[FilmFile]:
        """Return the films of a robot, the newest first.

        Raises:
            UnknownIdError: If there is no such robot.
        """
        self._fleet.status(robot)
        found = await asyncio.to_thread(lambda: list(kept_films(self._folder / robot)))
        return sorted(found, key=lambda one: one.at, reverse=True)

    async def film(self, robot: RobotId, film: str) -> FilmFile:
        """Return one film.

        Raises:
            UnknownIdError: If there is no such robot.
            Problem: 404 if there is no such film, or no more.
        """
        for one in await self.films(robot):
            if one.id == film:
                return one
        raise not_found(f"There is no film {film} of {robot} any more; make it anew.")

    async def load(self) -> None:
        """Clear away what a station that was killed had not finished."""
        await asyncio.to_thread(cleared, self._folder, math.inf)

    async def clean(self) -> None:
        """Clear away what expired, until cancelled."""
        await every("clearing away films", _CLEAN_EVERY_S, self._clean_once)

    async def _clean_once(self) -> None:
        gone = await asyncio.to_thread(cleared, self._folder, time.time() - _CLEAN_EVERY_S)
        if gone:
            log.info("%d films that expired were removed", gone)

    async def _work(self, order: FilmOrder, progress: JobProgress) -> FilmResult:
        progress.wait_for_process()
        kept: KeptFilm = await worked_out(
            self._foundation.study_workers, task.TASK, order, lambda news: progress.report(*news)
        )
        robot = order.robot.id
        return {"robot": robot, "film": kept.id, "name": kept.name, "sha256": kept.sha256}


def refuse_stretch(session: Session, robot: RobotId, first: datetime, last: datetime) -> None:
    """Refuse a stretch that is not one of a replay.

    Raises:
        Problem: 422 where it is empty, or goes beyond the deployment that it begins in.
    """
    deployment = deployment_at(session, robot, first)
    message = ""
    if last < first + _SHORTEST:
        message = "it must be at least a second after the first moment"
    elif deployment is not None and deployment.last_at is not None and last > deployment.last_at:
        message = f"{deployment.id} ended before"
    if message:
        raise unprocessable("1 field is wrong.", [FieldError(loc=["last"], msg=message)])


def kept_films(folder: Path) -> Iterator[FilmFile]:
    """Yield the films that lie whole in the folder of a robot."""
    kinds: dict[str, Kind] = {ending: kind for kind, ending in ENDINGS.items()}
    for one in _listed(folder):
        for path in () if one.name.startswith(".") else _listed(one):
            if path.suffix in kinds and (told := _told(path)) is not None:
                at = datetime.fromtimestamp(told.st_mtime, UTC)
                yield FilmFile(one.name, kinds[path.suffix], path, told.st_size, at)


def _listed(folder: Path) -> list[Path]:
    """Return what lies in a folder; nothing of one that is none, or is cleared away just now."""
    try:
        return list(folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return []


def _told(path: Path) -> os.stat_result | None:
    """Return what is known of a file; ``None`` if it is renamed or cleared away just now."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def cleared(folder: Path, before_s: float) -> int:
    """Remove films that expired, and what is not whole; return how many went.

    Args:
        folder: Of all robots.
        before_s: What is not whole goes if it was changed before this time of the wall.
    """
    gone = 0
    for robot in _listed(folder):
        for one in _listed(robot):
            told = _told(one)
            is_part = one.name.startswith(".") and one.name.endswith(PART)
            if told is not None and told.st_mtime < (
                before_s if is_part else time.time() - KEPT.total_seconds()
            ):
                shutil.rmtree(one, ignore_errors=True)
                gone += 1
    return gone
