"""Restores a backup into a data folder: all of it or nothing, and only after all of it was read."""

import filecmp
import shutil
from collections.abc import Generator, Iterable
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from db import care
from db.dump import dump_complaint, is_empty, restore_postgresql
from db.engine import shown_url
from db.fault import StoreUnavailableError
from robot_link.whole_file import keep_names
from server.backup.archive import BLOCK_BYTES, ByteSource, read_archive
from server.backup.content import BRIDGED, CLOCK, DUMP, KEPT, SQLITE
from server.backup.failure import BackupError
from server.backup.making import STAGING, beside, clear_staging, written
from server.backup.sealing import MAGIC, Opener, Seal, Unsealing

_RESTORING: Final = f"{STAGING}restore-"
_PLACING: Final = f"{STAGING}place-"
_SQLITE_BEGINS: Final = b"SQLite format 3\0"


def restore_backup(
    source: Path, folder: Path, database_url: str, opener: Opener | None = None
) -> None:
    """Restore a backup; a copy of a database of SQLite alone is one, too.

    Args:
        source: The backup.
        folder: The data folder; nothing that is there is replaced.
        database_url: Where the database goes: a file that is not there, or an empty database.
        opener: What opens an encrypted backup.

    Raises:
        BackupError: If ``source`` is no backup or a damaged one, cannot be opened, or the folder or
            the database has something that would be lost.
        StoreError: If the database cannot be written.
    """
    place = care.sqlite_file(database_url)
    clear_staging(folder, _RESTORING)
    with written(folder), beside(folder / SQLITE, _RESTORING) as staging:
        _unpack(source, staging, opener)
        fresh = _database(source, staging, is_sqlite=place is not None)
        moves = _moves(staging, folder)
        if place is not None:
            _put_file(fresh, place, moves)
            return
        if not is_empty(database_url):
            raise BackupError(
                f"{shown_url(database_url)} has tables already, which would be lost; make an empty "
                "database for it. Nothing was restored."
            )
        with _all_or_none(moves):
            restore_postgresql(database_url, fresh)


def _unpack(source: Path, staging: Path, opener: Opener | None) -> None:
    def take(name: str, content: ByteSource) -> None:
        place = staging / name
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with place.open("xb") as file:
            place.chmod(0o600)
            while block := content.read(BLOCK_BYTES):
                file.write(block)

    try:
        with source.open("rb") as file:
            begin = file.read(len(_SQLITE_BEGINS))
            if begin == _SQLITE_BEGINS:
                care.copy_sqlite(source, staging / SQLITE)
                return
            is_sealed = begin[: len(MAGIC)] == MAGIC
            file.seek(len(MAGIC) if is_sealed else 0)
            content: ByteSource = file
            if is_sealed:
                content = Unsealing(file, Seal.read(file, opener, source), source)
            read_archive(content, source, take)
    except OSError as error:
        raise BackupError(f"{source} cannot be unpacked: {error.strerror or error}.") from error


def _database(source: Path, staging: Path, *, is_sqlite: bool) -> Path:
    """Return the database of an unpacked backup, which is whole and of the product that is meant.

    Raises:
        BackupError: If it is not.
    """
    wanted, other = (SQLITE, DUMP) if is_sqlite else (DUMP, SQLITE)
    if (staging / other).is_file():
        of, to = ("PostgreSQL", "SQLite") if is_sqlite else ("SQLite", "PostgreSQL")
        raise BackupError(
            f"{source} holds a database of {of}, and this station is set to {to} "
            "(GRACE_DATABASE_URL). Nothing was restored."
        )
    fresh = staging / wanted
    if not fresh.is_file():
        raise BackupError(f"{source} holds no database; it is no backup of a station.")
    try:
        wrong = (
            next(iter(care.complaints(f"sqlite:///{fresh}")), "")
            if is_sqlite
            else dump_complaint(fresh)
        )
    except StoreUnavailableError as error:
        wrong = str(error)
    if wrong:
        raise BackupError(f"The database in {source} is damaged: {wrong}")
    return fresh


@dataclass(frozen=True, slots=True)
class _Move:
    """A file on its way from the staging folder to its place."""

    fresh: Path
    place: Path


def _moves(staging: Path, folder: Path) -> list[_Move]:
    """Return the moves of all files but the database, none of which replaces anything.

    What an attempt that was cut off has left is there already, and is not lost.

    Raises:
        BackupError: If something would be lost.
    """
    files = [staging / name for name in (CLOCK, *BRIDGED)]
    for name in KEPT:
        files += sorted(file for file in (staging / name).rglob("*") if file.is_file())
    moves = [_Move(file, folder / file.relative_to(staging)) for file in files]
    moves = [move for move in moves if _is_missing(move)]
    _refuse_to_replace(move.place for move in moves)
    return moves


def _is_missing(move: _Move) -> bool:
    """Tell whether there is a file to be put in a place that does not have the same already."""
    if not move.fresh.exists():
        return False
    return not (move.place.is_file() and filecmp.cmp(move.fresh, move.place, shallow=False))


def _refuse_to_replace(places: Iterable[Path]) -> None:
    for place in places:
        if place.exists():
            raise BackupError(
                f"{place} is there already and would be lost; move it away, or restore into "
                "another folder with --data. Nothing was restored."
            )


def _put_file(fresh: Path, place: Path, moves: list[_Move]) -> None:
    """Put a database of SQLite into its place, after all other files."""
    _refuse_to_replace(place.with_name(f"{place.name}{end}") for end in ("", "-wal", "-shm"))
    with written(place):
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        clear_staging(place.parent, _PLACING)
        with beside(place, _PLACING) as near:
            # It may be on another disk than the folder, and appears whole or not at all.
            fresh = Path(shutil.move(fresh, near / SQLITE))
            # The database last: as long as there is none, the same can be done again.
            with _all_or_none([*moves, _Move(fresh, place)]):
                pass


@contextmanager
def _all_or_none(moves: list[_Move]) -> Generator[None]:
    """Move files to their places; back, if one of them or what the block does fails."""
    moved: list[_Move] = []
    try:
        for move in moves:
            move.place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            move.fresh.replace(move.place)
            moved.append(move)
            keep_names(move.place.parent)
        yield
    except BaseException:
        for move in reversed(moved):
            with suppress(OSError):
                move.place.replace(move.fresh)
        raise
