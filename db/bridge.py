"""The bridge journal: telemetry that waits on the disk until the database takes it again.

Each batch that the writer hands to the database has a number. The transaction that keeps a batch
keeps its number, too, beside the name of the journal; so a batch that is tried again, from memory
or from this file, is written once, wherever the station or the database was killed.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sqlalchemy.orm import Session

from db.frame_file import START, TORN, FrameFile
from db.ingest import Telemetry
from db.query.station.settings import get_setting, replace_setting
from db.telemetry_text import TelemetryTextError, rows_of, text_of

log = logging.getLogger(__name__)

FILE_NAME: Final = "bridge.journal"
"""In the station's data folder."""
REFUSED_NAME: Final = "bridge.refused"
"""Beside it: rows that the database will never take, as text."""
TORN_NAME: Final = f"bridge{TORN}"
"""Beside it: what the disk has damaged."""
RESERVE_BYTES: Final = 256 * 2**20
"""Stays free on the disk, for whatever else the station and its machine must write."""
_MARK: Final = "bridge"


@dataclass(frozen=True, slots=True)
class Batch:
    """Rows that were handed over together, and the number by which they are written once."""

    number: int
    rows: Sequence[Telemetry]


class Bridge:
    """Batches on the disk, the oldest first. Belongs to the writer's thread.

    Args:
        folder: The station's data folder, which one process holds at a time.
        reserve_bytes: What must stay free on its disk.
    """

    def __init__(self, folder: Path, reserve_bytes: int = RESERVE_BYTES) -> None:
        self._file = FrameFile(folder / FILE_NAME, reserve_bytes)
        self._refused = folder / REFUSED_NAME
        self._begin = START
        self._read_to = START
        self._read_rows = 0
        self._last = 0
        self._tried = 0
        """Newest number that may be in the database; no batch beyond it can be."""
        self.waiting_rows = 0
        """Rows that are on the disk and not in the database, as far as is known."""
        for frame in self._file.frames():
            number, rows, _ = _parts(frame.payload)
            self._last = max(self._last, number)
            self.waiting_rows += rows
        self._tried = self._last
        if self.waiting_rows:
            log.info("%d rows wait on the disk for the database", self.waiting_rows)

    def batch(self, rows: Sequence[Telemetry]) -> Batch:
        """Return rows under a number of their own."""
        self._last += 1
        return Batch(self._last, rows)

    def put(self, batch: Batch) -> None:
        """Keep a batch behind all others; it is on the disk when this returns.

        Raises:
            OSError: It is not.
        """
        head = f"{batch.number} {len(batch.rows)}\n".encode()
        self._file.append(head + text_of(batch.rows))
        self.waiting_rows += len(batch.rows)

    def oldest(self, rows_max: int) -> list[Batch]:
        """Return the batches to write next: at least one, and no further one beyond a count.

        One that is not understood is kept beside the journal for a person, and left out.

        Raises:
            OSError: If the disk cannot be read.
        """
        found: list[Batch] = []
        self._read_to, self._read_rows = self._begin, 0
        for frame in self._file.frames(self._begin):
            number, rows, text = _parts(frame.payload)
            if found and self._read_rows + rows > rows_max:
                break
            try:
                found.append(Batch(number, rows_of(text)))
            except TelemetryTextError as error:
                self._refuse(text, error)
            self._read_to = frame.end
            self._read_rows += rows
        else:  # what the disk has damaged since it was counted waits no more
            self._read_to, self._read_rows = self._file.end, self.waiting_rows
        return found

    def written(self) -> None:
        """Take that the batches of ``oldest`` are in the database.

        When these were all, the file goes. Where the disk keeps it, the next batch replaces what is
        in it; read at a start before that, its batches are known by their numbers.
        """
        self.waiting_rows -= self._read_rows
        self._begin = self._read_to
        if self._begin == self._file.end:
            self._begin = START
            try:
                self._file.clear()
            except OSError as error:
                log.warning("the bridge journal is empty and cannot be removed: %s", error)

    def refuse(self, rows: Sequence[Telemetry], error: Exception) -> None:
        """Keep rows that the database will never take beside the journal, for a person."""
        self._refuse(text_of(rows), error)

    def catch_up(self, session: Session) -> None:
        """Give no batch a number from now on that the database knows already."""
        self._last = self._tried = max(self._last, self._written(session))

    def keep_once(self, session: Session, batch: Batch) -> bool:
        """Note in a transaction that it keeps a batch; tell whether none did before."""
        if batch.number <= self._tried and batch.number <= self._written(session):
            return False
        self._tried = max(self._tried, batch.number)
        replace_setting(session, _MARK, {"name": self._file.name.hex, "number": batch.number})
        return True

    def close(self) -> None:
        """Let go of the file; what is in it waits for the next start."""
        self._file.close()

    def _written(self, session: Session) -> int:
        """Return the number of the newest batch of this journal in the database."""
        mark = get_setting(session, _MARK)
        return 0 if mark is None or mark["name"] != self._file.name.hex else mark["number"]

    def _refuse(self, text: bytes, error: Exception) -> None:
        log.error("rows of the bridge journal are in %s, not in the database: %s",
                  self._refused, error)  # fmt: skip
        with self._refused.open("ab") as file:
            file.write(text + b"\n")


def _parts(payload: bytes) -> tuple[int, int, bytes]:
    """Return number, count of rows and text of a batch."""
    head, _, text = payload.partition(b"\n")
    number, rows = head.split()
    return int(number), int(rows), text
