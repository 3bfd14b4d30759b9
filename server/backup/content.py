"""What of a data folder is in a backup, and what is not.

Whatever a folder of the data folder holds is either lost with it or made anew; each is in one of
the two tables. Rows that were acknowledged and are in no database yet are packed, too.
"""

from collections.abc import Generator, Mapping
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Final

from db.bridge import FILE_NAME, REFUSED_NAME, TORN_NAME

SQLITE: Final = "station.sqlite3"
"""The database of SQLite, as a file that can be opened."""
DUMP: Final = "station.dump"
"""The database of PostgreSQL, as ``pg_dump --format=custom`` writes it."""
CLOCK: Final = "clock.json"
"""Clock of a demo."""
MANIFEST: Final = "manifest.json"
"""Sizes and hashes of all other members; the last one."""
BRIDGED: Final = (FILE_NAME, REFUSED_NAME, TORN_NAME)
"""Files with rows on their way into the database, in the order in which rows go through them.

They are copied before the database is, which then has whatever has left them."""
KEPT: Final[Mapping[str, str]] = MappingProxyType(
    {
        "secret": "keys of robots and accounts",
        "log": "what the processes said",
        "water_charts": "outlines and depths of waters",
        "water_currents": "currents that were told",
        "log_pictures": "pictures of the log book",
        "parameters": "parameters of robots",
        "robot-logs": "logs that robots sent",
        "camera_pictures": "pictures that were kept on purpose",
        "delivery": "files that were handed over",
        "archive": "rows that left the database",
    }
)
"""Folders that are packed, with what is in them."""
LEFT_OUT: Final[Mapping[str, str]] = MappingProxyType(
    {
        "base-maps": "files from elsewhere, loaded again",
        "film": "drawn again",
        "analysis": "worked out again",
        "imports": "uploads that wait for an answer",
        "water_proposals": "uploads that wait for an answer",
        "current_proposals": "uploads that wait for an answer",
        "links": "radios of a simulation",
        "robots": "memory of simulated robots",
        "before-upgrade": "backups themselves",
    }
)
"""Folders that are not packed, with the reason."""


def files_of(folder: Path) -> Generator[tuple[str, Path]]:
    """Yield what is to be packed beside the database: the member's name, and the file.

    A name that begins with a dot is of a file that is half written.
    """
    if (folder / CLOCK).is_file():
        yield CLOCK, folder / CLOCK
    for name in KEPT:
        for file in sorted((folder / name).rglob("*")):
            place = file.relative_to(folder)
            is_whole = file.is_file() and not file.is_symlink()
            if is_whole and not any(part[0] == "." for part in place.parts):
                yield place.as_posix(), file


def is_member(name: str) -> bool:
    """Tell whether a backup may hold a member of this name; none leads out of the folder."""
    path = PurePosixPath(name)
    if ".." in path.parts or path.is_absolute():
        return False
    if len(path.parts) == 1:
        return name in (SQLITE, DUMP, CLOCK, MANIFEST, *BRIDGED)
    return path.parts[0] in KEPT
