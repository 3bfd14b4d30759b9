"""Engines of SQLite files that share what SQLAlchemy has made of the statements."""

from functools import cache
from typing import Any

from sqlalchemy import URL, Engine, create_engine, event
from sqlalchemy.engine.interfaces import Dialect
from sqlalchemy.pool import QueuePool
from sqlalchemy.util import LRUCache

STATEMENTS_MAX = 2000
"""Compiled statements that a process keeps; a station has some hundreds."""
_STATEMENTS: LRUCache[object, object] = LRUCache(STATEMENTS_MAX)


def sqlite_engine(url: URL, connections_max: int, wait_s: float) -> Engine:
    """Open an engine of a SQLite file, whose errors name no value that was bound.

    SQLAlchemy keeps compiled statements by dialect, and gives each engine one of its own: writer,
    readers and every look of a worker at the same file would compile the same statements again.
    SQLite needs no more than one, since its dialect knows nothing of a single file.

    The connection that was used last is used next. By turns each of them would come to prepare
    every statement, and so keep it.

    Args:
        url: URL of the file.
        connections_max: How many connections may be open at once.
        wait_s: How long one is waited for when all are in use.
    """
    dialect = _dialect(url.drivername)
    arguments, options = dialect.create_connect_args(url)
    pool = QueuePool(
        lambda: dialect.connect(*arguments, **options),
        pool_size=connections_max,
        max_overflow=0,
        timeout=wait_s,
        use_lifo=True,
        dialect=dialect,
    )
    prepare = dialect.on_connect_url(url)
    if prepare is not None:

        def connected(connection: Any, record: object) -> None:  # noqa: ANN401 - the driver's own
            del record
            prepare(connection)

        event.listen(pool, "connect", connected)
    shared = {"compiled_cache": _STATEMENTS}
    return Engine(pool, dialect, url, hide_parameters=True, execution_options=shared)


@cache
def _dialect(driver: str) -> Dialect:
    """Return the dialect of a driver as a first connection leaves it."""
    engine = create_engine(URL.create(driver))
    with engine.connect():
        pass
    engine.dispose()
    return engine.dialect
