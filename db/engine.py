"""Engines for writing and for reading, and what each database needs to be told.

The errors of both name no value that was bound: a log may quote them, and some values are secrets.
"""

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import Engine, create_engine, event, make_url
from sqlalchemy.engine import URL, Connection
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError, OperationalError
from sqlalchemy.orm import Session

from db.fault import DatabaseUrlError
from db.sqlite_engine import sqlite_engine

BUSY_TIMEOUT_MS = 1000
OPENING_TIMEOUT_MS = 10_000
"""A process that closes the database just now holds it alone until its log is written back."""
READERS = 8
WAIT_S = 30.0
"""For one of an engine's connections, when all are in use."""
READING = {"sqlite_begin": "BEGIN"}
"""Options of a connection of the writer's engine that only reads, and takes no write lock."""
_LOCKED = f"The database stayed locked for {BUSY_TIMEOUT_MS / 1000:g} s."
"""Nobody tells by whom: SQLite says only that the lock was not free in that time."""


def write_engine(url: str) -> Engine:
    """Open the engine of the one writer.

    SQLite runs in WAL mode, so that readers never wait for the writer, with ``synchronous=FULL``:
    a commit has reached the disk when it returns. Robots forget a sample once it is acknowledged,
    so an acknowledged row must survive a power cut as well as SIGKILL; batches keep the price
    at a few dozen syncs a second.
    """
    engine = _open(url, connections_max=1)
    if is_sqlite(engine):
        _prepare_sqlite(
            engine,
            begin="BEGIN IMMEDIATE",
            pragmas=("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON"),
        )
    return engine


def read_engine(url: str) -> Engine:
    """Open an engine whose connections cannot change anything."""
    engine = _open(url, connections_max=READERS)
    if is_sqlite(engine):
        _prepare_sqlite(engine, begin="BEGIN", pragmas=("query_only=ON",))
        return engine
    return engine.execution_options(postgresql_readonly=True, isolation_level="REPEATABLE READ")


def _open(url: str, connections_max: int) -> Engine:
    parsed = make_url(url)
    if parsed.get_backend_name() == "sqlite":
        return sqlite_engine(parsed, connections_max, WAIT_S)
    return create_engine(
        parsed,
        pool_size=connections_max,
        max_overflow=0,
        pool_timeout=WAIT_S,
        hide_parameters=True,
        **_patience(parsed),
    )


def _patience(url: URL) -> dict[str, Any]:
    """Return how an engine notices that a server is gone, and that it is back.

    A connection that died is found before it is used again; one that nobody answers, because the
    server's machine is gone, is given up after some seconds and not after a quarter of an hour.
    """
    wanted = {name: value for name, value in _LIBPQ.items() if name not in url.query}
    return {"pool_pre_ping": True, "connect_args": wanted}


_LIBPQ = {
    "connect_timeout": 5,
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
    "tcp_user_timeout": 10_000,
}
"""Options of a connection to PostgreSQL, where its URL has none: s, and ms for the last."""


@contextmanager
def reading(url: str) -> Generator[Session]:
    """Open a session of its own that sees one moment of a database and changes nothing."""
    engine = read_engine(url)
    try:
        with Session(engine) as session:
            yield session
    finally:
        engine.dispose()


def is_sqlite(engine: Engine) -> bool:
    """Tell whether the engine speaks to SQLite."""
    return engine.dialect.name == "sqlite"


def check_url(url: str) -> None:
    """Refuse a database that the store cannot keep its promises on.

    Raises:
        DatabaseUrlError: For what is no URL, an in-memory SQLite database, another product, or a
            driver that is not installed.
    """
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError) as error:
        raise DatabaseUrlError(f"this is not the URL of a database; {_URLS}") from error
    product = parsed.get_backend_name()
    if product not in {"sqlite", "postgresql"}:
        raise DatabaseUrlError(f"the database must be SQLite or PostgreSQL, not {product}; {_URLS}")
    if product == "sqlite" and parsed.database in {None, "", ":memory:"}:
        raise DatabaseUrlError("an in-memory database would be lost; give a file")
    _check_driver(parsed)


_URLS = (
    "write sqlite:////folder/station.sqlite3 or postgresql://user:password@host/name "
    "(GRACE_DATABASE_URL)"
)


