"""What three cameras cost: processor seconds of drawing, seeing and finding, and a gauge's delay.

A real demo with two robots in the tank, in real time. Its cameras are calibrated by REST; then the
processor seconds of its processes are counted over a minute of the wall's time, and how late a
robot's depth comes out of the live stream. Then the cameras are removed from the station, so that
nobody draws, sees or finds anything, and the same is measured again.
"""

import asyncio
import json
import os
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import websockets

from tests.e2e.demo import Demo
from tests.e2e.test_cameras import NAMES, calibrate, is_fixed, newest_fix

ROBOTS = ("mini-1", "mini-2")
SECONDS, SETTLE_S = 60.0, 10.0
CORE_BAR, LATENCY_BAR_MS = 0.6, 50.0
GAUGE = "depth_m"
_TICKS_S = 1.0 / os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Minute:
    """What a minute took."""

    core: float
    """Of all processes of the demo, share of one core."""
    late_ms: list[float]
    """Of each value of a gauge, from its measurement to a client of the live stream."""
    fixes_hz: float
    """Of one robot, as they are stored."""


def measure() -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        return measured(Path(folder), is_calibrated=False)


def measured(folder: Path, *, is_calibrated: bool) -> list[dict[str, Any]]:
    with Demo(folder, "--cameras", "--robots", ",".join(ROBOTS)) as demo:
        demo.sign_in()
        if not is_calibrated:
            calibrate(demo)
        for robot in ROBOTS:
            demo.wait(f"{robot} fixed", partial(is_fixed, demo, robot), 90.0)
        seen = minute(demo)
        for name in NAMES:
            demo.client.delete(f"/api/cameras/{name}").raise_for_status()
        unseen = minute(demo)
    return list(rows(seen, unseen))


def minute(demo: Demo) -> Minute:
    time.sleep(SETTLE_S)
    before, fix, begun_s = cpu_s(demo), newest_fix(demo), time.monotonic()
    late_ms = asyncio.run(ages_ms(demo))
    elapsed_s = time.monotonic() - begun_s
    taken_s = sum(spent - before.get(pid, 0.0) for pid, spent in cpu_s(demo).items())
    query = {} if fix is None else {"start": fix["measured_at"]}
    fixes = demo.get(f"/api/robots/{ROBOTS[0]}/fixes", **query)["fixes"]
    return Minute(taken_s / elapsed_s, late_ms, max(len(fixes) - 1, 0) / elapsed_s)


def cpu_s(demo: Demo) -> dict[int, float]:
    """Return processor seconds of station, simulator and all processes below them, by id."""
    parents: dict[int, int] = {}
    spent: dict[int, float] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            except OSError:
                continue  # it has just ended
            parents[int(entry.name)] = int(words[1])
            spent[int(entry.name)] = _TICKS_S * (int(words[11]) + int(words[12]))
    ours = set(demo.children().values())
    while more := {pid for pid, parent in parents.items() if parent in ours} - ours:
        ours |= more
    return {pid: spent[pid] for pid in ours if pid in spent}


async def ages_ms(demo: Demo) -> list[float]:
    """Return how old each value of the gauge is when a client first hears of it."""
    uri = f"{demo.url.replace('http', 'ws', 1)}/api/live"
    cookies = "; ".join(f"{name}={value}" for name, value in demo.client.cookies.items())
    headers = {"Cookie": cookies, "Origin": demo.url}
    newest: dict[str, str] = {}
    ages: list[float] = []
    async with websockets.connect(uri, additional_headers=headers, compression=None) as stream:
        try:
            async with asyncio.timeout(SECONDS):
                async for text in stream:
                    now = datetime.now(UTC)
                    for name, robot in json.loads(text).get("robots", {}).items():
                        told = robot["channels"].get(GAUGE)
                        if told is None or newest.get(name) == told["measured_at"]:
                            continue
                        newest[name] = told["measured_at"]
                        at = datetime.fromisoformat(told["measured_at"])
                        ages.append(1e3 * (now - at).total_seconds())
        except TimeoutError:
            return ages
    return ages


def rows(seen: Minute, unseen: Minute) -> Iterator[dict[str, Any]]:
    yield row("Fixes of one of two robots, stored a second", seen.fixes_hz, "Hz")
    yield row("Demo without cameras", unseen.core, "cores")
    name = "Three cameras, two robots: drawing, seeing and finding take"
    yield row(name, seen.core - unseen.core, "cores", CORE_BAR)
    for percent in (50, 95):
        more = [float(np.percentile(one.late_ms, percent)) for one in (unseen, seen)]
        yield row(f"Gauge is late without cameras, p{percent}", more[0], "ms")
        yield row(f"Cameras make it later by, p{percent}", more[1] - more[0], "ms", LATENCY_BAR_MS)


def row(name: str, value: float, unit: str, bar: float | None = None) -> dict[str, Any]:
    return {
        "area": "camera_load",
        "name": name,
        "value": float(value),
        "unit": unit,
        "bar": bar,
        "met": None if bar is None else bool(value <= bar),
    }
