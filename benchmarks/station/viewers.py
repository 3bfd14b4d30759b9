"""Many who watch: what a real station costs, how late they see, and that no stalled one is felt.

Two shapes: 50 viewers and 20 readers of REST on 20 robots that report at 10 Hz, and 100 viewers
on 50 robots at 1 Hz; in each, one further client asks for the live stream and never reads it.
Robots, station and viewers are processes of their own; two cores are needed, one for the station.
"""

import os
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from autonomy.site import TANK
from benchmarks.calibration import PYTHON, NotMeasuredError, calibrated, scaled_row
from benchmarks.field.field import at_most
from benchmarks.station import viewer_crowd
from benchmarks.station.flood import free_ports
from benchmarks.station.state_feeder import feeding
from benchmarks.station.station_process import StationProcess, ended, served, viewer_token
from db.query.fleet.robots import RobotRecord, add_robot
from db.store import Store
from robot_link.messages import RobotId, SystemId
from server.base.settings import Settings

AREA = "viewers"
SHAPES = ((20, 10.0, 50, 20), (50, 1.0, 100, 20))
"""Robots, how often each reports (Hz), viewers, readers of REST."""
MEASURE_S = 15.0
CPU_BAR_PERCENT = 25.0
LATE_BAR_MS = 300.0
MEMORY_BAR_MB = 500.0


def measure() -> list[dict[str, Any]]:
    """Measure both shapes.

    Raises:
        NotMeasuredError: If the station does not start, or brings nothing to a viewer.
    """
    return [row for shape in SHAPES for row in _rows(*shape)]


def _rows(robots: int, rate_hz: float, viewers: int, readers: int) -> list[dict[str, Any]]:
    with station_of(robots, rate_hz) as station, calibrated(PYTHON) as calibration:
        crowd = viewer_crowd.begin(
            station.url, station.token, viewers, readers, MEASURE_S, stalled=True
        )
        with ended(crowd):
            viewer_crowd.ready(crowd)
            cpu_s, begun_s = station.cpu_s(), time.monotonic()
            seen = viewer_crowd.end(crowd)
            percent = 100.0 * (station.cpu_s() - cpu_s) / (time.monotonic() - begun_s)
            memory_mb = station.memory_mb()
    if not seen.ages_ms or not seen.answers_ms or seen.refused:
        raise NotMeasuredError(f"{seen.refused} questions refused, {seen.batches} batches")
    load = f"{robots} robots x {rate_hz:g} Hz, {viewers} viewers, {readers} readers"
    per_viewer = f"{len(seen.ages_ms) / viewers / MEASURE_S:.0f} states/s a viewer"
    busy = f"load {os.getloadavg()[0]:.1f}"
    age, answer = viewer_crowd.age_ms(seen, 95), viewer_crowd.answer_ms(seen, 95)
    line = partial(scaled_row, AREA, calibration=calibration)
    return [
        line(
            name=f"CPU of the station, {load}",
            value=percent,
            unit="%",
            bar=CPU_BAR_PERCENT,
            by="median",
        ),
        line(
            name=f"Age of states, p95, {per_viewer}",
            value=age,
            unit="ms",
            bar=LATE_BAR_MS,
            by="wall",
        ),
        line(
            name=f"Answers, p95, {busy}, {load}",
            value=answer,
            unit="ms",
            bar=LATE_BAR_MS,
            by="wall",
        ),
        at_most(AREA, f"Memory of the station, {load}", memory_mb, "MB", MEMORY_BAR_MB),
    ]


@contextmanager
def station_of(robots: int, rate_hz: float) -> Generator[StationProcess]:
    """Serve robots that report; the fleet speaks as long as the context lasts."""
    ports = free_ports(robots + 1)[1:]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        token = _prepare(folder, ports)
        with served(folder, token) as station, feeding(rate_hz, ports):
            yield station


def _prepare(folder: Path, ports: list[int]) -> str:
    """Make robots known to a fresh data folder and return a viewer's token."""
    at = datetime.now(UTC)
    store = Store.open(Settings(data_dir=folder).resolved_database_url)

    def write(session: Session) -> str:
        for number, port in enumerate(ports, 1):
            key, link = RobotId(f"robot-{number}"), f"udp://127.0.0.1:{port}?listen=1"
            system = SystemId(number)
            add_robot(
                session,
                RobotRecord(key, key, "miniglider", "real", system, (link,), TANK, at),
            )
        return viewer_token(session)

    try:
        return store.change(write).result()
    finally:
        store.close()
