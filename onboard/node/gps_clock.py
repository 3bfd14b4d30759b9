"""The clock node: a GPS receiver whose pulse per second catches the robot's counter.

Topic ``pulse``: ``{"utc": full second, "count_s": what the counter was caught at}``, while the
antenna sees the sky; under water there is none. Question ``fix``: ``{"has_sky", "count_s"}``.
"""

import asyncio
import logging
import math
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

from onboard.clock import OnboardClock, Oscillator
from onboard.node.client import NodeClient
from onboard.node.server import NodeServer
from onboard.node.wire import Content
from robot_link.clock import Clock

PULSE = "pulse"
_STEP_TOLD_S = 1.0
"""A step that moves time stamps by more is told; drift under water is far below."""
_WALL_GAP_MIN_S = 0.05
"""Pulses of a robot that lives fast are left out rather than sent closer together."""

_log = logging.getLogger(__name__)


class GpsClockNode:
    """Catches the counter at full seconds and publishes what it showed.

    Args:
        oscillator: The robot's counter.
        truth: The time of GPS.
        started_at: True time at which the counter showed 0.
        has_sky: Whether the antenna sees the sky now.
    """

    def __init__(
        self,
        oscillator: Oscillator,
        truth: Clock,
        started_at: datetime,
        has_sky: Callable[[], bool],
    ) -> None:
        self._oscillator = oscillator
        self._truth = truth
        self._started_at = started_at
        self._has_sky = has_sky
        self.server = NodeServer("gps_clock", {"fix": self._fix}, (PULSE,))

    async def run(self) -> None:
        """Pulse until cancelled."""
        while True:
            gap = timedelta(seconds=_WALL_GAP_MIN_S * self._truth.speed)
            earliest = self._truth.now() + gap
            second = datetime.fromtimestamp(math.ceil(earliest.timestamp()), UTC)
            await asyncio.sleep((second - self._truth.now()).total_seconds() / self._truth.speed)
            if self._has_sky():
                elapsed_s = (second - self._started_at).total_seconds()
                count_s = self._oscillator.captured_s(elapsed_s)
                self.server.publish(PULSE, {"utc": second.isoformat(), "count_s": count_s})

    async def _fix(self, _values: dict[str, Any]) -> Content:
        elapsed_s = (self._truth.now() - self._started_at).total_seconds()
        return {"has_sky": self._has_sky(), "count_s": self._oscillator.count_s(elapsed_s)}


async def discipline(clock: OnboardClock, node: NodeClient) -> None:
    """Set a clock by every pulse of the node, until cancelled."""
    async for pulse in node.subscribe(PULSE):
        clock.take_pulse(datetime.fromisoformat(pulse["utc"]), pulse["count_s"])
        step_s = clock.last_step_s or 0.0
        if abs(step_s) > _STEP_TOLD_S:
            _log.info("GPS set the clock by %+.1f s", step_s)
