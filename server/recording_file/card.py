"""Reads a recovered card of a robot of ours: its memory of samples and tags, and its track."""

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import IO, Final

from db.column import EPOCH
from robot_link.messages import RobotId, StateReport
from robot_link.sample_line import LINE_BEGIN, read_line
from robot_link.sample_log import LogEntry, SampleKey
from robot_link.track_line import TRACK_HEADER, read_track_line
from server.recording_file.raw import FileFault, Tell, UnreadableError

ROWS_MAX: Final = 2_000_000
"""Entries are held in memory, at about half a kilobyte each."""
_LOOK_BYTES: Final = 4096
_TELL_LINES: Final = 20_000
_LINE_LENGTH_MAX: Final = 100_000


@dataclass(frozen=True, slots=True)
class CardEntry:
    """One entry, and where it stands."""

    place: str
    """Such as ``line 12``."""
    key: SampleKey
    entry: LogEntry


@dataclass(frozen=True, slots=True)
class CardState:
    """Where the robot believed to be at one moment, and where that stands."""

    place: str
    state: StateReport
    """With no robot's name yet."""


@dataclass(frozen=True, slots=True)
class Card:
    """All that a card holds; nothing of it is held against what is kept yet."""

    files: tuple[str, ...]
    entries: tuple[CardEntry, ...]
    faults: tuple[FileFault, ...]
    """Lines that are none, or say another thing of an entry than a line before."""
    repeated: int = 0
    """Lines that say an entry or a state again, as copies of a card do."""
    states: tuple[CardState, ...] = ()
    """Ascending in time."""
    left_out: tuple[str, ...] = ()
    """Files that lie on a card and tell nothing of this, such as its plan."""

    @property
    def read(self) -> int:
        """How many lines tell an entry, or should."""
        return len(self.entries) + len(self.states) + self.repeated + len(self.faults)

    @property
    def times(self) -> list[datetime]:
        """When everything was measured, by the card's clock."""
        return [
            *(one.entry.measured_at for one in self.entries),
            *(one.state.measured_at for one in self.states),
        ]


def is_card(path: Path) -> bool:
    """Tell whether a file is a memory or a track of a robot, by its first lines."""
    with path.open("rb") as file:
        head = file.read(_LOOK_BYTES)
    return head.startswith(TRACK_HEADER.encode()) or LINE_BEGIN.search(head) is not None


def read_card(files: Sequence[tuple[str, Path]], tell: Tell, left_out: Sequence[str] = ()) -> Card:
    """Read the files of a card, each a memory or a track of one robot.

    What is known to be ashore counts as well: the card says it again. Lines that only say so are
    no rows.

    Raises:
        UnreadableError: If nothing is told, or too much.
    """
    reading = _Reading()
    for index, (name, path) in enumerate(files):
        size = max(1, path.stat().st_size)
        with path.open("rb") as file:
            take = reading.take_entry
            for number, line, done in _lines(file):
                if number % _TELL_LINES == 0:
                    tell((index + min(1.0, done / size)) / len(files))
                if number == 1 and line == TRACK_HEADER.encode():
                    take = reading.take_state
                    continue
                place = f"line {number}" if len(files) == 1 else f"line {number} of {name}"
                try:
                    take(place, line)
                except ValueError as error:
                    reading.faults.append(FileFault(place, str(error)))
                if reading.count > ROWS_MAX:
                    raise UnreadableError(f"{name} has more than {ROWS_MAX:,} entries.")
    if not reading.count:
        raise UnreadableError(f"{files[0][0]} has no measurement: all of its lines are broken.")
    entries, states = reading.entries, reading.states
    return Card(
        tuple(name for name, _ in files),
        tuple(entries[key] for key in sorted(entries)),
        tuple(reading.faults),
        reading.repeated,
        tuple(states[at] for at in sorted(states)),
        tuple(left_out),
    )


class _Reading:
    """What was read so far."""

    def __init__(self) -> None:
        self.entries: dict[SampleKey, CardEntry] = {}
        self.states: dict[datetime, CardState] = {}
        self.faults: list[FileFault] = []
        self.repeated = 0

    @property
    def count(self) -> int:
        """How much is told."""
        return len(self.entries) + len(self.states)

    def take_entry(self, place: str, line: bytes) -> None:
        """Take a line of a memory.

        Raises:
            ValueError: If it is none, or says another thing than one before.
        """
        told = read_line(line)
        if isinstance(told, list):
            return
        before = self.entries.setdefault(told[0], CardEntry(place, *told))
        if before.place == place:
            return
        if before.entry != told[1]:
            raise ValueError(f"{_named(told[0])} is told otherwise in {before.place}")
        self.repeated += 1

    def take_state(self, place: str, line: bytes) -> None:
        """Take a line of a track; raises as ``take_entry``."""
        state = read_track_line(line.decode("ascii", "replace"), RobotId(""), EPOCH)
        before = self.states.setdefault(state.measured_at, CardState(place, state))
        if before.place == place:
            return
        if before.state != state:
            raise ValueError(f"its moment is told otherwise in {before.place}")
        self.repeated += 1


def _named(key: SampleKey) -> str:
    return f"number {key.sequence} of log {key.log}"


def _lines(file: IO[bytes]) -> Generator[tuple[int, bytes, int]]:
    """Yield each line that is not empty, with its number and the bytes up to its end."""
    done = 0
    for number, line in enumerate(iter(lambda: file.readline(_LINE_LENGTH_MAX), b""), start=1):
        done += len(line)
        if line.strip():
            yield number, line.rstrip(b"\r\n"), done
