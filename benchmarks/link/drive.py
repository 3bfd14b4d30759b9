"""Driving by hand over the emulated XBee: from a pilot's stick to the tail, and from silence.

A station process and a simulator process, as in use; the pilot is a WebSocket here. All three read
the same monotonic clock. A stick is late by the time from its sending by the pilot to the first set
point of the tail on board that obeys it; a silence counts from the last stick's sending.
"""

import asyncio
import json
import random
import subprocess
import sys
import tempfile
import threading
from collections.abc import AsyncGenerator, Generator
from contextlib import asynccontextmanager, contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import websockets

from autonomy.site import TANK
from benchmarks.calibration import NotMeasuredError
from benchmarks.link.drive_witness import settings
from benchmarks.station.station_process import ended, served
from db.query.fleet.robots import RobotRecord, add_robot
from db.store import Store
from robot_link.clock import monotonic_s
from server.access.register import create_token
from server.access.role import Role
from server.base.settings import Settings
from simulator.fleet import MINI_1

STICKS = 300
SILENCES = 20
LATE_BAR_MS, SILENCE_BAR_MS = 150.0, 700.0
PERIOD_S = 0.066
"""Between two sticks, as the page sends them."""
_FULL_BIAS_RAD = 1.35
_LIMIT_S = 60.0


class Tail:
    """Every set point of the tail that the simulator wrote down: time, amplitude, mean angle."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.rows: list[tuple[float, float, float]] = []
        self._process = process
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in self._process.stdout or ():
            time_s, amplitude, angle = map(float, line.split())
            self.rows.append((time_s, amplitude, angle))

    def first_s(self, since_s: float, turn: float) -> float | None:
        """Return when the tail was first told a turn since then, None if it was not."""
        for time_s, amplitude, angle in self.rows:
            if time_s < since_s or (turn == 0.0) != (amplitude == 0.0):
                continue
            if abs(angle + _FULL_BIAS_RAD * turn) < 5e-4 * _FULL_BIAS_RAD:
                return time_s
        return None


def measure() -> list[dict[str, Any]]:
    """Drive a robot in the tank, and fall silent now and then.

    Both bars are of a person's time, and most of both is waiting, so no machine is allowed more.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with _witness(folder) as tail, served(folder, _prepared(folder)) as station:
            late_ms, silence_ms = asyncio.run(_drive(station.url, station.token, tail))
    what = "Stick of the pilot to set point of the tail, emulated XBee"
    return [
        _row(f"{what}, p50", float(np.percentile(late_ms, 50)), None),
        _row(f"{what}, p95 of {STICKS}", float(np.percentile(late_ms, 95)), LATE_BAR_MS),
        _row(
            f"Silence of the pilot to a tail at rest, longest of {SILENCES}",
            max(silence_ms),
            SILENCE_BAR_MS,
        ),
    ]


def _row(name: str, value_ms: float, bar_ms: float | None) -> dict[str, Any]:
    met = None if bar_ms is None else value_ms <= bar_ms
    return {
        "area": "drive", "name": name, "value": value_ms, "unit": "ms", "bar": bar_ms, "met": met
    }  # fmt: skip


@contextmanager
def _witness(folder: Path) -> Generator[Tail]:
    command = [sys.executable, "-m", "benchmarks.link.drive_witness", str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    with ended(process):
        yield Tail(process)


def _prepared(folder: Path) -> str:
    """Make a data folder with the robot; return a pilot's token."""
    uri = f"xbee://{settings(folder).link_path(MINI_1.robot)}"
    now = datetime.now(UTC)
    record = RobotRecord(
        id=MINI_1.robot,
        name=MINI_1.robot,
        model="miniglider",
        kind="simulated",
        system_id=MINI_1.system_id,
        links=(uri,),
        site=TANK,
        created_at=now,
    )

    def fill(session: Any) -> str:
        add_robot(session, record)
        hour = timedelta(hours=1)
        return create_token(session, "pilot", Role.PILOT, hour, at=now, by="benchmark").secret

    store = Store.open(Settings(data_dir=folder).resolved_database_url)
    try:
        return store.change(fill).result()
    finally:
        store.close()


async def _drive(url: str, token: str, tail: Tail) -> tuple[list[float], list[float]]:
    """Return how late each stick and each silence came to the tail, ms."""
    chance = random.Random(15)
    async with asyncio.timeout(20 * _LIMIT_S), _begun(url, token) as socket:
        talk = asyncio.create_task(_ignore(socket))
        pilot = Pilot(socket)
        late_ms = [await _late_ms(pilot, tail, n, chance) for n in range(STICKS)]
        silence_ms = [await _silence_ms(pilot, tail, n, chance) for n in range(SILENCES)]
        talk.cancel()
    return late_ms, silence_ms


@asynccontextmanager
async def _begun(url: str, token: str) -> AsyncGenerator[Any]:
    """Begin to drive as soon as the robot lets itself be driven."""
    uri = f"ws://{url}/api/robots/{MINI_1.robot}/drive"
    header = {"Authorization": f"Bearer {token}"}
    give_up_s, reason = monotonic_s() + _LIMIT_S, ""
    while monotonic_s() < give_up_s:
        async with websockets.connect(uri, additional_headers=header) as socket:
            while (told := json.loads(await socket.recv()))["state"] == "beginning":
                pass
            if told["state"] == "driving":
                yield socket
                return
            reason = told["reason"]
        await asyncio.sleep(0.2)
    raise NotMeasuredError(f"nobody could drive: {reason}")


async def _ignore(socket: Any) -> None:
    async for _ in socket:
        pass


class Pilot:
    """Sends sticks as the page does."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._n = 0

    async def say(self, turn: float) -> float:
        """Send a stick; return when."""
        self._n += 1
        at_s = monotonic_s()
        await self._socket.send(json.dumps({"n": self._n, "turn": turn}))
        return at_s

    async def hold(self, turn: float, for_s: float) -> float:
        """Send a stick again and again; return when the last one was sent."""
        ends_s = monotonic_s() + for_s
        last_s = monotonic_s()
        while (left_s := ends_s - monotonic_s()) > 0.0:
            await asyncio.sleep(min(PERIOD_S, left_s))
            last_s = await self.say(turn)
        return last_s


def _turn(number: int) -> float:
    """A turn that names a stick: none of the last few hundred was the same."""
    return (100 + number % 400) / 1000.0


async def _late_ms(pilot: Pilot, tail: Tail, number: int, chance: random.Random) -> float:
    """Hold another stick for a while; return how late the tail obeyed its first word."""
    turn = _turn(number)
    began_s = await pilot.say(turn)
    await pilot.hold(turn, chance.uniform(0.2, 0.4))
    while (seen_s := tail.first_s(began_s, turn)) is None:
        await pilot.hold(turn, PERIOD_S)
    return 1e3 * (seen_s - began_s)


async def _silence_ms(pilot: Pilot, tail: Tail, number: int, chance: random.Random) -> float:
    """Fall silent; return how long the tail beat after the last word."""
    last_s = await pilot.hold(_turn(number), chance.uniform(0.5, 0.8))
    # the witness is read by a thread
    while (seen_s := tail.first_s(last_s, 0.0)) is None:  # noqa: ASYNC110
        await asyncio.sleep(0.02)
    return 1e3 * (seen_s - last_s)
