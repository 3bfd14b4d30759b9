"""The one thread that changes the database."""

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, TypeVar

from sqlalchemy import Engine
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from db.actor import Actor, acting, set_actor
from db.engine import fault_sentence, is_storage_fault
from db.fault import BufferFullError, StoreClosedError, StoreUnavailableError

T = TypeVar("T")
Append = Callable[[Session, Sequence[Any]], None]
FaultListener = Callable[[str | None], None]
ChangeListener = Callable[[Sequence[object]], object]

BATCH_PERIOD_S = 0.05
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


@dataclass(frozen=True, slots=True)
class _Rows:
    rows: Sequence[Any]
    future: Future[None]


class Writer:
    """Runs changes one after another and commits appended rows in batches.

    Work is done in the order in which it came, as long as storage works. A change that meets
    failing storage is refused, because its caller can say so to a person; appended rows wait in
    memory and are tried again, and their futures resolve only after the commit that holds them.
    """

    def __init__(
        self, engine: Engine, append: Append, on_fault: FaultListener, on_change: ChangeListener
    ) -> None:
        self._engine = engine
        self._append = append
        self._on_fault = on_fault
        self._on_change = on_change
        self._inbox: queue.SimpleQueue[_Change | _Rows | None] = queue.SimpleQueue()
        self._pending: deque[_Rows] = deque()
        self._pending_since_s = 0.0
        self._retry_at_s = 0.0
        self._waiting_rows = 0
        self._count_lock = threading.Lock()
        self._closed = False
        self.fault: str | None = None
        self.commits = 0
        self._thread = threading.Thread(target=self._run, name="db-writer", daemon=True)
        self._thread.start()

    def change(self, function: Callable[[Session], T]) -> "Future[T]":
        """Queue one transaction; the future resolves after its commit."""
        future: Future[T] = Future()
        if self._closed:
            future.set_exception(StoreClosedError("The station is stopping."))
        else:
            self._inbox.put(_Change(function, future, acting.get()))
        return future

    def append(self, rows: Sequence[Any]) -> "Future[None]":
        """Queue rows for the next batch; the future resolves after their commit."""
        future: Future[None] = Future()
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
        return self._waiting_rows

    def close(self, timeout_s: float) -> None:
        """Write what is queued, then end the thread; rows that cannot be written fail."""
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
                if not self._pending:
                    self._pending_since_s = time.monotonic()
                self._pending.append(item)
                if self._patience_s() == 0.0:
                    self._flush()
            else:
                self._flush()
                self._change(item)
        self._flush()
        for left in self._pending:
            left.future.set_exception(StoreUnavailableError(self.fault or "The station stopped."))

    def _patience_s(self) -> float | None:
        if not self._pending:
            return None
        due_s = max(self._pending_since_s + BATCH_PERIOD_S, self._retry_at_s)
        return max(0.0, due_s - time.monotonic())

    def _flush(self) -> None:
        """Commit every pending row in one transaction, or keep them all."""
        if not self._pending or (time.monotonic() < self._retry_at_s and not self._closed):
            return
        batch = list(self._pending)
        try:
            self._commit(lambda session: self._append(session, [r for b in batch for r in b.rows]))
        except StoreUnavailableError:
            self._retry_at_s = time.monotonic() + RETRY_PERIOD_S
            return
        except Exception:
            # One bad row must not take the others with it.
            logger.exception("a batch of %d appends failed; trying them one by one", len(batch))
            self._append_singly(batch)
            return
        self._settle(batch)

    def _append_singly(self, batch: list[_Rows]) -> None:
        for item in batch:
            try:
                self._commit(lambda session, rows=item.rows: self._append(session, rows))
            except StoreUnavailableError:
                self._retry_at_s = time.monotonic() + RETRY_PERIOD_S
                return
            except Exception as error:  # noqa: BLE001 - the error belongs to whoever gave the rows
                self._settle([item], error)
            else:
                self._settle([item])

    def _settle(self, items: list[_Rows], error: BaseException | None = None) -> None:
        for item in items:
            self._pending.remove(item)
            with self._count_lock:
                self._waiting_rows -= len(item.rows)
            if error is None:
                item.future.set_result(None)
            else:
                item.future.set_exception(error)

    def _change(self, item: _Change) -> None:
        if not item.future.set_running_or_notify_cancel():
            return
        try:
            result, events = self._commit(item.function, item.actor)
        except BaseException as error:  # noqa: BLE001 - the error belongs to whoever asked
            item.future.set_exception(error)
        else:
            self._tell(events)
            item.future.set_result(result)

    def _tell(self, events: Sequence[object]) -> None:
        try:
            self._on_change(events)
        except Exception:
            logger.exception("a listener for changes failed")

    def _commit(
        self, function: Callable[[Session], T], actor: Actor | None = None
    ) -> tuple[T, Sequence[object]]:
        """Return what a function returns in a transaction, and the events that it left there."""
        try:
            with Session(self._engine, expire_on_commit=False) as session, session.begin():
                set_actor(session, actor)
                result = function(session)
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
            self._on_fault(fault)
        except Exception:
            logger.exception("the listener for storage faults failed")
