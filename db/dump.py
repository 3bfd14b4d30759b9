"""Dumps of PostgreSQL databases, by the server's own programs as processes.

A password is given to them by their environment, which nobody but this user can read, and never on
the command line, which everybody can.
"""

import os
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from sqlalchemy import URL, create_engine, inspect, make_url
from sqlalchemy.exc import DBAPIError

from db.engine import check_url, opening_sentence
from db.fault import StoreUnavailableError

_PACKAGED: Final = Path("/usr/lib/postgresql")
"""Where Debian keeps the programs of each version."""
_LOOK_EVERY_S: Final = 0.2
_SAID_MAX: Final = 400


def dump_postgresql(
    url: str, target: Path, on_step: Callable[[int], None] = lambda _: None
) -> None:
    """Dump a database as it is at one moment, while others write it; none of them waits.

    Args:
        url: SQLAlchemy URL of the database.
        target: Where to, a new file; on the disk when this returns.
        on_step: Told how many bytes were written, a few times a second; what it raises ends the
            dump.

    Raises:
        StoreUnavailableError: If ``pg_dump`` is missing or fails.
    """
    options = ("--format=custom", "--compress=0", "--no-owner", "--no-privileges")
    command = (_program("pg_dump"), *options, f"--file={target}", f"--dbname={_plain(url)}")
    _run(command, url, lambda: on_step(target.stat().st_size if target.exists() else 0))
    with target.open("rb") as file:
        os.fsync(file.fileno())


def dump_complaint(dump: Path, on_step: Callable[[], None] = lambda: None) -> str:
    """Read all of a dump and return what is wrong with it, or "".

    Raises:
        StoreUnavailableError: If ``pg_restore`` is missing.
    """
    command = (_program("pg_restore"), f"--file={os.devnull}", str(dump))
    try:
        _run(command, None, on_step)
    except StoreUnavailableError as error:
        return str(error)
    return ""


def restore_postgresql(url: str, dump: Path) -> None:
    """Restore a dump into an empty database, all of it or nothing.

    Raises:
        StoreUnavailableError: If ``pg_restore`` is missing or fails.
    """
    options = ("--single-transaction", "--exit-on-error", "--no-owner", "--no-privileges")
    _run((_program("pg_restore"), *options, f"--dbname={_plain(url)}", str(dump)), url)


def is_empty(url: str) -> bool:
    """Tell whether a database has no tables.

    Raises:
        DatabaseUrlError: If the URL names no database that the station can use.
        StoreUnavailableError: If it cannot be read.
    """
    check_url(url)
    engine = create_engine(url)
    try:
        with engine.connect() as connection:
            return not inspect(connection).get_table_names()
    except DBAPIError as error:
        raise StoreUnavailableError(opening_sentence(error)) from error
    finally:
        engine.dispose()


def _program(name: str) -> str:
    packaged = sorted(_PACKAGED.glob(f"*/bin/{name}"), key=lambda path: _version(path.parts[-3]))
    found = shutil.which(name) or (str(packaged[-1]) if packaged else None)
    if found is None:
        raise StoreUnavailableError(
            f"{name} is not installed; install the client programs of PostgreSQL, of the server's "
            "version or a later one (Debian: apt-get install postgresql-client)."
        )
    return found


def _version(name: str) -> int:
    return int(name) if name.isdigit() else 0


def _plain(url: str) -> str:
    """Return a URL for the programs: without a driver and without its password."""
    given = make_url(url)
    plain = URL.create(
        "postgresql",
        username=given.username,
        host=given.host,
        port=given.port,
        database=given.database,
        query=given.query,
    )
    return plain.render_as_string(hide_password=False)


def _environment(url: str | None) -> Mapping[str, str]:
    password = None if url is None else make_url(url).password
    return {**os.environ, **({} if password is None else {"PGPASSWORD": str(password)})}


def _run(
    command: Sequence[str], url: str | None, on_step: Callable[[], None] = lambda: None
) -> None:
    """Run a program to its end; what ``on_step`` raises ends it."""
    name = Path(command[0]).name
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env=_environment(url),
    ) as process:
        try:
            while True:
                try:
                    _, said = process.communicate(timeout=_LOOK_EVERY_S)
                    break
                except subprocess.TimeoutExpired:
                    on_step()
        except BaseException:
            process.kill()
            raise
    if process.returncode != 0:
        words = " ".join(said.decode(errors="replace").split())[:_SAID_MAX]
        raise StoreUnavailableError(f"{name} failed: {words}")
