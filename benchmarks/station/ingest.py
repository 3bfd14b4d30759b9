"""From a radio's bytes to committed rows: how fast on one core, and how late at a steady rate.

Needs a core for the station and some of another for the radio; without a figure it says why.
"""

import asyncio
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import func, select

from autonomy.site import TANK
from benchmarks.calibration import PYTHON, NotMeasuredError, calibrated, scaled_row
from benchmarks.field.field import row
from db.query.fleet.robots import RobotRecord, add_robot
from db.sample_tables import SampleRow
from db.store import Store
from db.tables import StateRow
from robot_link.messages import RobotId, StateReport, SystemId
from server.base.settings import Settings
from server.station import Station, run_station
from tests.postgresql_server import postgresql_server

ROBOTS = 20
FULL_SPEED_MESSAGES = 30_000
STEADY_MESSAGES, STEADY_RATE_S = 10_000, 1000.0
SPEED_BARS_S = {"SQLite": 5000.0, "PostgreSQL": 3000.0}
LATE_BAR_MS = 250.0
"""Where the Python loop takes what ``calibration`` says of the reference machine."""
LIMIT_S = 300.0
"""Longest wait for all rows of a run."""


def measure() -> list[dict[str, Any]]:
    """Feed a station as fast as it takes packets, with each engine, then at a steady rate.

    Raises:
        NotMeasuredError: If not all messages became rows.
    """
    rows = [_fast("SQLite", None), _late()]
    with postgresql_server() as server:
        if server is None:
            bar_s = SPEED_BARS_S["PostgreSQL"]
            return [*rows, row("ingest", _what("PostgreSQL"), None, "1/s; no server", bar_s, None)]
        return [*rows, _fast("PostgreSQL", server.url(server.database()))]


def _fast(engine: str, url: str | None) -> dict[str, Any]:
    with calibrated(PYTHON) as calibration:
        busy_s, _ = asyncio.run(_fed(FULL_SPEED_MESSAGES, 0.0, url))
    speed_s, bar_s = FULL_SPEED_MESSAGES / busy_s, SPEED_BARS_S[engine]
    return scaled_row(
        "ingest", _what(engine), speed_s, "1/s", bar_s, calibration, by="median", at_least=True
    )


def _what(engine: str) -> str:
    return f"MAVLink messages of {ROBOTS} robots, bytes to {engine} rows, by CPU time"


def _late() -> dict[str, Any]:
    with calibrated(PYTHON) as calibration:
        _, late_ms = asyncio.run(_fed(STEADY_MESSAGES, STEADY_RATE_S, None))
    what = f"Byte to row at {STEADY_RATE_S:g} messages/s, p99"
    p99_ms = float(np.percentile(late_ms, 99))
    return scaled_row("ingest", what, p99_ms, "ms", LATE_BAR_MS, calibration, by="wall")


async def _fed(messages: int, rate_s: float, url: str | None) -> tuple[float, list[float]]:
    """Return processor seconds of the station, and how late each state was committed, ms."""
    with tempfile.TemporaryDirectory() as folder, _feeder(messages, rate_s) as feeder:
        assert feeder.stdout is not None  # noqa: S101 - a pipe was asked for
        assert feeder.stdin is not None  # noqa: S101 - a pipe was asked for
        settings = Settings(data_dir=Path(folder), database_url=url, worker_processes=1)
        _prepare(settings, int(feeder.stdout.readline()))
        async with run_station(settings, Station) as running:
            store = running.foundation.store
            late_ms = _watch(store)
            await asyncio.sleep(2.0)
            began_s = time.process_time()
            feeder.stdin.write(b"go\n")
            feeder.stdin.flush()
            give_up_s = time.monotonic() + LIMIT_S
            while (rows := await store.query(_rows)) < messages:
                what = f"{rows} of {messages} messages became rows"
                if feeder.poll() is not None:
                    raise NotMeasuredError(f"{what} when the station hung up on the radio")
                if time.monotonic() > give_up_s:
                    raise NotMeasuredError(f"only {what} in {LIMIT_S:g} s")
                await asyncio.sleep(0.2)
            return time.process_time() - began_s, late_ms


def _rows(session) -> int:
    return sum(
        session.scalar(select(func.count()).select_from(table)) for table in (StateRow, SampleRow)
    )


def _watch(store: Store) -> list[float]:
    """Note how old each state is when the transaction that holds it was committed."""
    late_ms: list[float] = []
    append = store.append

    def watched(values):
        future = append(values)
        times = [value.measured_at for value in values if isinstance(value, StateReport)]

        def note(_):
            now = datetime.now(UTC)
            late_ms.extend((now - at).total_seconds() * 1e3 for at in times)

        future.add_done_callback(note)
        return future

    store.append = watched
    return late_ms


@contextmanager
def _feeder(messages: int, rate_s: float) -> Iterator[subprocess.Popen[bytes]]:
    arguments = [str(ROBOTS), str(messages), str(rate_s)]
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.station.ingest_feeder", *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    try:
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=10)


def _prepare(settings: Settings, port: int) -> None:
    at = datetime.now(UTC)
    store = Store.open(settings.resolved_database_url)

    def write(session) -> None:
        for number in range(1, ROBOTS + 1):
            add_robot(
                session,
                RobotRecord(
                    id=RobotId(f"mini-{number}"),
                    name=f"mini-{number}",
                    model="miniglider",
                    kind="simulated",
                    system_id=SystemId(number),
                    links=(f"xbee://127.0.0.1:{port}",),
                    site=TANK,
                    created_at=at,
                ),
            )

    try:
        store.change(write).result()
    finally:
        store.close()
