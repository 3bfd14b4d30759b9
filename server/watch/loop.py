"""How late the event loop is: everybody waits that long for anything."""

import asyncio
from collections import deque
from typing import Final

from prometheus_client import Histogram

from server.base.metric.metrics import Metrics

PERIOD_S: Final = 0.25
WORST_OF: Final = 240
"""Looks of which the worst counts: those of the last minute."""
BUCKETS_S: Final = (0.005, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)


class LoopWatch:
    """Measures by how much a sleeping task wakes too late."""

    def __init__(self, metrics: Metrics) -> None:
        self._lag: Histogram = metrics.histogram(
            "event_loop_lag_seconds", "How late the event loop wakes a task.", BUCKETS_S
        )
        self._newest_s: deque[float] = deque(maxlen=WORST_OF)

    @property
    def worst_s(self) -> float:
        """The largest delay of about the last minute, s."""
        return max(self._newest_s, default=0.0)

    async def run(self) -> None:
        """Measure until cancelled."""
        now_s = asyncio.get_running_loop().time
        while True:
            begun_s = now_s()
            await asyncio.sleep(PERIOD_S)
            lag_s = max(0.0, now_s() - begun_s - PERIOD_S)
            self._lag.observe(lag_s)
            self._newest_s.append(lag_s)
