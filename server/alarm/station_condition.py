"""How the station's own machine is: its disk, its processors, its clock, its database."""

import asyncio
import itertools
import os
import shutil
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from db.store import Store

PERIOD_S: Final = 5.0
"""Wall time between two looks; nothing tells of a full disk by itself."""
_CLOCK_WITHIN_S: Final = 600.0
_MB: Final = 1e6


@dataclass(frozen=True, slots=True)
class StationCondition:
    """What was found at one look; ``None`` where the machine does not tell."""

    disk_free_mb: float | None
    load_percent: float | None
    clock_step_s: float
    """Largest step of the wall clock against the time since boot, of the last ten minutes."""
    rows_waiting: float


class ConditionWatch:
    """Looks at the machine now and then. Belongs to one event loop; ``run`` is its task."""

    def __init__(
        self, folder: Path, store: Store, told: Callable[[StationCondition], object]
    ) -> None:
        self._folder = folder
        self._store = store
        self._told = told
        self._offsets: deque[tuple[float, float]] = deque()

    async def run(self) -> None:
        """Tell the condition every few seconds until cancelled."""
        while True:
            disk_free_mb = await asyncio.to_thread(_disk_free_mb, self._folder)
            rows = float(self._store.waiting_rows)
            step_s = self.clock_step_s(time.time(), time.monotonic())
            self._told(StationCondition(disk_free_mb, _load_percent(), step_s, rows))
            await asyncio.sleep(PERIOD_S)

    def clock_step_s(self, wall_s: float, since_boot_s: float) -> float:
        """Return how far the wall clock was set lately; slow steering of it is no step."""
        offset_s = wall_s - since_boot_s
        self._offsets.append((since_boot_s, offset_s))
        while self._offsets[0][0] < since_boot_s - _CLOCK_WITHIN_S:
            self._offsets.popleft()
        offsets_s = [one for _, one in self._offsets]
        steps_s = (abs(after - before) for before, after in itertools.pairwise(offsets_s))
        return max(steps_s, default=0.0)


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
