"""How the station's own machine is: its disk, its processors, its clock, its database."""

import asyncio
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from db.store import Store
from server.watch.station_clock import StationClock

PERIOD_S: Final = 5.0
"""Wall time between two looks; nothing tells of a full disk by itself."""
_MB: Final = 1e6


@dataclass(frozen=True, slots=True)
class StationCondition:
    """What was found at one look; ``None`` where the machine does not tell."""

    disk_free_mb: float | None
    load_percent: float | None
    clock_step_s: float
    """Largest jump of the wall clock within the last ten minutes, either way."""
    rows_waiting: float


class ConditionWatch:
    """Looks at the machine now and then. Belongs to one event loop; ``run`` is its task."""

    def __init__(
        self,
        folder: Path,
        store: Store,
        clock: StationClock,
        told: Callable[[StationCondition], object],
    ) -> None:
        self._folder = folder
        self._store = store
        self._clock = clock
        self._told = told

    async def run(self) -> None:
        """Tell the condition every few seconds until cancelled."""
        while True:
            disk_free_mb = await asyncio.to_thread(_disk_free_mb, self._folder)
            rows, step_s = float(self._store.waiting_rows), self._clock.jump_lately_s
            self._told(StationCondition(disk_free_mb, _load_percent(), step_s, rows))
            await asyncio.sleep(PERIOD_S)


def _disk_free_mb(folder: Path) -> float | None:
    try:
        return shutil.disk_usage(folder).free / _MB
    except OSError:
        return None


def _load_percent() -> float | None:
    try:
        return min(100.0, 100.0 * os.getloadavg()[0] / (os.cpu_count() or 1))
    except OSError:
        return None
