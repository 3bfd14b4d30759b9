"""What a station that remembers much answers how soon: its deployments, and a long track.

A real station process on a prepared database, asked by REST over loopback.
"""

import signal
import tempfile
import time
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
from sqlalchemy.orm import Session

from benchmarks.calibration import PYTHON, calibrated, scaled_row
from benchmarks.station.samples import fill_samples
from db.query.fleet.robots import add_robot
from db.store import Store
from server.access.register import create_token
from server.access.role import Role
from server.base.settings import Settings
from tests.db.conftest import report, robot_record
from tests.server.cli.test_process import serve

SAMPLES, POINTS, ASKED = 4_000_000, 20_000, 15
DEPLOYMENTS_BAR_MS = 50.0
TRACK_BAR_MS = 300.0
"""Where the Python loop takes what ``calibration`` says of the reference machine."""


def measure() -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        token = _prepared(folder)
        process, url = serve(folder)
        try:
            with (
                httpx.Client(base_url=url, headers={"Authorization": f"Bearer {token}"}) as client,
                calibrated(PYTHON) as calibration,
            ):
                deployments_ms = _answered_ms(client, "/api/deployments")
                track_ms = _answered_ms(client, f"/api/robots/mini-1/track?max_points={POINTS}")
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait()
            process.stdout.close()
    listed = f"deployments, one with {SAMPLES:,} samples"
    drawn = f"track of {POINTS:,} points"
    return [
        scaled_row("stored", listed, deployments_ms, "ms", DEPLOYMENTS_BAR_MS, calibration),
        scaled_row("stored", drawn, track_ms, "ms", TRACK_BAR_MS, calibration),
    ]


def _prepared(folder: Path) -> str:
    """Fill a data folder and return the token of a viewer."""

    def fill(session: Session) -> str:
        add_robot(session, robot_record())
        fill_samples(session, SAMPLES)
        lifetime, at = timedelta(hours=1), datetime.now(UTC)
        return create_token(session, "bench", Role.VIEWER, lifetime, at=at, by="bench").secret

    with closing(Store.open(Settings(data_dir=folder).resolved_database_url)) as store:
        token = store.change(fill).result()
        states = [
            replace(report(second, depth_m=0.5 + 0.4 * (second % 97) / 97), energy_used=0.0)
            for second in range(POINTS)
        ]
        for first in range(0, POINTS, 2000):
            store.append(states[first : first + 2000]).result()
    return token


def _answered_ms(client: httpx.Client, path: str) -> float:
    """Return the time of the quickest answer: what others do on the machine is not its."""
    times_ms: list[float] = []
    for _ in range(ASKED):
        before_s = time.perf_counter()
        client.get(path, timeout=120).raise_for_status()
        times_ms.append((time.perf_counter() - before_s) * 1e3)
    return min(times_ms)
