"""From the radio to the browsers: what a real station process costs, and how old its data is.

Needs most of a core for the station and most of another for the fleet and the browsers, which run
beside it; without a figure it says why.
"""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import websockets

from autonomy.site import TANK
from benchmarks.calibration import PYTHON, NotMeasuredError, calibrated, scaled_row
from db.query.robots import RobotRecord, add_robot
from db.store import Store
from robot_link.messages import RobotId, SystemId
from server.access.register import create_token
from server.access.role import Role
from server.base.settings import Settings

ROBOTS, RATE_HZ, CLIENTS = 20, 10.0, 20
SETTLE_S, MEASURE_S = 4.0, 10.0
CPU_BAR_PERCENT = 10.0
AGE_BAR_MS = 500.0
"""Both where the Python loop takes what ``calibration`` says of the reference machine."""
MEMORY_BAR_MB = 400.0
DELIVERED_SHARE = 0.75
START_LIMIT_S = 300.0


def measure() -> list[dict[str, Any]]:
    """Measure the busy fleet, then an idle station with two robots.

    Raises:
        NotMeasuredError: If the station does not start, or brings nothing to a browser.
    """
    with _station(ROBOTS, RATE_HZ) as station, calibrated(PYTHON) as calibration:
        cpu_percent, ages_ms, updates_s = asyncio.run(_watch_live(station))
    if not ages_ms:
        raise NotMeasuredError(f"no state reached the browser in {MEASURE_S:g} s")
    wanted_s = DELIVERED_SHARE * ROBOTS * RATE_HZ
    load = f"{ROBOTS} robots x {RATE_HZ:g} Hz to {CLIENTS} clients"
    with _station(2, 1.0) as station:
        time.sleep(SETTLE_S)
        memory_mb = station.memory_mb()
    age_ms = float(np.percentile(ages_ms, 95))
    cost, age = f"CPU of the station, {load}", "Age of data at the client, p95"
    return [
        scaled_row("telemetry", cost, cpu_percent, "%", CPU_BAR_PERCENT, calibration, by="median"),
        scaled_row("telemetry", age, age_ms, "ms", AGE_BAR_MS, calibration, by="wall"),
        _row("State updates that reach one client", updates_s, "1/s", wanted_s, at_least=True),
        _row("Memory of the idle station, two robots", memory_mb, "MB", MEMORY_BAR_MB),
    ]


class _Station:
    """A station process with its address and a token."""

    def __init__(self, process: subprocess.Popen[bytes], port: int, token: str) -> None:
        self.process = process
        self.url = f"127.0.0.1:{port}"
        self.token = token

    def cpu_s(self) -> float:
        """Return the processor time that the process has used."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(") ", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def memory_mb(self) -> float:
        """Return the resident memory of the process."""
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    def wait_until_ready(self) -> None:
        """Wait for the health page.

        Raises:
            NotMeasuredError: If the station ended, or is not ready in time.
        """
        limit_s = time.monotonic() + START_LIMIT_S
        while time.monotonic() < limit_s:
            if self.process.poll() is not None:
                raise NotMeasuredError(f"the station ended by itself ({self.process.returncode})")
            with suppress(httpx.TransportError):
                if httpx.get(f"http://{self.url}/api/health").json()["ready"]:
                    return
            time.sleep(0.1)
        raise NotMeasuredError(f"the station was not ready in {START_LIMIT_S:g} s")


@contextmanager
def _station(robots: int, rate_hz: float) -> Iterator[_Station]:
    fleet = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.telemetry_fleet", str(robots), str(rate_hz)],
        stdout=subprocess.PIPE,
        text=True,
    )
    with tempfile.TemporaryDirectory() as folder, _ended(fleet):
        assert fleet.stdout is not None  # noqa: S101 - a pipe was asked for
        token = _prepare(Path(folder), robots, int(fleet.stdout.readline()))
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        command = [sys.executable, "-m", "server.cli", "serve", "--data", folder]
        with (Path(folder) / "station.log").open("wb") as log:
            process = subprocess.Popen([*command, "--port", str(port)], stdout=log, stderr=log)
        with _ended(process):
            station = _Station(process, port, token)
            station.wait_until_ready()
            yield station


@contextmanager
def _ended(process: subprocess.Popen[Any]) -> Iterator[None]:
    try:
        yield
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _prepare(folder: Path, robots: int, radio_port: int) -> str:
    """Make the robots known to a fresh data folder and return a token."""
    at = datetime.now(UTC)
    store = Store.open(Settings(data_dir=folder).resolved_database_url)

    def write(session) -> str:
        for number in range(1, robots + 1):
            add_robot(
                session,
                RobotRecord(
                    id=RobotId(f"mini-{number}"),
                    name=f"mini-{number}",
                    model="miniglider",
                    kind="simulated",
                    system_id=SystemId(number),
                    links=(f"xbee://127.0.0.1:{radio_port}",),
                    site=TANK,
                    created_at=at,
                ),
            )
        issued = create_token(
            session, "benchmark", Role.VIEWER, timedelta(hours=1), at=at, by="benchmark"
        )
        return issued.secret

    try:
        return store.change(write).result()
    finally:
        store.close()


async def _watch_live(station: _Station) -> tuple[float, list[float], float]:
    """Return processor share in percent, ages in ms, and updates a second of one client."""
    uri = f"ws://{station.url}/api/live"
    headers = {"Authorization": f"Bearer {station.token}"}
    ages_ms: list[float] = []
    streams = [
        await websockets.connect(
            uri, additional_headers=headers, compression=None, open_timeout=120.0
        )
        for _ in range(CLIENTS)
    ]
    readers = [asyncio.create_task(_drain(stream)) for stream in streams[1:]]
    readers.append(asyncio.create_task(_note_ages(streams[0], ages_ms)))
    await asyncio.sleep(SETTLE_S)
    ages_ms.clear()
    cpu_s, began_s = station.cpu_s(), time.monotonic()
    await asyncio.sleep(MEASURE_S)
    elapsed_s = time.monotonic() - began_s
    percent = 100.0 * (station.cpu_s() - cpu_s) / elapsed_s
    noted = list(ages_ms)
    for reader in readers:
        reader.cancel()
    await asyncio.gather(*readers, return_exceptions=True)
    await asyncio.gather(*(stream.close() for stream in streams))
    return percent, noted, len(noted) / elapsed_s


async def _drain(stream: websockets.ClientConnection) -> None:
    async for _ in stream:
        pass


async def _note_ages(stream: websockets.ClientConnection, ages_ms: list[float]) -> None:
    async for text in stream:
        now = datetime.now(UTC)
        for robot in json.loads(text)["robots"].values():
            depth = robot["channels"].get("depth_m")
            if depth is not None:
                measured_at = datetime.fromisoformat(depth["measured_at"])
                ages_ms.append((now - measured_at).total_seconds() * 1e3)


def _row(
    name: str, value: float, unit: str, bar: float, *, at_least: bool = False
) -> dict[str, Any]:
    met = value >= bar if at_least else value <= bar
    return {
        "area": "telemetry",
        "name": name,
        "value": value,
        "unit": unit,
        "bar": bar,
        "met": met,
    }
