"""The station's memory: one writer, many readers, and a plain word when storage fails."""

import asyncio
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Self, TypeVar

from sqlalchemy import Engine
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from db.bridge import Bridge
from db.engine import (
    READERS,
    check_url,
    fault_sentence,
    is_storage_fault,
    opening_sentence,
    read_engine,
)
from db.engine import write_engine as open_write_engine
from db.fault import StoreUnavailableError
from db.ingest import Telemetry, append_telemetry
from db.migrate import migrate
from db.writer import (
    BridgedListener,
    ChangeListener,
    FaultListener,
    Kept,
    Listeners,
    TransactionListener,
    Writer,
)

T = TypeVar("T")
CLOSE_TIMEOUT_S = 10.0


class Store:
    """Owns the database of one station.

    Every method may be called from any thread; the ``async`` ones from any event loop. A listener
    for faults is called on the writer's thread with a sentence, and with ``None`` when storage
    works again.
    """

    def __init__(
        self, write_engine: Engine, read_engine: Engine, bridge: Bridge | None = None
    ) -> None:
        self._write_engine = write_engine
        self._read_engine = read_engine
        self._listeners: list[FaultListener] = []
        self._changed: list[ChangeListener] = []
        self._bridged: list[BridgedListener] = []
        listeners = Listeners(self._tell, self._tell_change, self._tell_bridged)
        self._writer = Writer(write_engine, append_telemetry, listeners, bridge)
        self._readers = ThreadPoolExecutor(READERS, thread_name_prefix="db-reader")

    @classmethod
    def open(
        cls,
        url: str,
        on_fault: FaultListener | None = None,
        *,
        bridge_dir: Path | None = None,
        alone: AbstractContextManager[object] | None = None,
    ) -> Self:
        """Bring the schema up to date and start the writer.

        Args:
            url: SQLAlchemy URL of a SQLite file or a PostgreSQL database.
            on_fault: Called with each change of ``fault``.
            bridge_dir: Folder of the bridge journal, which this process alone holds; without one
                rows wait in memory while storage fails.
            alone: Entered only while the schema changes; what it raises leaves that as it is.

        Raises:
            DatabaseUrlError: If the URL names a database that cannot keep what it is given.
            StoreUnavailableError: If the database cannot be opened or brought up to date.
        """
        check_url(url)
        engine = open_write_engine(url)
        bridge = None if bridge_dir is None else Bridge(bridge_dir)
        try:
            migrate(engine, alone)
            if bridge is not None:
                with Session(engine) as session:
                    bridge.catch_up(session)
        except BaseException as error:
            engine.dispose()
            if bridge is not None:
                bridge.close()
            if not isinstance(error, DBAPIError) or not is_storage_fault(error):
                raise
            raise StoreUnavailableError(opening_sentence(error)) from error
        store = cls(engine, read_engine(url), bridge)
        if on_fault is not None:
            store.add_fault_listener(on_fault)
        return store

    @property
    def fault(self) -> str | None:
        """What is wrong with the storage, or ``None``."""
        return self._writer.fault

    @property
    def commits(self) -> int:
        """Count of committed transactions."""
        return self._writer.commits

    @property
    def changes(self) -> int:
        """Count of ``change`` that were committed; telemetry is none.

        What was read before the count grew may hold no more; it grows before whoever asked for
        the change goes on.
        """
        return self._writer.changes

    @property
    def waiting_rows(self) -> int:
        """Appended rows that are not committed yet."""
        return self._writer.waiting_rows

    @property
    def bridged_rows(self) -> int:
        """Rows of these that are in the bridge journal, and survive the end of the station."""
        return self._writer.bridged_rows

    @property
    def bridge_fault(self) -> str | None:
        """Why rows that wait are in memory and not in the bridge journal, if they are."""
        return self._writer.bridge_fault

    @property
    def waiting_changes(self) -> int:
        """Changes and batches that the writer has not taken up yet."""
        return self._writer.waiting_changes

    def watch_transactions(self, listener: TransactionListener) -> None:
        """Have ``listener`` told on the writer's thread what each commit took; one may be."""
        self._writer.on_transaction = listener

    def add_fault_listener(self, listener: FaultListener) -> None:
        """Call ``listener`` on the writer's thread with each change of ``fault``."""
        self._listeners.append(listener)

    @contextmanager
    def listening(self, listener: ChangeListener) -> Generator[None]:
        """Call ``listener`` on the writer's thread after each change that was committed.

        It is given what the change left with ``tell_after_commit``, before whoever asked for the
        change goes on.
        """
        self._changed.append(listener)
        try:
            yield
        finally:
            self._changed.remove(listener)

    def add_bridged_listener(self, listener: BridgedListener) -> None:
        """Call ``listener`` on the writer's thread with rows of the bridge journal.

        They are in the database then; whoever appended them was told only that they are kept.
        """
        self._bridged.append(listener)

    def change(self, function: Callable[[Session], T]) -> "Future[T]":
        """Run ``function`` in a transaction of its own; the future resolves after the commit.

        The future fails with ``StoreUnavailableError`` when storage fails, and with whatever
        ``function`` raised; nothing is kept then.
        """
        return self._writer.change(function)

    async def write(self, function: Callable[[Session], T]) -> T:
        """Await ``change``."""
        return await asyncio.wrap_future(self._writer.change(function))

    def append(self, values: Sequence[Telemetry]) -> "Future[Kept]":
        """Take telemetry for the next batch, which is written as soon as the writer is free.

        The future resolves once the rows are committed or, while storage fails, in the bridge
        journal: only then may a robot be told to forget them. Where neither takes them the rows
        wait and are tried again; it fails with ``BufferFullError`` when too many wait already,
        and with ``UnknownIdError`` for a robot that the station does not know.
        """
        return self._writer.append(values)

    @contextmanager
    def read(self) -> Generator[Session]:
        """Open a session that sees one unchanging moment and cannot change anything.

        Raises:
            StoreUnavailableError: If the storage fails while the session is used.
        """
        try:
            with Session(self._read_engine, expire_on_commit=False) as session:
                yield session
        except DBAPIError as error:
            if not is_storage_fault(error):
                raise
            raise StoreUnavailableError(fault_sentence(error)) from error

    async def query(self, function: Callable[[Session], T]) -> T:
        """Run ``function`` with a reading session in a thread of its own."""

        def run() -> T:
            with self.read() as session:
                return function(session)

        return await asyncio.get_running_loop().run_in_executor(self._readers, run)

    def close(self) -> None:
        """Write what is queued and let go of the database; closing twice is harmless."""
        self._writer.close(CLOSE_TIMEOUT_S)
        self._readers.shutdown()
        self._read_engine.dispose()
        self._write_engine.dispose()

    def _tell_change(self, events: Sequence[object]) -> None:
        for listener in list(self._changed):
            listener(events)

    def _tell_bridged(self, rows: Sequence[Telemetry]) -> None:
        for listener in list(self._bridged):
            listener(rows)

    def _tell(self, fault: str | None) -> None:
        for listener in list(self._listeners):
            listener(fault)
