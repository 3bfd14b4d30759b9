"""What a stored measurement costs on disk, and how soon charts of millions of them are drawn.

Filled by the queries that the station runs, with rows as its robots send them; charts are read as
REST reads them, of a table of ten million rows.
"""

import tempfile
import time
from contextlib import closing
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import text
from sqlalchemy.orm import Session

from benchmarks.calibration import PYTHON, calibrated, scaled_row
from db.query.fleet.robots import add_robot
from db.query.measured.telemetry import history
from db.sample_ingest import NewSample, insert_samples
from db.sample_tables import COARSE_S, FINE_S
from db.store import Store
from tests.db.conftest import START, robot_record

COST_BAR_BYTES, CHART_BAR_MS = 90.0, 300.0
COST_ROBOTS, COST_CHANNELS, COST_SECONDS, BATCH_SECONDS = 4, 10, 5000, 2
CHART_ROWS = 10_000_000
CHANNELS = ("temperature", "chlorophyll")
_SMALL_ROWS = 1_000_000
"""Of a channel that shares its table with a longer one."""
ASKED = 5
_FILL = """
INSERT INTO sample (robot_key, channel_key, measured_at, log_key, sequence, value, north_mm,
                    east_mm, depth_mm, position_std_um)
WITH RECURSIVE one(n) AS (SELECT 0 UNION ALL SELECT n + 1 FROM one WHERE n < :last)
SELECT 1, :channel, :begin + n * 1000000, 1, :first + n, (n * 7919) % 10007 / 7.0, 1000, 500, 200,
       30000
FROM one
"""
_SUM_UP = """
INSERT INTO sample_rollup (robot_key, channel_key, length_s, stretch, size, least, least_at,
                           greatest, greatest_at)
SELECT 1, channel_key, :length, measured_at / (:length * 1000000), count(*), min(value),
       min(measured_at), max(value), max(measured_at)
FROM sample GROUP BY channel_key, measured_at / (:length * 1000000)
"""


def measure() -> list[dict[str, Any]]:
    sent, once = _cost_bytes(BATCH_SECONDS), _cost_bytes(COST_SECONDS)
    with (
        tempfile.TemporaryDirectory() as name,
        closing(_filled(Path(name))) as store,
        calibrated(PYTHON) as calibration,
    ):
        whole_ms = _drawn_ms(store, "temperature", CHART_ROWS)
        part_ms = _drawn_ms(store, "chlorophyll", _SMALL_ROWS)
        days_ms = _drawn_ms(store, "temperature", 3 * 86_400)
    rows = [
        {
            "area": "samples",
            "name": f"a stored sample with its indices, {how}",
            "value": cost,
            "unit": "bytes",
            "bar": COST_BAR_BYTES,
            "met": cost <= COST_BAR_BYTES,
        }
        for how, cost in (("as robots send them", sent), ("as recordings are read", once))
    ]
    charts = {
        f"chart of a channel's whole history, {CHART_ROWS:,} rows": whole_ms,
        f"chart of {_SMALL_ROWS:,} rows among {CHART_ROWS:,} of another channel": part_ms,
        f"chart of three days at 1 Hz among {CHART_ROWS:,} rows": days_ms,
    }
    return rows + [
        scaled_row("samples", what, took_ms, "ms", CHART_BAR_MS, calibration)
        for what, took_ms in charts.items()
    ]


def _cost_bytes(batch_seconds: int) -> float:
    """Return the bytes of the file for each sample; several robots measure channels at 1 Hz."""
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as name:
        url = f"sqlite:///{Path(name) / 'station.sqlite3'}"
        with closing(Store.open(url)) as store:

            def begin(session: Session) -> None:
                for robot in range(1, COST_ROBOTS + 1):
                    add_robot(session, robot_record(f"mini-{robot}", robot))

            store.change(begin).result()
            empty = store.change(_size_bytes).result()
            samples = 0
            for second in range(0, COST_SECONDS, batch_seconds):
                rows = _rows(rng, range(second, min(second + batch_seconds, COST_SECONDS)))
                samples += len(rows)
                store.change(lambda session, rows=rows: insert_samples(session, rows)).result()
            return (store.change(_size_bytes).result() - empty) / samples


def _rows(rng: np.random.Generator, seconds: range) -> list[NewSample]:
    """Return measurements far from the water's origin, at times that fill all of their bytes."""
    return [
        NewSample(
            robot_key=robot,
            log=2**40 + robot,
            sequence=second * COST_CHANNELS + channel,
            channel=f"channel_{channel}",
            measured_at=(at := START + timedelta(seconds=second, microseconds=137 * robot)),
            received_at=at,
            value=float(value),
            position_ned=(812.5 + second * 0.3, -1204.25 + second * 0.1, 20.0 + second % 40),
            position_std_m=3.25,
        )
        for second in seconds
        for robot in range(1, COST_ROBOTS + 1)
        for channel, value in enumerate(rng.normal(size=COST_CHANNELS))
    ]


def _size_bytes(session: Session) -> int:
    pages, size = (session.scalar(text(f"PRAGMA {name}")) for name in ("page_count", "page_size"))
    return pages * size


def _filled(folder: Path) -> Store:
    """Return a store in which one channel has ten million rows and another a tenth of that."""
    store = Store.open(f"sqlite:///{folder / 'station.sqlite3'}")

    def fill(session: Session) -> None:
        add_robot(session, robot_record())
        fill_samples(session, CHART_ROWS, _SMALL_ROWS)

    store.change(fill).result()
    return store


def fill_samples(session: Session, *sizes: int) -> None:
    """Give the first robot measurements at 1 Hz of as many channels as there are sizes."""
    begin_us = round(START.timestamp() * 1e6)
    session.execute(text("INSERT INTO sample_log (robot_key, log, received_at) VALUES (1, 7, 0)"))
    for channel, rows in enumerate(sizes, start=1):
        name = CHANNELS[channel - 1]
        session.execute(text("INSERT INTO channel (name) VALUES (:name)"), {"name": name})
        numbers = {"channel": channel, "first": sum(sizes[: channel - 1]), "last": rows - 1}
        session.execute(text(_FILL), {"begin": begin_us, **numbers})
    for length_s in (FINE_S, COARSE_S):
        session.execute(text(_SUM_UP), {"length": length_s})


def _drawn_ms(store: Store, channel: str, rows: int) -> float:
    """Return the time of the quickest answer: what others do on the machine is not its."""
    times_ms: list[float] = []
    end = START + timedelta(seconds=rows)
    for _ in range(ASKED):
        before_s = time.perf_counter()
        with store.read() as session:
            found = history(session, "mini-1", channel, START, end)
        times_ms.append((time.perf_counter() - before_s) * 1e3)
        if not found.decimated:
            raise ValueError(f"the chart of {channel} shows {len(found.value)} values of {rows}")
    return min(times_ms)
