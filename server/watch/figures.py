"""What the station says of its own parts: database, workers, jobs, alarms, viewers, machine."""

import asyncio
import platform
import shutil
import time
from collections import Counter as Count
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Final

from prometheus_client import ProcessCollector
from prometheus_client.core import Metric
from sqlalchemy import text
from sqlalchemy.orm import Session

from server.base.alarm_board import LEVELS, PARKED
from server.base.event_bus import JobChanged
from server.base.foundation import Foundation
from server.base.job import JobBoard
from server.base.metric.metrics import counted, gauge, gauges, totals
from server.watch.log import dropped_lines

_BATCH_BUCKETS_S: Final = (0.002, 0.005, 0.01, 0.03, 0.1, 0.3, 1.0, 5.0)
_RUNNING: Final = ("queued", "running")
_SIZES: Final = {
    "sqlite": "SELECT page_count * page_size FROM pragma_page_count(), pragma_page_size()",
    "postgresql": "SELECT pg_database_size(current_database())",
}
_STATM: Final = "/proc/{}/statm"
_PAGE_BYTES: Final = 4096


class _ProcessFigures(ProcessCollector):
    """Figures of this process, also where it sees nothing of ``/proc`` but processes.

    So it is as a service (``ProcSubset=pid``), which hides the file that the base class reads.
    """

    def _boot_time(self) -> float:
        return time.time() - time.clock_gettime(time.CLOCK_BOOTTIME)


def register(foundation: Foundation) -> None:
    """Have every part of the foundation tell its figures."""
    metrics = foundation.metrics
    _ProcessFigures(registry=metrics.registry)
    started_s = time.time()
    metrics.add(lambda: _build(started_s))
    metrics.add(lambda: _storage(foundation))
    metrics.add(_log)
    metrics.add(lambda: _alarms(foundation))
    metrics.add(lambda: _work(foundation))
    metrics.add(lambda: _disk(foundation.settings.data_dir))
    metrics.add_query(_database_size)
    latency = metrics.histogram(
        "writer_transaction_seconds", "How long one transaction takes.", _BATCH_BUCKETS_S, ("kind",)
    )
    rows = metrics.counter("writer_rows", "Rows of telemetry that were committed.")

    def transaction(kind: str, count: int, took_s: float) -> None:
        latency.labels(kind).observe(took_s)
        rows.inc(count)

    foundation.store.watch_transactions(transaction)
    ended = metrics.counter("jobs", "Jobs that ended.", ("kind", "state"))

    def job_changed(event: JobChanged) -> None:
        if event.job.state not in _RUNNING:
            ended.labels(event.job.kind, event.job.state).inc()

    foundation.bus.subscribe(JobChanged, job_changed)


def _build(started_s: float) -> Iterator[Metric]:
    labels = (version("grace-ground-station"), platform.python_version())
    yield gauges("build_info", "What runs, always 1.", ("version", "python"), [(labels, 1.0)])
    yield gauge("start_time_seconds", "When the station started, Unix time.", started_s)
    yield gauge("event_loop_tasks", "Tasks of the event loop.", len(asyncio.all_tasks()))


def _storage(foundation: Foundation) -> Iterator[Metric]:
    store = foundation.store
    yield gauge("writer_queue_rows", "Rows that wait to be written.", store.waiting_rows)
    yield gauge("writer_queue_changes", "Changes that wait to be written.", store.waiting_changes)
    commits = [((), float(store.commits))]
    yield totals("writer_commits", "Transactions that were committed.", (), commits)
    fault = float(store.fault is not None)
    yield gauge("writer_fault", "Whether storage fails: 1 while it does.", fault)
    on_disk = "Rows that wait in the bridge journal on the disk."
    yield gauge("writer_bridged_rows", on_disk, store.bridged_rows)
    refuses = "Whether the bridge journal takes no rows, so that they wait in memory: 1 while so."
    yield gauge("writer_bridge_fault", refuses, float(store.bridge_fault is not None))


def _log() -> Iterator[Metric]:
    lines = [((), float(dropped_lines()))]
    yield totals("log_lines_dropped", "Log lines that a slow disk left no room for.", (), lines)


def _alarms(foundation: Foundation) -> Iterator[Metric]:
    standing = Count(
        alarm.level
        for alarm in foundation.alarms.open
        if alarm.cleared_at is None and alarm.state not in PARKED
    )
    levels = {level: float(standing[level]) for level in LEVELS}
    yield counted("alarms_standing", "Alarms that stand and nobody parked.", "level", levels)
    unseen = foundation.alarms.unacknowledged
    yield gauge("alarms_unacknowledged", "Alarms that nobody has seen.", unseen)


def _work(foundation: Foundation) -> Iterator[Metric]:
    loads = {"plan": foundation.workers.load(), "study": foundation.study_workers.load()}
    yield gauges(
        "worker_processes",
        "Worker processes, by pool and what they do.",
        ("pool", "state"),
        [
            ((pool, state), float(count))
            for pool, load in loads.items()
            for state, count in (("busy", load.busy), ("idle", load.idle))
        ],
    )
    queued = {pool: float(load.queued) for pool, load in loads.items()}
    yield counted("worker_tasks_queued", "Tasks that wait for a worker.", "pool", queued)
    ids = {
        "plan": foundation.workers.process_ids(),
        "study": foundation.study_workers.process_ids(),
    }
    memory = {pool: float(sum(map(_resident_bytes, pids))) for pool, pids in ids.items()}
    yield counted("worker_memory_bytes", "Resident memory of workers.", "pool", memory)
    yield counted("jobs_running", "Jobs under way.", "kind", _running(foundation.jobs))
    yield gauge("live_viewers", "Clients that follow the live stream.", foundation.feed.followers)


def _running(jobs: JobBoard) -> dict[str, float]:
    return dict(Count(job.kind for job in jobs.running))


def _disk(folder: Path) -> Iterator[Metric]:
    usage = shutil.disk_usage(folder)
    yield gauge("disk_free_bytes", "Free space where the data folder is.", usage.free)
    yield gauge("disk_size_bytes", "Size of the disk where the data folder is.", usage.total)


def _database_size(session: Session) -> Iterator[Metric]:
    statement = _SIZES[session.get_bind().dialect.name]
    size = float(session.execute(text(statement)).scalar_one())
    yield gauge("database_size_bytes", "Size of the database.", size)


def _resident_bytes(process: int) -> int:
    try:
        return int(Path(_STATM.format(process)).read_text().split()[1]) * _PAGE_BYTES
    except OSError:
        return 0
