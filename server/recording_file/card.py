"""Reads a recovered card of a robot of ours: its memory of samples and heard tags."""

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

from robot_link.sample_line import LINE_BEGIN, read_line
from robot_link.sample_log import LogEntry, SampleKey
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
class Card:
    """All that a card holds; nothing of it is held against what is kept yet."""

    files: tuple[str, ...]
    entries: tuple[CardEntry, ...]
    faults: tuple[FileFault, ...]
    """Lines that are none, or say another thing of an entry than a line before."""
    repeated: int = 0
    """Lines that say an entry again, as copies of a card do."""

    @property
    def read(self) -> int:
        """How many lines tell an entry, or should."""
        return len(self.entries) + self.repeated + len(self.faults)


def is_card(path: Path) -> bool:
    """Tell whether a file is the memory of a robot, by its first lines."""
    with path.open("rb") as file:
        return LINE_BEGIN.search(file.read(_LOOK_BYTES)) is not None


def read_card(files: Sequence[tuple[str, Path]], tell: Tell) -> Card:
    """Read the files of a card, each the memory of one robot.

    What is known to be ashore counts as well: the card says it again. Lines that only say so are
    no rows.

    Raises:
        UnreadableError: If there is no entry, or there are too many.
    """
    found: dict[SampleKey, CardEntry] = {}
    faults: list[FileFault] = []
    repeated = 0
    for index, (name, path) in enumerate(files):
        size = max(1, path.stat().st_size)
        with path.open("rb") as file:
            for number, line, done in _lines(file):
                if number % _TELL_LINES == 0:
                    tell((index + min(1.0, done / size)) / len(files))
                place = f"line {number}" if len(files) == 1 else f"line {number} of {name}"
                try:
                    told = read_line(line)
                except ValueError as error:
                    faults.append(FileFault(place, str(error)))
                    continue
                if isinstance(told, list):
                    continue
                before = found.setdefault(told[0], CardEntry(place, *told))
                if before.place == place:
                    if len(found) > ROWS_MAX:
                        raise UnreadableError(f"{name} has more than {ROWS_MAX:,} entries.")
                elif before.entry == told[1]:
                    repeated += 1
                else:
                    reason = f"{_named(told[0])} is told otherwise in {before.place}"
                    faults.append(FileFault(place, reason))
    if not found:
        raise UnreadableError(f"{files[0][0]} has no measurement: all of its lines are broken.")
    entries = tuple(found[key] for key in sorted(found))
    return Card(tuple(name for name, _ in files), entries, tuple(faults), repeated)


def _named(key: SampleKey) -> str:
    return f"number {key.sequence} of log {key.log}"


def _lines(file: IO[bytes]) -> Generator[tuple[int, bytes, int]]:
    """Yield each line that is not empty, with its number and the bytes up to its end."""
    done = 0
    for number, line in enumerate(iter(lambda: file.readline(_LINE_LENGTH_MAX), b""), start=1):
        done += len(line)
        if line.strip():
            yield number, line.rstrip(b"\r\n"), done
