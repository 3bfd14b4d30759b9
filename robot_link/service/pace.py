"""Keeps what a robot sends on its own within what its radio carries."""

import asyncio
import math
from collections.abc import Callable

from robot_link.clock import monotonic_s

_BURST_S = 2.0
"""A radio that was silent for so long may be given this much of its rate at once."""


class Pace:
    """An allowance of bytes that grows with time and is spent by states and samples alike.

    Args:
        bytes_per_s: Returns the rate of the radio; infinite where it does not matter.
    """

    def __init__(self, bytes_per_s: Callable[[], float]) -> None:
        self._bytes_per_s = bytes_per_s
        self._left = math.inf
        self._at_s = monotonic_s()

    async def spend(self, octets: int) -> None:
        """Wait until so many bytes may be sent."""
        rate = self._bytes_per_s()
        if not 0.0 < rate < math.inf:
            return
        now_s = monotonic_s()
        earned = (now_s - self._at_s) * rate
        self._left = min(_BURST_S * rate, self._left + earned) - octets
        self._at_s = now_s
        if self._left < 0.0:
            await asyncio.sleep(-self._left / rate)
