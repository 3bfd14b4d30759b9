"""Makes one backup: copies the database, checks it, packs it, and reads the file again."""

import fcntl
import os
import shutil
import tempfile
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Final

from db import care
from db.dump import dump_complaint, dump_postgresql
from db.engine import reading
from db.migrate import schema_version
from robot_link.whole_file import keep_names
from server.backup.archive import (
    ByteSource,
    Contents,
    OnBytes,
    drain,
    read_archive,
    write_archive,
)
from server.backup.content import BRIDGED, DUMP, SQLITE, files_of
from server.backup.failure import BackupError
from server.backup.sealing import Lock, Seal, Sealing, Unsealing

STAGING: Final = ".grace-"
"""Beginning of the names of folders in which backups are made; what is in one is no backup."""
BY_HAND: Final = f"{STAGING}by-hand-"
"""Beginning of those that no schedule makes."""
_COPIED, _CHECKED, _PACKED = 0.4, 0.55, 0.85
"""Shares of the work that are done after each step."""
_MB: Final = 1e6


@dataclass(frozen=True, slots=True)
class BackupOrder:
    """What is to be backed up, and where to."""

    data_dir: Path
    database_url: str
    target: Path
    """The file; it must not exist, its folder must."""
    lock: Lock | None = None
    """What it is encrypted with; None for a plain file."""
    staging: str = BY_HAND
    """Beginning of the name of the folder, beside the target, in which it is made."""


@dataclass(frozen=True, slots=True)
class MadeBackup:
    """A backup that was read again after it was written."""

    name: str
    bytes: int
    database_bytes: int
    """Of the copy of the database."""


Tell = Callable[[float, str], None]
"""Told how far the work is, 0 .. 1, and what it is at; what it raises ends the work."""


def make_backup(order: BackupOrder, tell: Tell = lambda _share, _words: None) -> MadeBackup:
    """Make a backup while a station may run; ``target`` appears whole and checked, or not at all.

    What killed makers have left beside it, under the same beginning, is removed first.

    Raises:
        BackupError: If there is nothing to back up, the database is damaged, or the file exists,
            cannot be written, or reads otherwise than it was written.
        StoreError: If the database cannot be read.
    """
    target = order.target
    if target.exists():
        raise BackupError(f"{target} exists already; nothing was copied.")
    clear_staging(target.parent, order.staging)
    with written(target), beside(target, order.staging) as staging:
        database = staging / (DUMP if care.sqlite_file(order.database_url) is None else SQLITE)
        bridged = _copy_bridged(order.data_dir, staging)
        _copy(order, database, tell)
        about = _about(order, database)
        seal = None if order.lock is None else Seal.draw(order.lock)
        fresh = staging / "backup"
        size = database.stat().st_size
        files = [(database.name, database), *bridged, *files_of(order.data_dir)]
        words = f"Packing {size / _MB:.0f} MB"
        contents = _pack(files, fresh, seal, about, _share(tell, _CHECKED, _PACKED, size, words))
        _read_again(fresh, seal, contents, _share(tell, _PACKED, 1.0, size, "Reading it again"))
        fresh.replace(target)
        keep_names(target.absolute().parent)
    return MadeBackup(target.name, target.stat().st_size, size)


def _copy_bridged(folder: Path, staging: Path) -> list[tuple[str, Path]]:
    """Copy the rows that are on their way into the database; return names of members, and files."""
    copies: list[tuple[str, Path]] = []
    for name in BRIDGED:
        with suppress(FileNotFoundError):
            copies.append((name, Path(shutil.copyfile(folder / name, staging / name))))
    return copies


