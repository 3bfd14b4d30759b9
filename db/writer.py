"""The one thread that changes the database."""

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeVar

from sqlalchemy import Engine
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from db.actor import Actor, acting, set_actor
from db.bridge import Batch, Bridge
from db.claim import Claim, claimed, keep_claim
from db.engine import fault_sentence, is_storage_fault
from db.fault import BufferFullError, StoreClosedError, StoreUnavailableError

T = TypeVar("T")
Append = Callable[[Session, Sequence[Any]], None]
FaultListener = Callable[[str | None], None]
ChangeListener = Callable[[Sequence[object]], object]
BridgedListener = Callable[[Sequence[Any]], object]
TransactionListener = Callable[[str, int, float], object]
"""Told of a commit: ``change`` or ``rows``, how many rows of telemetry, and how long it took, s."""

BATCH_ROWS_MAX = 5_000
"""Of a transaction; an append of more is one of its own."""
RETRY_PERIOD_S = 0.5
BUFFERED_ROWS_MAX = 200_000

_EVENTS = "events of the transaction"

logger = logging.getLogger(__name__)


def tell_after_commit(session: Session, event: object, about: str) -> None:
    """Have an event handed to the listeners once a session's change is committed, never else.

    A later event of the same type about the same thing takes its place.
    """
    events: dict[tuple[type, str], object] = session.info.setdefault(_EVENTS, {})
    events.pop((type(event), about), None)
    events[type(event), about] = event


@dataclass(frozen=True, slots=True)
class _Change:
    function: Callable[[Session], Any]
    future: Future[Any]
    actor: Actor | None
    claim: Claim | None


class Kept(Enum):
    """Where appended rows are; they survive whatever ends the station in either."""

    DATABASE = "database"
    BRIDGE = "bridge"
    """In the bridge journal, on their way into the database."""


@dataclass(frozen=True, slots=True)
class _Rows:
    rows: Sequence[Any]
    future: Future[Kept]


@dataclass(frozen=True, slots=True)
class Listeners:
    """Whom a writer tells; each is called on its thread."""

    fault: FaultListener
    change: ChangeListener
    bridged: BridgedListener
    """Is given rows of the bridge journal that are in the database now."""


