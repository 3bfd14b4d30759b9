"""Where the depth sensor's zero is: what it reads at the surface is taken off every reading."""

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from onboard.flight.hardware import Readings

OFFSET_MAX_M: Final = 0.5
"""A sensor that reads more at the surface is broken, or not at the surface."""
ABOVE_MAX_M: Final = 0.05
"""A robot is never above the surface; noise may say so by this much."""
STEADY_M: Final = 0.05
"""Readings that spread more than this belong to a robot that moves up or down."""
_READINGS: Final = 10
"""One second of them, of which the mean is taken."""
_KEY: Final = "offset_m"


def _forget(_: dict[str, float]) -> None:
    """Keep nothing while the robot is switched off."""


class DepthZero:
    """Takes the present reading as the surface when it is told to, if it can be that."""

    def __init__(self) -> None:
        self._raw: deque[float] = deque(maxlen=_READINGS)
        self._offset_m: float | None = None
        self._save: Callable[[dict[str, float]], None] = _forget

    @property
    def offset_m(self) -> float | None:
        """What the sensor reads at the surface; None before it was ever zeroed."""
        return self._offset_m

    def restore(self, kept: Mapping[str, float], save: Callable[[dict[str, float]], None]) -> None:
        """Go on with what was kept while the robot was switched off.

        Args:
            kept: What was saved.
            save: Called with what is to be kept from now on.
        """
        offset_m = kept.get(_KEY, math.nan)
        if -ABOVE_MAX_M <= offset_m <= OFFSET_MAX_M:
            self._offset_m = offset_m
        self._save = save

    def corrected(self, readings: Readings) -> Readings:
        """Return readings with the depth below the zero, and remember what the sensor said."""
        self._raw.append(readings.depth_m)
        if self._offset_m is None:
            return readings
        return replace(readings, depth_m=readings.depth_m - self._offset_m)

    @property
    def is_steady(self) -> bool:
        """Whether the sensor said about the same for a second."""
        return len(self._raw) == _READINGS and max(self._raw) - min(self._raw) <= STEADY_M

    def take(self) -> bool:
        """Take the mean of the last second as the surface; tell whether it can be that.

        A reading above the surface, or too far below it, is refused: the sensor is broken, or the
        robot is under water.
        """
        offset_m = sum(self._raw) / len(self._raw)
        if not -ABOVE_MAX_M <= offset_m <= OFFSET_MAX_M:
            return False
        self._offset_m = offset_m
        self._save({_KEY: offset_m})
        return True