def _copy(order: BackupOrder, database: Path, tell: Tell) -> None:
    """Copy the database into a file, and hold that to be whole."""
    source = care.sqlite_file(order.database_url)
    if source is None:
        words = "Dumping the database"
        dump_postgresql(
            order.database_url, database, lambda done: tell(0.0, f"{words}: {done / _MB:.0f} MB")
        )
        tell(_COPIED, "Checking the copy")
        wrong = dump_complaint(database, lambda: tell(_COPIED, "Checking the copy"))
    else:
        if not source.exists():
            raise BackupError(f"There is no database at {source}.")
        care.copy_sqlite(
            source, database, lambda share: tell(share * _COPIED, "Copying the database")
        )
        tell(_COPIED, "Checking the copy")
        wrong = next(iter(care.complaints(f"sqlite:///{database}")), "")
    if wrong:
        raise BackupError(
            f"The database is damaged, and no backup was made of it: {wrong} "
            "See `grace db check`; keep the older backups."
        )


def _about(order: BackupOrder, database: Path) -> dict[str, str | None]:
    url = order.database_url if database.name == DUMP else f"sqlite:///{database}"
    with reading(url) as session:
        schema = schema_version(session.connection())
    return {
        "made_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "station": version("grace-ground-station"),
        "schema": schema,
    }


def _pack(
    files: Iterable[tuple[str, Path]],
    fresh: Path,
    seal: Seal | None,
    about: dict[str, str | None],
    on_bytes: OnBytes,
) -> Contents:
    """Write the file, with all of it on the disk."""
    descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with open(descriptor, "wb") as file:
        if seal is None:
            contents = write_archive(file, files, about, on_bytes)
        else:
            with Sealing(file, seal) as sealed:
                contents = write_archive(sealed, files, about, on_bytes)
        file.flush()
        os.fsync(file.fileno())
        # Read again, it comes from the disk and not from memory.
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    return contents


def _read_again(fresh: Path, seal: Seal | None, contents: Contents, on_bytes: OnBytes) -> None:
    """Read a file that was just written, by the key that is forgotten afterwards.

    Raises:
        BackupError: If it is not what was written.
    """
    with fresh.open("rb") as file:
        source: ByteSource = file
        if seal is not None:
            file.seek(len(seal.header))
            source = Unsealing(file, seal, "the file")
        try:
            found = read_archive(source, "the file", drain, on_bytes)
        except BackupError as error:
            raise BackupError(f"The disk does not hold what was written to it: {error}") from error
    if found != contents:
        raise BackupError("The disk does not hold what was written to it; use another one.")


def _share(tell: Tell, begin: float, end: float, size: int, words: str) -> OnBytes:
    """Return what tells a share of the work by the bytes that are done."""
    done = 0

    def on_bytes(count: int) -> None:
        nonlocal done
        done += count
        tell(begin + (end - begin) * min(1.0, done / max(1, size)), words)

    return on_bytes


@contextmanager
def beside(target: Path, prefix: str) -> Generator[Path]:
    """Give a folder on the same disk that nobody else can look into, for as long as it is used."""
    with (
        tempfile.TemporaryDirectory(prefix=prefix, dir=target.parent) as staging,
        _locked(Path(staging)),
    ):
        yield Path(staging)


def clear_staging(folder: Path, prefix: str) -> None:
    """Remove what work that was killed has left: full copies of database and secrets."""
    for left in folder.glob(f"{prefix}*"):
        with _locked(left) as is_left:
            if is_left:
                shutil.rmtree(left, ignore_errors=True)


@contextmanager
def _locked(staging: Path) -> Generator[bool]:
    """Hold a folder, if nobody does; tell whether it is held. The end of its process frees it."""
    try:
        lock = os.open(staging, os.O_RDONLY | os.O_DIRECTORY)
    except FileNotFoundError:
        yield False
        return
    try:
        yield _has_taken(lock)
    finally:
        os.close(lock)


def _has_taken(lock: int) -> bool:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a disk without locks, as some of other machines
        return True
    return True


@contextmanager
def written(place: Path) -> Generator[None]:
    """Say of a disk that refuses which file it was about."""
    try:
        yield
    except OSError as error:
        raise BackupError(f"{place} cannot be written: {error.strerror or error}.") from error