class Writer:
    """Runs changes one after another and commits appended rows in batches.

    A batch is what was appended while the one before was written: rows wait for nothing else.

    Work is done in the order in which it came, as long as storage works. A change that meets
    failing storage is refused, because its caller can say so to a person. Appended rows go into
    the bridge journal then, and from there into the database, the oldest first, before any later
    ones; without a journal, or room for it, they wait in memory. Their futures resolve once they
    would survive the end of the station.
    """

    def __init__(
        self, engine: Engine, append: Append, listeners: Listeners, bridge: Bridge | None = None
    ) -> None:
        self._engine = engine
        self._append = append
        self._listeners = listeners
        self._bridge = bridge
        self._inbox: queue.SimpleQueue[_Change | _Rows | None] = queue.SimpleQueue()
        self._pending: deque[_Rows] = deque()
        self._tried: tuple[list[_Rows], Batch] | None = None
        """What was handed to the database last, and may be in it or not."""
        self._retry_at_s = 0.0
        self._waiting_rows = 0
        self._count_lock = threading.Lock()
        self._closed = False
        self.fault: str | None = None
        self.bridge_fault: str | None = None
        self.commits = 0
        self.changes = 0
        """Commits of these that were not rows alone; counted before whoever asked goes on."""
        self.on_transaction: TransactionListener | None = None
        """Called on the writer's thread."""
        self._thread = threading.Thread(target=self._run, name="db-writer", daemon=True)
        self._thread.start()

    def change(self, function: Callable[[Session], T]) -> "Future[T]":
        """Queue one transaction; the future resolves after its commit."""
        future: Future[T] = Future()
        if self._closed:
            future.set_exception(StoreClosedError("The station is stopping."))
        else:
            self._inbox.put(_Change(function, future, acting.get(), claimed.get()))
        return future

    def append(self, rows: Sequence[Any]) -> "Future[Kept]":
        """Queue rows for the next batch; the future resolves once they are kept."""
        future: Future[Kept] = Future()
        # From here on nobody can cancel: rows that were taken are written.
        future.set_running_or_notify_cancel()
        with self._count_lock:
            if self._closed:
                future.set_exception(StoreClosedError("The station is stopping."))
                return future
            if self._waiting_rows + len(rows) > BUFFERED_ROWS_MAX:
                future.set_exception(BufferFullError(self.fault or "The database is too slow."))
                return future
            self._waiting_rows += len(rows)
        self._inbox.put(_Rows(rows, future))
        return future

    @property
    def waiting_rows(self) -> int:
        """Rows that were taken but are not committed yet."""
        return self._waiting_rows + self.bridged_rows

    @property
    def bridged_rows(self) -> int:
        """Rows of these that are in the bridge journal."""
        return 0 if self._bridge is None else self._bridge.waiting_rows

    @property
    def waiting_changes(self) -> int:
        """Changes and batches of rows that the thread has not taken up yet."""
        return self._inbox.qsize()

    def close(self, timeout_s: float) -> None:
        """Write what is queued, then end the thread; rows that cannot be kept fail."""
        with self._count_lock:
            if self._closed:
                return
            self._closed = True
        self._inbox.put(None)
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while True:
            try:
                item = self._inbox.get(timeout=self._patience_s())
            except queue.Empty:
                self._flush()
                continue
            if item is None:
                break
            if isinstance(item, _Rows):
                self._pending.append(item)
                if self._inbox.empty():
                    self._flush()
            else:
                self._flush()
                self._change(item)
        self._flush()
        for left in self._pending:
            left.future.set_exception(StoreUnavailableError(self.fault or "The station stopped."))
        if self._bridge is not None:
            self._bridge.close()

    def _patience_s(self) -> float | None:
        """Return how long nothing need be done, ``None`` for until something comes."""
        if not self._pending and not self.bridged_rows:
            return None
        return max(0.0, self._retry_at_s - time.monotonic())

    @property
    def _rests(self) -> bool:
        """Whether the database failed a moment ago."""
        return time.monotonic() < self._retry_at_s and not self._closed

    def _flush(self) -> None:
        """Bring every pending row into the database, or else to the disk, or else keep it."""
        bridge = self._bridge
        if bridge is not None and (bridge.waiting_rows or self.fault is not None):
            self._pass_by(bridge)
            if bridge.waiting_rows:
                return
        try:
            while self._pending and not self._rests:
                self._write_pending()
        except StoreUnavailableError:
            self._retry_at_s = time.monotonic() + RETRY_PERIOD_S
            if bridge is not None:
                self._put_aside(bridge)

    def _pass_by(self, bridge: Bridge) -> None:
        """Let pending rows wait behind those on the disk, and write the oldest of these."""
        self._put_aside(bridge)
        if bridge.waiting_rows and not self._rests and not self._closed:
            self._empty(bridge)

    def _write_pending(self) -> None:
        items, batch = self._next_batch()
        begun_s = time.monotonic()
        try:
            self._commit(lambda session: self._keep(session, batch))
        except StoreUnavailableError:
            raise
        except Exception:
            # One bad row must not take the others with it.
            logger.exception("a batch of %d appends failed; trying them one by one", len(items))
            self._append_singly(items)
        else:
            self._note("rows", len(batch.rows), begun_s)
            self._settle(items, Kept.DATABASE)

    def _note(self, kind: str, rows: int, begun_s: float) -> None:
        if self.on_transaction is not None:
            self.on_transaction(kind, rows, time.monotonic() - begun_s)

    def _next_batch(self) -> tuple[list[_Rows], Batch]:
        """Return what is to be kept next: the same again until it is known to be kept."""
        if self._tried is None:
            items: list[_Rows] = []
            size = 0
            for item in self._pending:
                if items and size + len(item.rows) > BATCH_ROWS_MAX:
                    break
                items.append(item)
                size += len(item.rows)
            self._tried = items, self._batch(items)
        return self._tried

    def _batch(self, items: Sequence[_Rows]) -> Batch:
        rows = [row for item in items for row in item.rows]
        return Batch(0, rows) if self._bridge is None else self._bridge.batch(rows)

    def _keep(self, session: Session, batch: Batch) -> None:
        if self._bridge is None or self._bridge.keep_once(session, batch):
            self._append(session, batch.rows)

    def _append_singly(self, items: Sequence[_Rows]) -> None:
        for item in items:
            self._tried = [item], self._batch([item])
            try:
                self._commit(lambda session: self._keep(session, self._next_batch()[1]))
            except StoreUnavailableError:
                raise
            except Exception as error:  # noqa: BLE001 - the error belongs to whoever gave the rows
                self._settle([item], error)
            else:
                self._settle([item], Kept.DATABASE)

    def _put_aside(self, bridge: Bridge) -> None:
        """Have every pending row wait on the disk; without room there, it waits in memory."""
        while self._pending:
            items, batch = self._next_batch()
            try:
                bridge.put(batch)
            except OSError as error:
                if self.bridge_fault is None:
                    logger.warning("rows wait in memory, not in the bridge journal: %s", error)
                self.bridge_fault = error.strerror or str(error)
                return
            self.bridge_fault = None
            self._settle(items, Kept.BRIDGE)

    def _empty(self, bridge: Bridge) -> None:
        """Bring the oldest rows of the bridge journal into the database."""
        try:
            batches = bridge.oldest(BATCH_ROWS_MAX)
            kept = self._write(bridge, batches)
            bridge.written()
        except (StoreUnavailableError, OSError) as error:
            if isinstance(error, OSError):
                logger.warning("the bridge journal is not emptied: %s", error)
            self._retry_at_s = time.monotonic() + RETRY_PERIOD_S
            return
        try:
            self._listeners.bridged(kept)
        except Exception:
            logger.exception("a listener for rows of the bridge journal failed")

    def _write(self, bridge: Bridge, batches: Sequence[Batch]) -> Sequence[Any]:
        """Write batches of the bridge journal; return the rows that are in the database now."""

        def all_of_them(session: Session) -> None:
            for batch in batches:
                self._keep(session, batch)

        rows = [row for batch in batches for row in batch.rows]
        try:
            self._commit(all_of_them)
        except StoreUnavailableError:
            raise
        except Exception:
            logger.exception("rows of the bridge journal failed; trying them one by one")
        else:
            return rows
        kept, _ = self._commit(lambda session: self._write_singly(session, bridge, batches))
        return kept

    def _write_singly(
        self, session: Session, bridge: Bridge, batches: Sequence[Batch]
    ) -> Sequence[Any]:
        kept: list[Any] = []
        for batch in batches:
            rows = batch.rows if bridge.keep_once(session, batch) else ()
            for row in rows:
                try:
                    with session.begin_nested():
                        self._append(session, [row])
                except DBAPIError as error:
                    if is_storage_fault(error):
                        raise
                    bridge.refuse([row], error)
                except Exception as error:  # noqa: BLE001 - it is told with the row
                    bridge.refuse([row], error)
                else:
                    kept.append(row)
        return kept

    def _settle(self, items: Sequence[_Rows], outcome: Kept | BaseException) -> None:
        self._tried = None
        for item in items:
            self._pending.remove(item)
            with self._count_lock:
                self._waiting_rows -= len(item.rows)
            if isinstance(outcome, Kept):
                item.future.set_result(outcome)
            else:
                item.future.set_exception(outcome)

    def _change(self, item: _Change) -> None:
        if not item.future.set_running_or_notify_cancel():
            return
        begun_s = time.monotonic()
        try:
            result, events = self._commit(item.function, item.actor, item.claim)
        except BaseException as error:  # noqa: BLE001 - the error belongs to whoever asked
            item.future.set_exception(error)
        else:
            self.changes += 1
            self._note("change", 0, begun_s)
            self._tell(events)
            item.future.set_result(result)

    def _tell(self, events: Sequence[object]) -> None:
        try:
            self._listeners.change(events)
        except Exception:
            logger.exception("a listener for changes failed")

    def _commit(
        self,
        function: Callable[[Session], T],
        actor: Actor | None = None,
        claim: Claim | None = None,
    ) -> tuple[T, Sequence[object]]:
        """Return what a function returns in a transaction, and the events that it left there."""
        try:
            with Session(self._engine, expire_on_commit=False) as session, session.begin():
                set_actor(session, actor)
                result = function(session)
                keep_claim(session, claim)
        except DBAPIError as error:
            if not is_storage_fault(error):
                raise
            self._set_fault(fault_sentence(error))
            raise StoreUnavailableError(fault_sentence(error)) from error
        self.commits += 1
        self._set_fault(None)
        return result, tuple(session.info.get(_EVENTS, {}).values())

    def _set_fault(self, fault: str | None) -> None:
        if fault == self.fault:
            return
        self.fault = fault
        try:
            self._listeners.fault(fault)
        except Exception:
            logger.exception("the listener for storage faults failed")
