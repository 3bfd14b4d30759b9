"""Log files of robots: listed and fetched over radio, piece by piece, and kept ashore whole."""

import asyncio
import hashlib
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from db.query.fleet import onboard as query
from db.query.fleet.onboard import LogRecord
from robot_link.messages import RobotId
from robot_link.service.file_store import FileEntry
from robot_link.station.error import ServiceError
from server.base.foundation import Foundation
from server.base.job import JobError, JobPerKey, JobProgress
from server.base.problem import not_found
from server.fleet.dependency import refuse_recording
from server.fleet.fleet import Fleet
from server.fleet.words import sentence
from server.link.onboard_view import FetchedLogView, RobotLogsView, RobotLogView

FOLDER = "robot-logs"
"""Where in the data folder the copies lie."""
_DEEPEST_FOLDER = 4


class PartialFile:
    """Grows on disk with ``content``; whoever opens it again finds what was kept."""

    def __init__(self, path: Path) -> None:
        """Read what an earlier attempt left.

        Raises:
            OSError: If it cannot be read.
        """
        self._path = path
        self.content = bytearray(path.read_bytes() if path.exists() else b"")
        """The file as far as it is here; may grow or be cleared by whoever brings it."""
        self._kept = len(self.content)

    def keep(self) -> None:
        """Write what came since; a file that was begun anew is begun anew on disk.

        Raises:
            OSError: If it cannot be written.
        """
        is_longer = len(self.content) >= self._kept
        with self._path.open("ab" if is_longer else "wb") as file:
            file.write(self.content[self._kept :] if is_longer else self.content)
        self._kept = len(self.content)

    def complete(self, path: Path) -> None:
        """Give the whole file its place.

        Raises:
            OSError: If it cannot be written.
        """
        self._path.write_bytes(self.content)
        self._path.replace(path)


class FileRadio(Protocol):
    """The part of the links to the robots that carries files; never a satellite."""

    async def list_files(self, robot: RobotId, path: str = "/") -> Sequence[FileEntry]:
        """Return the entries of a folder."""
        ...

    async def download_file(
        self, robot: RobotId, path: str, *, content: bytearray, report: Callable[[int, int], None]
    ) -> bytes:
        """Return a whole file whose checksum was right; ``content`` grows as it comes."""
        ...


class RobotLogs:
    """Belongs to one event loop; a robot is asked for one thing at a time.

    What comes is written to a ``.part`` file piece by piece; the next transfer goes on from there,
    whatever broke this one off. A copy gets its place only when it is whole.
    """

    def __init__(self, foundation: Foundation, fleet: Fleet, radio: FileRadio) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._listings = JobPerKey[str](foundation.jobs, "log listing")
        self._fetches = JobPerKey[str](foundation.jobs, "log fetching")
        self._fleet = fleet
        self._radio = radio
        self._folder = foundation.settings.data_dir / FOLDER
        self._asking: dict[str, asyncio.Lock] = defaultdict(asyncio.Lock)

    async def view(self, robot: str) -> RobotLogsView:
        """Return the files that a robot named last.

        Raises:
            Problem: 404 if there is no such robot.
        """
        self._fleet.status(robot)
        records = await self._store.query(lambda session: query.list_logs(session, robot))
        return RobotLogsView(
            read_at=max((record.listed_at for record in records), default=None),
            logs=[_view(record, self._fetches.newest(record.id)) for record in records],
            job=self._listings.newest(robot),
        )

    async def read(self, robot: str, *, by: str) -> str:
        """Begin to ask for the list of files; return the job's id.

        Raises:
            Problem: 404 for an unknown robot, 409 for a recording.
        """
        refuse_recording(self._fleet.status(robot), "cannot be asked anything")
        return await self._listings.start(
            robot, lambda progress: self._list(robot, progress), by=by
        )

    async def download(self, robot: str, path: str, *, by: str) -> str:
        """Begin to fetch a file; return the job's id, that of the one under way if any.

        Raises:
            Problem: 404 for an unknown robot or file, 409 for a recording.
        """
        refuse_recording(self._fleet.status(robot), "cannot be asked anything")
        known = await self._store.query(lambda session: query.list_logs(session, robot))
        record = next((one for one in known if one.path == path), None)
        if record is None:
            raise not_found(f"{robot} has named no file {path!r}; list its files first.")
        return await self._fetches.start(
            record.id, lambda progress: self._fetch(record, progress), by=by
        )

    async def copy(self, robot: str, log: str) -> tuple[LogRecord, Path]:
        """Return a file's record and where its copy lies.

        Raises:
            UnknownIdError: If there is no such file.
            Problem: 404 if it is another robot's, or was not fetched yet.
        """
        record = await self._store.query(lambda session: query.get_log(session, log))
        path = self._folder / f"{log}.bin"
        if record.robot != robot or record.sha256 is None or not path.exists():
            raise not_found(f"{log} of {robot} is not ashore; fetch it first.")
        return record, path

    async def _list(self, robot: str, progress: JobProgress) -> Mapping[str, Any]:
        progress.report(0.0, f"Asking {robot} for its files.")
        sizes: dict[str, int] = {}
        try:
            async with self._asking[robot]:
                await self._walk(RobotId(robot), "/", sizes, _DEEPEST_FOLDER)
        except ServiceError as error:
            raise JobError(sentence(error)) from error
        at = self._clock.now()
        await self._store.write(lambda session: query.keep_listing(session, robot, sizes, at))
        return {"files": len(sizes)}

    async def _walk(self, robot: RobotId, path: str, sizes: dict[str, int], deeper: int) -> None:
        for entry in await self._radio.list_files(robot, path):
            below = f"{path.rstrip('/')}/{entry.name}"
            if not entry.is_folder:
                sizes[below] = entry.size
            elif deeper:
                await self._walk(robot, below, sizes, deeper - 1)

    async def _fetch(self, record: LogRecord, progress: JobProgress) -> Mapping[str, Any]:
        self._folder.mkdir(parents=True, exist_ok=True)
        async with self._asking[record.robot]:
            part = PartialFile(self._folder / f"{record.id}.part")

            def report(received: int, total: int) -> None:
                part.keep()
                share = received / total if total else 1.0
                progress.report(share, f"{received} of {total} bytes of {record.path}.")

            had = len(part.content)
            report(had, max(record.size, had))
            try:
                content = await self._radio.download_file(
                    RobotId(record.robot), record.path, content=part.content, report=report
                )
            except ServiceError as error:
                raise JobError(sentence(error)) from error
            part.complete(self._folder / f"{record.id}.bin")
        sha256 = hashlib.sha256(content).hexdigest()
        at = self._clock.now()
        await self._store.write(
            lambda session: query.note_fetched(
                session, record.id, size=len(content), sha256=sha256, at=at
            )
        )
        return {"log": record.id, "bytes": len(content), "sha256": sha256}


def _view(record: LogRecord, job: str | None) -> RobotLogView:
    fetched = None
    if record.sha256 is not None and record.fetched_at is not None:
        fetched = FetchedLogView(
            record.id, record.fetched_at, record.fetched_size or 0, record.sha256
        )
    return RobotLogView(
        id=record.id,
        path=record.path,
        bytes=record.size,
        modified_at=None,
        downloaded=fetched,
        job=job,
    )