def _check_driver(parsed: URL) -> None:
    try:
        parsed.get_dialect().import_dbapi()
    except NoSuchModuleError as error:
        raise DatabaseUrlError(f"{parsed.drivername} is no known driver; {_URLS}") from error
    except ImportError as error:
        raise DatabaseUrlError(
            f"the driver of {parsed.drivername} is not installed; install the extra: "
            "pip install 'grace-ground-station[postgres]'"
        ) from error


def shown_url(url: str) -> str:
    """Return a URL as people may see it: without its password."""
    try:
        return make_url(url).render_as_string(hide_password=True)
    except (ArgumentError, ValueError):
        return "The database's URL"


def is_storage_fault(error: DBAPIError) -> bool:
    """Tell whether the storage failed (try again later) rather than the statement (a bug)."""
    code = getattr(error.orig, "sqlite_errorcode", None)
    if isinstance(code, int):
        # Primary codes: BUSY, LOCKED, NOMEM, READONLY, IOERR, CORRUPT, FULL, CANTOPEN, PROTOCOL,
        # NOTADB.
        return code & 0xFF in {5, 6, 7, 8, 10, 11, 13, 14, 15, 26}
    state = getattr(error.orig, "sqlstate", None)
    if isinstance(state, str):
        # Classes: connection, insufficient resources, operator intervention, system error;
        # 55P03 is a lock that was not available, 25006 a read-only transaction.
        return state[:2] in {"08", "53", "57", "58"} or state in {"55P03", "25006"}
    # Without a code, it is the driver that found nobody to ask.
    return error.connection_invalidated or isinstance(error, OperationalError)


def fault_sentence(error: DBAPIError) -> str:
    """Say in one sentence what is wrong with the storage."""
    code = getattr(error.orig, "sqlite_errorcode", None)
    sentences = {
        5: _LOCKED,
        6: _LOCKED,
        8: "The database cannot be written: it is read-only.",
        10: "The disk reports an error.",
        11: "The database is damaged.",
        13: "The disk is full.",
        14: "The database file cannot be opened.",
        26: "The file is not a database, or it is damaged.",
    }
    if isinstance(code, int) and code & 0xFF in sentences:
        return sentences[code & 0xFF]
    return f"The database does not answer: {_in_a_line(error)}."


def opening_sentence(error: DBAPIError) -> str:
    """Say what is wrong with a database that cannot be opened, and the way out."""
    code = getattr(error.orig, "sqlite_errorcode", None)
    ways = {
        8: "Give this user the right to write it and its folder, or choose another with --data.",
        11: _MEND,
        13: "Make room, then start again.",
        14: "Its folder must be there, and this user needs the right to write in it.",
        26: _MEND,
    }
    if isinstance(code, int) and code & 0xFF in {5, 6}:
        return _STAYS_LOCKED
    if isinstance(code, int):
        return f"{fault_sentence(error)} {ways.get(code & 0xFF, _MEND)}"
    return (
        f"{fault_sentence(error)} Is the server up, and are host, name, user and password of "
        "GRACE_DATABASE_URL right?"
    )


_STAYS_LOCKED = (
    "The database stays locked. Close what else uses it, such as another station or a `grace` "
    "verb, then start again."
)
_MEND = (
    "See what is wrong with `grace db check`; to go back to a backup, move the file away and use "
    "`grace db restore`."
)


def _in_a_line(error: DBAPIError) -> str:
    return " ".join(str(error.orig).split()).rstrip(".")


def _prepare_sqlite(engine: Engine, begin: str, pragmas: tuple[str, ...]) -> None:
    def connected(connection: Any, record: object) -> None:  # noqa: ANN401 - the driver's own
        del record
        # The driver's own transaction handling begins too late for a snapshot; ours is explicit.
        connection.isolation_level = None
        connection.execute(f"PRAGMA busy_timeout={OPENING_TIMEOUT_MS}")
        for pragma in pragmas:
            connection.execute(f"PRAGMA {pragma}")
        connection.execute(f"PRAGMA busy_timeout={BUSY_TIMEOUT_MS}")

    def begun(connection: Connection) -> None:
        options = connection.get_execution_options()
        connection.exec_driver_sql(options.get("sqlite_begin", begin))

    event.listen(engine, "connect", connected)
    event.listen(engine, "begin", begun)
