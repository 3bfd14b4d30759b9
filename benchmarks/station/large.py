"""A station with a fleet's two months behind it: start, every page's requests, the 3D view, memory.

A real station process on a database that ``benchmarks.station.past`` laid out, on each engine that
the machine has. ``make bench`` takes a million rows; ``python -m benchmarks.station.large --rows
100000000`` takes as many as a fleet of twenty makes in two months, and ten to fifteen gigabytes.
"""

import argparse
import json
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import numpy as np
import viser
import zstandard
from rich.console import Console
from websockets import Subprotocol
from websockets.sync.client import connect

from benchmarks.calibration import PYTHON, calibrated, scaled_row
from benchmarks.run import table
from benchmarks.station.past import ROBOTS, SPAN, lay_out
from benchmarks.station.station_process import StationProcess, served
from db.store import Store
from server.access.register import create_token
from server.access.role import Role
from server.base.settings import Settings
from tests.postgresql_server import postgresql_server

ROWS, ASKED = 1_000_000, 3
START_BAR_S, PAGE_BAR_MS, SCENE_BAR_MS, MEMORY_BAR_MB = 5.0, 300.0, 1000.0, 500.0
"""Times where the Python loop takes what ``calibration`` says of the reference machine."""
SETTLED_S = 120.0
_TRACK = b"/world/track/"
"""Begin of the names of the nodes that are the track."""
_ENGINES = ("sqlite", "postgresql")
_STATION = (
    *("health", "session", "channels", "automation", "robots", "leases", "base-maps", "config"),
    *("alarms?state=open", "alarms", "alarm-rules", "waters", "vehicles", "design-templates"),
    *("deployments", "deployments?limit=20", "jobs", "events?limit=100", "events/actors"),
    *("events?limit=100&by_anybody=true", "events?limit=100&text=surfaced", "logbook?limit=120"),
    *("logbook?group=dives&group=alarms&limit=120", "logbook?text=board&limit=120"),
    *("logbook/words", "logbook/handover", "logbook/shifts", "logbook/pages", "notices"),
    *("journal?limit=100", "cameras", "camera-rig", "tags", "gateways", "signing"),
    *("config/planner/schema", "checklist-templates", "checklist-checks"),
)
_OF_ROBOT = (
    *("", "/state", "/channels", "/contact", "/prediction", "/predictions?limit=20", "/battery"),
    *("/suggestion", "/schedule", "/checklists", "/links", "/plans?state=done", "/plans?limit=20"),
    *("/designs?archived=false", "/maps", "/maps/choices", "/missions", "/whatifs"),
    *("/identifications", "/parameters", "/tags", "/detections?limit=100", "/logs", "/decisions"),
    *("/commands?limit=50", "/satellite", "/current", "/tracking", "/ranges", "/view", "/lease"),
    *("/films", "/fixes"),
)
_OF_STATION = ("events?limit=100&robot={robot}", "logbook?robot={robot}&limit=120")
_OF_STATION += ("journal?robot={robot}&limit=100", "deployments?robot={robot}")
_WINDOWS = {"a quarter of an hour": 900, "a day": 86_400, "a week": 604_800, "all": 0}
_CHANNELS = ("depth_m", "pitch_rad", "speed_m_s", "battery_fraction", "temperature")
_CHANNELS += ("internal_pressure",)
_OF_DEPLOYMENT = ("", "/series", "/quality", "/files", "/delivery", "/water")


@dataclass(frozen=True, slots=True)
class Large:
    """A laid out past, ready to be served."""

    folder: Path
    url: str
    token: str
    ends_at: datetime


def measure() -> list[dict[str, Any]]:
    return [row for engine in _ENGINES for row in measured(engine, ROWS)]


def measured(engine: str, rows: int, laid_out: Path | None = None) -> list[dict[str, Any]]:
    """Measure one engine; no rows where the machine does not have it."""
    with _laid_out(engine, rows, laid_out) as large:
        if large is None:
            return []
        with calibrated(PYTHON) as begun:
            start_s = _start_s(large)
        with served(large.folder, large.token) as station:
            idle_mb = _settled(station)
            with calibrated(PYTHON) as asked:
                took_ms = _asked(station, large)
                scene_ms = _scene_ms(station)
            memory_mb = station.memory_mb()
    what = f"{engine}, {rows:,} rows"
    every = np.concatenate([np.array(each) for each in took_ms.values()])
    slowest = {path: max(each) for path, each in took_ms.items()}
    rows_of = [scaled_row("large", f"{what}: start", start_s, "s", START_BAR_S, begun, by="wall")]
    for share in (50, 95):
        named = f"{what}: requests of the pages, p{share} of {len(every)}"
        value = float(np.percentile(every, share))
        rows_of.append(scaled_row("large", named, value, "ms", PAGE_BAR_MS, asked, by="wall"))
    for path in sorted(slowest, key=slowest.__getitem__, reverse=True)[:10]:
        named = f"{what}: {path}, slowest"
        rows_of.append(_plain(named, slowest[path], "ms"))
    joined = f"{what}: joining the 3D view until the track is there"
    rows_of.append(scaled_row("large", joined, scene_ms, "ms", SCENE_BAR_MS, asked, by="wall"))
    rows_of.append(_plain(f"{what}: memory when idle", idle_mb, "MB", MEMORY_BAR_MB))
    rows_of.append(_plain(f"{what}: memory after all", memory_mb, "MB", MEMORY_BAR_MB))
    return rows_of


