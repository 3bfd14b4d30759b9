"""Telemetry at a steady rate while old rows are pruned beside it, on SQLite.

The store takes what the bar of ingest asks, once alone and once while a pass moves, thins and
deletes; told are the rate that was kept, how late rows were committed, and the longest transaction
of the pass.
"""

import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import update
from sqlalchemy.orm import Session

from benchmarks.calibration import PYTHON, calibrated, scaled_row
from db.query.fleet.robots import add_robot
from db.store import Store
from db.tables import Deployment
from robot_link.messages import RawFrame, RobotId, StateReport
from robot_link.storage_config import StorageConfig
from server.storage.pruning import Pruner
from tests.db.conftest import report, robot_record, sample

RATE_S, SECONDS, BATCH_S = 5000.0, 20.0, 0.02
OLD_ROWS = 60_000
"""Of each kind: more than a pass takes in the time."""
KEPT_BAR_PERCENT, LATE_BAR_MS, TRANSACTION_BAR_MS = 97.0, 250.0, 20.0
"""Where the Python loop takes what ``calibration`` says of the reference machine."""
ROBOT = RobotId("mini-1")
_OLD = datetime(2026, 1, 5, 10, tzinfo=UTC)
_NOW = datetime(2026, 11, 21, tzinfo=UTC)
_RULES = StorageConfig.model_validate(
    {
        "samples": {"then": "move", "after_days": 30},
        "states": {"then": "thin", "after_days": 30, "period_s": 60},
        "raw": {"then": "delete", "after_days": 30},
    }
)


@dataclass(frozen=True, slots=True)
class Fed:
    """What became of telemetry at a steady rate."""

    rows_per_s: float
    late_ms: list[float]


def measure() -> list[dict[str, Any]]:
    """Feed a store alone, then beside a pass."""
    with (
        tempfile.TemporaryDirectory() as folder,
        calibrated(PYTHON) as speed,
        _store(Path(folder)) as store,
    ):
        alone = _fed(store, 0)
        with _pruning(store, Path(folder)) as pruner:
            beside = _fed(store, 1)
    name = f"beside a pass, {RATE_S:g} messages/s asked"
    kept = 100.0 * beside.rows_per_s / alone.rows_per_s
    late = float(np.percentile(beside.late_ms, 99))
    longest_ms = 1e3 * pruner.longest_s
    alone_ms = float(np.percentile(alone.late_ms, 99))
    rows = f"{beside.rows_per_s:.0f}/s beside {alone.rows_per_s:.0f}/s alone"
    return [
        scaled_row("prune", f"Rate kept {name} ({rows})", kept, "", KEPT_BAR_PERCENT, speed,
                   by="wall", at_least=True),
        scaled_row("prune", f"Row committed late {name}, p99 ({alone_ms:.0f} ms alone)", late, "ms",
                   LATE_BAR_MS, speed, by="wall"),
        scaled_row("prune", f"Longest transaction of {pruner.transactions}", longest_ms, "ms",
                   TRANSACTION_BAR_MS, speed, by="wall"),
    ]  # fmt: skip


@contextmanager
def _store(folder: Path) -> Iterator[Store]:
    """Open a store with a winter's day of a robot whose deployment has ended."""
    store = Store.open(f"sqlite:///{folder / 'station.sqlite3'}")
    try:
        store.change(_prepare).result()
        for begin in range(0, OLD_ROWS, 2000):
            store.append([one for step in range(begin, begin + 2000) for one in _at(step)]).result()
        yield store
    finally:
        store.close()


def _prepare(session: Session) -> None:
    add_robot(session, robot_record())
    session.execute(
        update(Deployment).values(
            state="recovered",
            started_at=_OLD - timedelta(days=1),
            ended_at=_OLD + timedelta(days=2),
        )
    )


def _at(step: int) -> tuple[Any, ...]:
    at = _OLD + timedelta(seconds=0.1 * step)
    value = 3.0 + np.sin(step / 50.0)
    return (
        _state(at, value),
        replace(sample(step, float(value)), measured_at=at, received_at=at),
        RawFrame(ROBOT, "radio", False, bytes(60), at),
    )


def _state(at: datetime, depth_m: float) -> StateReport:
    return replace(report(0.0, float(depth_m), ROBOT), measured_at=at, received_at=at)


@dataclass(slots=True)
class _Pass:
    longest_s: float = 0.0
    transactions: int = 0


@contextmanager
def _pruning(store: Store, folder: Path) -> Iterator[_Pass]:
    """Prune in a thread for as long as the block lasts."""
    told, is_over = _Pass(), threading.Event()

    def go_on() -> None:
        if is_over.is_set():
            raise InterruptedError

    pruner = Pruner(store, folder, _NOW, go_on)

    def run() -> None:
        try:
            pruner.run(_RULES)
        except InterruptedError:
            return

    thread = threading.Thread(target=run, name="pass")
    thread.start()
    try:
        yield told
    finally:
        is_over.set()
        thread.join()
        told.longest_s, told.transactions = pruner.longest_s, pruner.transactions


def _fed(store: Store, day: int) -> Fed:
    """Append states at the rate, and wait for their commits."""
    late_ms: list[float] = []
    begin = _NOW + timedelta(days=day)
    per_batch = round(RATE_S * BATCH_S)
    began_s = time.monotonic()
    waiting = []
    for batch in range(round(SECONDS / BATCH_S)):
        time.sleep(max(0.0, began_s + batch * BATCH_S - time.monotonic()))
        states = [
            _state(begin + timedelta(milliseconds=batch * per_batch + one), 1.0)
            for one in range(per_batch)
        ]
        asked_s = time.monotonic()
        future = store.append(states)
        future.add_done_callback(
            lambda _, asked_s=asked_s: late_ms.append(1e3 * (time.monotonic() - asked_s))
        )
        waiting.append(future)
    for future in waiting:
        future.result()
    return Fed(len(waiting) * per_batch / (time.monotonic() - began_s), late_ms)
