"""Gives room that deleted rows left inside a database back to the disk."""

import shutil
import sqlite3
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import create_engine, text
from sqlalchemy.exc import DBAPIError

from db.care import sqlite_file
from db.engine import opening_sentence
from db.fault import StoreUnavailableError


@dataclass(frozen=True, slots=True)
class Vacuumed:
    """How large a database was and is."""

    before_bytes: int
    after_bytes: int


def vacuum(url: str) -> Vacuumed:
    """Write a SQLite database anew without its holes; let PostgreSQL use its own again.

    SQLite: nobody else may use it meanwhile, and the disk needs room for a second copy.
    PostgreSQL: ``VACUUM ANALYZE``, which a station does not notice; what rows left is used for new
    ones, and the file shrinks only at its end.

    Raises:
        DatabaseUrlError: If the URL names no database that the station can use.
        StoreUnavailableError: If it is used by others, lacks the room, or does not answer.
    """
    file = sqlite_file(url)
    return _postgresql(url) if file is None else _sqlite(file)


def _sqlite(file: Path) -> Vacuumed:
    if not file.is_file():
        raise StoreUnavailableError(f"There is no database at {file}.")
    before = _bytes(file)
    free = shutil.disk_usage(file.parent).free
    if free < before:
        raise StoreUnavailableError(
            f"This needs room for a second copy: {before / 1e6:.0f} MB, and {free / 1e6:.0f} MB "
            "are free. Nothing was done."
        )
    try:
        with closing(sqlite3.connect(file, isolation_level=None)) as base:
            base.execute("VACUUM")
            base.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    except sqlite3.Error as error:
        raise StoreUnavailableError(f"{file}: {error}. It is as it was.") from error
    return Vacuumed(before, _bytes(file))


def _bytes(file: Path) -> int:
    parts = (file.with_name(f"{file.name}{end}") for end in ("", "-wal"))
    return sum(part.stat().st_size for part in parts if part.is_file())


def _postgresql(url: str) -> Vacuumed:
    size = text("select pg_database_size(current_database())")
    engine = create_engine(url, isolation_level="AUTOCOMMIT")
    try:
        with engine.connect() as connection:
            before = connection.scalar(size)
            connection.execute(text("VACUUM ANALYZE"))
            return Vacuumed(int(before or 0), int(connection.scalar(size) or 0))
    except DBAPIError as error:
        raise StoreUnavailableError(opening_sentence(error)) from error
    finally:
        engine.dispose()
