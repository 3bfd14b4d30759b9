"""From the radio to the browsers: what a real station process costs, and how old its data is.

Needs most of a core for the station and most of another for the fleet and the browsers, which run
beside it; without a figure it says why.
"""

import asyncio
import json
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
import websockets

from autonomy.channel import OWN_WIRE_NUMBERS
from autonomy.site import TANK
from benchmarks.calibration import PYTHON, NotMeasuredError, calibrated, scaled_row
from benchmarks.station.station_process import StationProcess, ended, served, viewer_token
from benchmarks.station.telemetry_fleet import carried
from db.query.fleet.channels import ChannelRecord, save_channel
from db.query.fleet.robots import RobotRecord, add_robot
from db.store import Store
from robot_link.messages import RobotId, SystemId
from server.base.settings import Settings

ROBOTS, RATE_HZ, CLIENTS = 20, 10.0, 20
CHANNELS, CHANNELS_RATE_HZ = 30, 1.0
CHANNELS_CPU_BAR_PERCENT = 35.0
SETTLE_S, MEASURE_S = 4.0, 10.0
CPU_BAR_PERCENT = 10.0
AGE_BAR_MS = 500.0
"""Both where the Python loop takes what ``calibration`` says of the reference machine."""
MEMORY_BAR_MB = 400.0
DELIVERED_SHARE = 0.75


def measure() -> list[dict[str, Any]]:
    """Measure two busy fleets, of states and of many channels, then an idle station.

    Raises:
        NotMeasuredError: If the station does not start, or brings nothing to a browser.
    """
    with _station(ROBOTS, RATE_HZ) as station, calibrated(PYTHON) as calibration:
        cpu_percent, ages_ms, updates_s = asyncio.run(_watch_live(station, "depth_m"))
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
        *_many_channels(),
        _row("State updates that reach one client", updates_s, "1/s", wanted_s, at_least=True),
        _row("Memory of the idle station, two robots", memory_mb, "MB", MEMORY_BAR_MB),
    ]


def _many_channels() -> list[dict[str, Any]]:
    """Measure robots that carry many instruments."""
    with (
        _station(ROBOTS, CHANNELS_RATE_HZ, CHANNELS) as station,
        calibrated(PYTHON) as calibration,
    ):
        cpu_percent, ages_ms, updates_s = asyncio.run(_watch_live(station, "salinity"))
    age_ms = float(np.percentile(ages_ms, 95))
    load = f"{CHANNELS} channels x {CHANNELS_RATE_HZ:g} Hz of {ROBOTS} robots"
    cost, age = f"CPU of the station, {load}", f"Age of samples at the client, p95, {load}"
    bar = CHANNELS_CPU_BAR_PERCENT
    return [
        scaled_row("telemetry", cost, cpu_percent, "%", bar, calibration, by="median"),
        scaled_row("telemetry", age, age_ms, "ms", AGE_BAR_MS, calibration, by="wall"),
        _row(
            f"Values of one channel that reach one client, {load}",
            updates_s,
            "1/s",
            DELIVERED_SHARE * ROBOTS * CHANNELS_RATE_HZ,
            at_least=True,
        ),
    ]


@contextmanager
def _station(robots: int, rate_hz: float, channels: int = 0) -> Iterator[StationProcess]:
    fleet = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "benchmarks.station.telemetry_fleet",
            *map(str, (robots, rate_hz, channels)),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    with tempfile.TemporaryDirectory() as folder, ended(fleet):
        assert fleet.stdout is not None  # noqa: S101 - a pipe was asked for
        token = _prepare(Path(folder), robots, channels, int(fleet.stdout.readline()))
        with served(Path(folder), token) as station:
            yield station


def _prepare(folder: Path, robots: int, channels: int, radio_port: int) -> str:
    """Make robots and their own channels known to a fresh data folder and return a token."""
    at = datetime.now(UTC)
    store = Store.open(Settings(data_dir=folder).resolved_database_url)

    def write(session) -> str:
        for row in carried(channels).rows:
            if row.number in OWN_WIRE_NUMBERS:
                own = {"key": row.key, "title": row.key, "unit": row.unit}
                document = own | {"wire_number": row.number}
                save_channel(session, ChannelRecord(row.key, document, True, None, at, "benchmark"))
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
        return viewer_token(session)

    try:
        return store.change(write).result()
    finally:
        store.close()


async def _watch_live(station: StationProcess, channel: str) -> tuple[float, list[float], float]:
    """Return processor share in percent, ages of a channel in ms, and updates a second.

    Raises:
        NotMeasuredError: If no value reached the browser.
    """
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
    readers.append(asyncio.create_task(_note_ages(streams[0], channel, ages_ms)))
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
    if not noted:
        raise NotMeasuredError(f"no {channel} reached the browser in {MEASURE_S:g} s")
    return percent, noted, len(noted) / elapsed_s


async def _drain(stream: websockets.ClientConnection) -> None:
    async for _ in stream:
        pass


async def _note_ages(
    stream: websockets.ClientConnection, channel: str, ages_ms: list[float]
) -> None:
    """Note how old each value is when the client first hears of it."""
    newest: dict[str, str] = {}
    async for text in stream:
        now = datetime.now(UTC)
        for name, robot in json.loads(text)["robots"].items():
            told = robot["channels"].get(channel)
            if told is not None and newest.get(name) != told["measured_at"]:
                newest[name] = told["measured_at"]
                measured_at = datetime.fromisoformat(told["measured_at"])
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