def _plain(name: str, value: float, unit: str, bar: float | None = None) -> dict[str, Any]:
    met = None if bar is None else value <= bar
    return {"area": "large", "name": name, "value": value, "unit": unit, "bar": bar, "met": met}


@contextmanager
def _laid_out(engine: str, rows: int, laid_out: Path | None) -> Iterator[Large | None]:
    """Lay out a past, or take up a data folder that has one, and make a token of an admin."""
    with tempfile.TemporaryDirectory() as name:
        folder = laid_out if laid_out and engine == "sqlite" else Path(name)
        yield from _filled(engine, rows, folder)


def _filled(engine: str, rows: int, folder: Path) -> Iterator[Large | None]:
    folder.mkdir(parents=True, exist_ok=True)
    with _database(engine, folder) as url:
        if url is None:
            yield None
            return
        note = folder / "past.json"
        if not note.exists():
            ends_at = datetime.now(UTC) - timedelta(minutes=1)
            lay_out(url, rows, ends_at)
            note.write_text(json.dumps(ends_at.isoformat()))
        with closing(Store.open(url)) as store:
            token = store.change(_token).result()
        yield Large(folder, url, token, datetime.fromisoformat(json.loads(note.read_text())))


def _token(session: Any) -> str:
    at, day = datetime.now(UTC), timedelta(days=1)
    return create_token(session, "large", Role.ADMIN, day, at=at, by="large").secret


@contextmanager
def _database(engine: str, folder: Path) -> Iterator[str | None]:
    """Give the URL of a database of an engine, and let the station of this process find it."""
    if engine == "sqlite":
        yield Settings(data_dir=folder).resolved_database_url
        return
    with postgresql_server() as server:
        if server is None:
            yield None
            return
        url = server.url(server.database())
        os.environ["GRACE_DATABASE_URL"] = url
        try:
            yield url
        finally:
            del os.environ["GRACE_DATABASE_URL"]


def _start_s(large: Large) -> float:
    """Return how long a station takes from being called to being ready."""
    began_s = time.perf_counter()
    with served(large.folder, large.token):
        return time.perf_counter() - began_s


def _settled(station: StationProcess) -> float:
    """Wait until a station has caught up with its past; return its memory, MB."""
    end_s, before_s = time.monotonic() + SETTLED_S, station.cpu_s()
    while time.monotonic() < end_s:
        time.sleep(5.0)
        used_s = station.cpu_s() - before_s
        if used_s < 0.25:
            break
        before_s += used_s
    return station.memory_mb()


def _asked(station: StationProcess, large: Large) -> dict[str, list[float]]:
    """Ask what the pages ask; return the times of each request, ms."""
    took: dict[str, list[float]] = {}
    for _ in range(ASKED):
        for path in _paths(station, large):
            before_s = time.perf_counter()
            try:
                station.get(path)
            except httpx.HTTPStatusError as error:
                if error.response.status_code >= 500:
                    raise
                continue
            took.setdefault(path, []).append((time.perf_counter() - before_s) * 1e3)
    return took


def _paths(station: StationProcess, large: Large) -> Iterator[str]:
    yield from (f"/api/{path}" for path in _STATION)
    for number in (1, 2, ROBOTS):
        robot = f"grace-{number}"
        yield from (f"/api/{path.format(robot=robot)}" for path in _OF_STATION)
        yield from (f"/api/robots/{robot}{path}" for path in _OF_ROBOT)
        for span_s in _WINDOWS.values():
            span = timedelta(seconds=span_s) if span_s else SPAN
            start = quote((large.ends_at - span).isoformat())
            for channel in _CHANNELS:
                yield f"/api/robots/{robot}/samples?channel={channel}&start={start}&max_points=2000"
            yield f"/api/robots/{robot}/track?start={start}&max_points=4000"
            at = quote((large.ends_at - span / 2).isoformat())
            yield f"/api/robots/{robot}/moment?at={at}"
            yield f"/api/robots/{robot}/timeline?at={at}"
        for deployment in station.get(f"/api/deployments?robot={robot}").json()["deployments"][:2]:
            yield from (f"/api/deployments/{deployment['id']}{path}" for path in _OF_DEPLOYMENT)


def _scene_ms(station: StationProcess) -> float:
    """Return how long the 3D view of the robot of two months takes until its track is sent."""
    robot = "grace-1"
    before_s = time.perf_counter()
    station.get(f"/view/{robot}/")
    headers = {"Authorization": f"Bearer {station.token}"}
    spoken = [Subprotocol(f"viser-v{viser.__version__}")]
    url = f"ws://{station.url}/view/{robot}"
    with connect(url, additional_headers=headers, subprotocols=spoken, max_size=None) as socket:
        while _TRACK not in _said(bytes(socket.recv(timeout=60, decode=False))):
            pass
    return (time.perf_counter() - before_s) * 1e3


def _said(frame: bytes) -> bytes:
    """Return the messages of a frame of viser: their length, its own when packed, zstd, arrays."""
    length = int.from_bytes(frame[8:16], "little")
    return zstandard.ZstdDecompressor().decompress(frame[16 : 16 + length])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=ROWS)
    parser.add_argument("--engine", choices=_ENGINES, action="append")
    parser.add_argument("--folder", type=Path, help="keep the SQLite file here, or take it up")
    arguments = parser.parse_args()
    rows = [
        row
        for engine in arguments.engine or _ENGINES
        for row in measured(engine, arguments.rows, arguments.folder)
    ]
    Console().print(table(rows))


if __name__ == "__main__":
    main()
