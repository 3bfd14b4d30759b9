"""What a station acknowledged while its processes are killed, kept by somebody who is not killed.

Of samples the robots' own files tell: a robot strikes a sample out when the station has named it
as stored. Of requests the answers tell: entries of the log book are asked for without a pause, each
under a key of its own, and again until one is answered. Of satellite messages the gateway's memory
tells: it drops a message when the station has taken it.
"""

import threading
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import httpx
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db.engine import reading
from db.link_tables import InboxRow
from db.log_book_tables import LogEntryVersionRow
from db.sample_tables import SampleLog, SampleRow, SampleRun
from db.tables import RawFrameRow, Robot
from robot_link.sample_line import read_line
from robot_link.sample_log import SampleKey
from server.access.idempotency import HEADER
from server.cli.demo.gateway import MEMORY_FOLDER, NETWORK_FILE
from simulator.iridium.memory import MemoryFile

PERIOD_S = 0.2
TITLE = "Kept over a kill"
Named = tuple[str, SampleKey]
"""A robot and one of its samples."""


@dataclass(frozen=True, slots=True)
class Losses:
    """What was acknowledged, and what of it is not in the database, or more than once."""

    samples: int
    samples_lost: list[Named]
    entries: int
    entries_lost: list[str]
    messages: int
    messages_lost: list[tuple[str, int]]
    doubles: int
    """Entries, packets and samples beyond the first of each."""

    @property
    def lost(self) -> int:
        return len(self.samples_lost) + len(self.entries_lost) + len(self.messages_lost)


class Witness:
    """Writes and reads beside a demo, from the context's begin to its end.

    Args:
        data: The demo's data folder.
        client: Signed in as somebody who may write.
    """

    def __init__(self, data: Path, client: httpx.Client) -> None:
        self._data = data
        self._client = client
        self._taken: set[Named] = set()
        self._accepted: list[str] = []
        self._number = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="witness", daemon=True)

    def __enter__(self) -> "Witness":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    @property
    def acknowledged_samples(self) -> int:
        """How many samples were taken by now that their robot has struck out."""
        return len(self._taken - self._on_board())

    def losses(self, url: str) -> Losses:
        """Compare with the database, once nothing waits for it any more."""
        acknowledged = self._taken - self._on_board()
        messages = self._messages()
        with reading(url) as session:
            found = Counter(
                text
                for text in session.scalars(select(LogEntryVersionRow.text))
                if text.startswith(TITLE)
            )
            taken = session.execute(select(InboxRow.imei, InboxRow.momsn))
            inbox = {(imei, momsn) for imei, momsn in taken}
            return Losses(
                samples=len(acknowledged),
                samples_lost=sorted(_not_in(session, acknowledged)),
                entries=len(self._accepted),
                entries_lost=[text for text in self._accepted if text not in found],
                messages=len(messages),
                messages_lost=sorted(messages - inbox),
                doubles=sum(found.values()) - len(found) + _packets_twice(session),
            )

    def _run(self) -> None:
        while not self._ended.wait(PERIOD_S):
            self._on_board()
            self._write()

    def _on_board(self) -> set[Named]:
        """Return the samples that robots still keep, and note every one that they ever had."""
        kept: set[Named] = set()
        for file in (self._data / MEMORY_FOLDER).glob("*/samples"):
            robot = file.parent.name
            for line in file.read_bytes().splitlines():
                try:
                    found = read_line(line)
                except ValueError:  # half a line, of a robot that is writing it or was killed
                    continue
                if isinstance(found, list):
                    kept.difference_update((robot, key) for key in found)
                else:
                    kept.add((robot, found[0]))
                    self._taken.add((robot, found[0]))
        return kept

    def _write(self) -> None:
        text = f"{TITLE}: {self._number}"
        headers = {HEADER: text}
        try:
            answer = self._client.post(
                "/api/logbook/entries", json={"text": text}, headers=headers, timeout=5.0
            )
        except httpx.HTTPError:
            return
        if answer.is_success:
            self._accepted.append(text)
        if answer.is_success or "Idempotency-Outcome" in answer.headers:
            self._number += 1

    def _messages(self) -> set[tuple[str, int]]:
        """Return the satellite messages that the gateway has handed over."""
        lines = MemoryFile(self._data / NETWORK_FILE).load().lines
        return {
            (imei, momsn)
            for imei, line in lines.items()
            for momsn in range(line.momsn)
            if momsn not in {message.momsn for message in line.outgoing}
        }


def _not_in(session: Session, samples: Iterable[Named]) -> set[Named]:
    stored: dict[tuple[str, int], list[range]] = {}
    runs = (
        select(Robot.id, SampleLog.log, SampleRun.first, SampleRun.last)
        .join(SampleLog, SampleLog.key == SampleRun.log_key)
        .join(Robot, Robot.key == SampleLog.robot_key)
    )
    for robot, log, first, last in session.execute(runs):
        stored.setdefault((robot, log), []).append(range(first, last + 1))
    return {
        (robot, key)
        for robot, key in samples
        if not any(key.sequence in run for run in stored.get((robot, key.log), []))
    }


def _packets_twice(session: Session) -> int:
    """Return the rows of equal packets, and of samples beyond their numbers."""
    packet = (RawFrameRow.robot_key, RawFrameRow.carrier, RawFrameRow.outgoing, RawFrameRow.at)
    more = func.count(RawFrameRow.key)
    again = select(more - 1).group_by(*packet, RawFrameRow.data).having(more > 1)
    rows = session.scalar(select(func.count()).select_from(SampleRow)) or 0
    numbers = session.scalar(select(func.sum(SampleRun.last - SampleRun.first + 1))) or 0
    return sum(session.scalars(again)) + abs(rows - int(numbers))
