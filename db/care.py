"""Looks after a database from outside a station: is it whole, and a copy of it while it is used."""

import os
import sqlite3
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path

from sqlalchemy import inspect, make_url
from sqlalchemy.exc import DBAPIError

from db.engine import check_url, opening_sentence, read_engine
from db.fault import StoreUnavailableError
from db.migrate import METADATA, revisions, schema_version

_COMPLAINTS_MAX = 20
_STEP_PAGES = 2048


def sqlite_file(url: str) -> Path | None:
    """Return the file of a SQLite database; None of another product.

    Raises:
        DatabaseUrlError: If the URL names no database that the station can use.
    """
    check_url(url)
    parsed = make_url(url)
    return Path(parsed.database or "") if parsed.get_backend_name() == "sqlite" else None


def copy_sqlite(
    source: Path, target: Path, on_step: Callable[[float], None] = lambda _: None
) -> None:
    """Copy a database as it is at one moment, while others write it.

    One reading transaction holds that moment, so that what is written meanwhile neither waits nor
    starts the copy anew. What was copied goes to the disk bit by bit: a station's commit would
    otherwise wait for all of it.

    Args:
        source: The database.
        target: Where to, a new file; on the disk when this returns.
        on_step: Told the share that is copied, every few megabytes; what it raises ends the copy.

    Raises:
        StoreUnavailableError: If it cannot be read.
    """
    with (
        _plainly(source),
        closing(sqlite3.connect(source, isolation_level=None)) as whole,
        closing(sqlite3.connect(target)) as copy,
        target.open("rb") as file,
    ):
        copy.execute("PRAGMA synchronous=OFF")
        whole.execute("BEGIN")
        whole.execute("SELECT count(*) FROM sqlite_master").fetchone()

        def step(status: int, remaining: int, total: int) -> None:
            del status
            os.fdatasync(file.fileno())
            on_step(1.0 - remaining / max(1, total))

        whole.backup(copy, pages=_STEP_PAGES, progress=step)
        os.fsync(file.fileno())


def complaints(url: str) -> list[str]:
    """Read a whole database and return what is wrong with it, at most a few dozen sentences.

    Nothing is changed, and a station may go on using it.

    Raises:
        DatabaseUrlError: If the URL names no database that the station can use.
        StoreUnavailableError: If it cannot be read at all.
    """
    file = sqlite_file(url)
    found = [] if file is None else _inner_complaints(file)
    return found or _schema_complaints(url)


def _inner_complaints(file: Path) -> list[str]:
    """Return what SQLite finds: pages, indices, then rows that refer to nothing."""
    if not file.is_file():
        raise StoreUnavailableError(f"There is no database at {file}.")
    with (
        _plainly(file),
        closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True)) as base,
    ):
        # SQLite quotes what it finds, and damaged bytes are no text.
        base.text_factory = partial(str, encoding="utf-8", errors="replace")
        said = [str(row[0]) for row in base.execute(f"PRAGMA integrity_check({_COMPLAINTS_MAX})")]
        if said != ["ok"]:
            return said
        orphans = base.execute("PRAGMA foreign_key_check").fetchmany(_COMPLAINTS_MAX)
    return [f"A row of {row[0]} belongs to a row of {row[2]} that is not there." for row in orphans]


def _schema_complaints(url: str) -> list[str]:
    engine = read_engine(url)
    try:
        with engine.connect() as connection:
            present = schema_version(connection)
            tables = set(inspect(connection).get_table_names())
    except DBAPIError as error:
        raise StoreUnavailableError(opening_sentence(error)) from error
    finally:
        engine.dispose()
    known = revisions()
    if present is None:
        return ["It holds nothing of a station."]
    if present not in known:
        return [f"It has schema {present}, which this version of the station does not know."]
    if present != known[-1]:
        return []
    return [f"The table {name} is missing." for name in sorted(set(METADATA.tables) - tables)]


@contextmanager
def _plainly(file: Path) -> Generator[None]:
    try:
        yield
    except sqlite3.Error as error:
        raise StoreUnavailableError(f"The database {file} cannot be read: {error}.") from error
