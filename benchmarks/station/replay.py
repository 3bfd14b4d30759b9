"""How soon a station answers a replay that jumps about in a long deployment.

A real station process on a prepared database, asked by REST over loopback for what the pages ask
when their cursor is put elsewhere: the moment, the last lines of the log, the 3D view of the tab,
and the windows of two charts in blocks.
"""

import asyncio
import random
import tempfile
import time
from collections.abc import Awaitable, Callable
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

import httpx
import numpy as np
from sqlalchemy.orm import Session

from benchmarks.calibration import PYTHON, calibrated, scaled_row
from benchmarks.station.delivery import fill_deployment
from benchmarks.station.samples import CHANNELS
from benchmarks.station.station_process import served, viewer_token
from db.query.fleet.deployment_change import end_deployment
from db.store import Store
from server.base.settings import Settings
from tests.db.conftest import START

ROWS, SEEKS, SEED = 1_000_000, 60, 1
SEEK_BAR_MS: Final = 300.0
"""For 95 of 100 jumps, where the Python loop takes what it takes on the reference machine."""
_WARMING: Final = 3
_ROBOT: Final = "/api/robots/mini-1"
_SPAN_S: Final = 3600
_POINTS: Final = 20_000
"""Span of a chart and most points of a block, as the page asks."""
_TAB: Final = "0" * 32


def measure() -> list[dict[str, Any]]:
    return measured(ROWS, SEEKS)


def measured(rows: int, seeks: int) -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        token, end = prepared(folder, rows)
        draw = random.Random(SEED)
        span_s = (end - START).total_seconds()
        moments = [START + timedelta(seconds=draw.uniform(0, span_s)) for _ in range(seeks)]
        with served(folder, token) as station, calibrated(PYTHON) as calibration:
            took_ms = asyncio.run(_asked(f"http://{station.url}", token, moments))
    return [
        scaled_row(
            "replay",
            f"{what} in {rows:,} rows, p95",
            float(np.percentile(each_ms, 95)),
            "ms",
            SEEK_BAR_MS,
            calibration,
            by="wall",
        )
        for what, each_ms in took_ms.items()
    ]


def prepared(folder: Path, rows: int) -> tuple[str, datetime]:
    """Fill a data folder with a deployment that is over; return a viewer's token and its end."""
    end = min(START + timedelta(seconds=rows), datetime.now(UTC) - timedelta(minutes=1))

    def fill(session: Session) -> str:
        fill_deployment(session, rows)
        end_deployment(session, "deployment-1", end)
        return viewer_token(session)

    with closing(Store.open(Settings(data_dir=folder).resolved_database_url)) as store:
        return store.change(fill).result(), end


async def _asked(url: str, token: str, moments: list[datetime]) -> dict[str, list[float]]:
    """Return what each jump took, ms: its state, its charts, and all that the pages ask."""
    took: dict[str, list[float]] = {}
    headers = {"Authorization": f"Bearer {token}"}
    async with httpx.AsyncClient(base_url=url, headers=headers, timeout=120) as client:
        for number, at in enumerate([moments[0]] * _WARMING + moments):
            parts: dict[str, Callable[[], Awaitable[object]]] = {
                "state at a moment": lambda at=at: _moment(client, at),
                "windows of two charts": lambda at=at: _windows(client, at),
                "all that a seek asks": lambda at=at: _seek(client, at),
            }
            for what, ask in parts.items():
                before_s = time.perf_counter()
                await ask()
                if number >= _WARMING:
                    took.setdefault(what, []).append((time.perf_counter() - before_s) * 1e3)
    return took


async def _moment(client: httpx.AsyncClient, at: datetime) -> None:
    await _get(client, "/moment", at=at.isoformat(), clock="measured")


async def _windows(client: httpx.AsyncClient, at: datetime) -> None:
    """Ask for the blocks that a window of an hour about a moment touches."""
    first = int((at.timestamp() - _SPAN_S / 2) // _SPAN_S)
    blocks = [
        _get(
            client,
            "/samples",
            channel=channel,
            start=datetime.fromtimestamp(number * _SPAN_S, UTC).isoformat(),
            end=datetime.fromtimestamp((number + 1) * _SPAN_S, UTC).isoformat(),
            max_points=str(_POINTS),
        )
        for channel in CHANNELS
        for number in (first, first + 1)
    ]
    await asyncio.gather(*blocks)


async def _seek(client: httpx.AsyncClient, at: datetime) -> None:
    """Ask for everything at once, as the pages do."""
    body = {"at": at.isoformat(), "clock": "measured"}
    log = {"robot": "mini-1", "to": at.isoformat(), "limit": "12"}
    answers = await asyncio.gather(
        client.put(f"{_ROBOT}/view/replay/{_TAB}", json=body),
        client.get("/api/logbook", params=log),
        _moment(client, at),
        _windows(client, at),
    )
    for answer in answers[:2]:
        answer.raise_for_status()


async def _get(client: httpx.AsyncClient, path: str, **query: str) -> None:
    (await client.get(f"{_ROBOT}{path}", params=query)).raise_for_status()
