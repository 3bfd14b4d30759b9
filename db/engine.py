"""Engines for writing and for reading, and what each database needs to be told."""

from typing import Any

from sqlalchemy import Engine, create_engine, event, make_url
from sqlalchemy.engine import Connection
from sqlalchemy.exc import DBAPIError

BUSY_TIMEOUT_MS = 1000
READERS = 8


def write_engine(url: str) -> Engine:
    """Open the engine of the one writer.

    SQLite runs in WAL mode, so that readers never wait for the writer, with ``synchronous=FULL``:
    a commit has reached the disk when it returns. Robots forget a sample once it is acknowledged,
    so an acknowledged row must survive a power cut as well as SIGKILL; batches keep the price
    at a few dozen syncs a second.
    """
    engine = create_engine(url, pool_size=1, max_overflow=0)
    if is_sqlite(engine):
        _prepare_sqlite(
            engine,
            begin="BEGIN IMMEDIATE",
            pragmas=("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON"),
        )
    return engine


def read_engine(url: str) -> Engine:
    """Open an engine whose connections cannot change anything."""
    engine = create_engine(url, pool_size=READERS, max_overflow=0, pool_timeout=30)
    if is_sqlite(engine):
        _prepare_sqlite(engine, begin="BEGIN", pragmas=("query_only=ON",))
        return engine
    return engine.execution_options(postgresql_readonly=True)


def is_sqlite(engine: Engine) -> bool:
    """Tell whether the engine speaks to SQLite."""
    return engine.dialect.name == "sqlite"


def check_url(url: str) -> None:
    """Refuse a database that the store cannot keep its promises on.

    Raises:
        ValueError: For an in-memory SQLite database, or another product.
    """
    parsed = make_url(url)
    product = parsed.get_backend_name()
    if product not in {"sqlite", "postgresql"}:
        raise ValueError(f"the database must be SQLite or PostgreSQL, not {product}")
    if product == "sqlite" and parsed.database in {None, "", ":memory:"}:
        raise ValueError("an in-memory database would be lost; give a file")


def is_storage_fault(error: DBAPIError) -> bool:
    """Tell whether the storage failed (try again later) rather than the statement (a bug)."""
    code = getattr(error.orig, "sqlite_errorcode", None)
    if isinstance(code, int):
        # Primary codes: BUSY, LOCKED, NOMEM, READONLY, IOERR, FULL, CANTOPEN, PROTOCOL.
        return code & 0xFF in {5, 6, 7, 8, 10, 13, 14, 15}
    state = getattr(error.orig, "sqlstate", None)
    if isinstance(state, str):
        # Classes: connection, insufficient resources, operator intervention, system error;
        # 55P03 is a lock that was not available, 25006 a read-only transaction.
        return state[:2] in {"08", "53", "57", "58"} or state in {"55P03", "25006"}
    return error.connection_invalidated


def fault_sentence(error: DBAPIError) -> str:
    """Say in one sentence what is wrong with the storage."""
    code = getattr(error.orig, "sqlite_errorcode", None)
    sentences = {
        5: "The database is locked by another program.",
        6: "The database is locked by another program.",
        8: "The database cannot be written: it is read-only.",
        10: "The disk reports an error.",
        13: "The disk is full.",
        14: "The database file cannot be opened.",
    }
    if isinstance(code, int) and code & 0xFF in sentences:
        return sentences[code & 0xFF]
    return f"The database does not answer: {error.orig}."


def _prepare_sqlite(engine: Engine, begin: str, pragmas: tuple[str, ...]) -> None:
    def connected(connection: Any, record: object) -> None:  # noqa: ANN401 - the driver's own
        del record
        # The driver's own transaction handling begins too late for a snapshot; ours is explicit.
        connection.isolation_level = None
        connection.execute(f"PRAGMA busy_timeout={BUSY_TIMEOUT_MS}")
        for pragma in pragmas:
            connection.execute(f"PRAGMA {pragma}")

    def begun(connection: Connection) -> None:
        connection.exec_driver_sql(begin)

    event.listen(engine, "connect", connected)
    event.listen(engine, "begin", begun)
