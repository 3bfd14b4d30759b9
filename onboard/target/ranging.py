"""Ranges to a target: heard from outside, or worked out on board to a target that is virtual."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.target_path import place

_LEAST_HORIZONTAL_M = 0.01
_MOST_WAITING = 64
"""Ranges that wait for one step; older ones are dropped."""


@dataclass(frozen=True, slots=True)
class HeardRange:
    """One range as it reached the program."""

    range_m: float
    """As it came, good or bad; who tracks decides."""
    age_s: float
    """How long ago it was measured, when it was heard."""


class VirtualTarget:
    """A target that the robot computes itself, and its ranges (thesis section 4.5).

    Args:
        config: Path of the target, period and noise of its ranges.
        generator: Source of the noise.
    """

    def __init__(self, config: TrackingConfig, generator: np.random.Generator) -> None:
        self._config = config
        self._generator = generator
        self._std_m = math.sqrt(config.ranging.variance_m2)
        self._next_s = 0.0

    def step(self, own_ne_m: tuple[float, float], t_s: float) -> tuple[HeardRange, ...]:
        """Return the range that is due now, if one is."""
        if t_s < self._next_s - 1e-9:
            return ()
        self._next_s = max(self._next_s + self._config.ranging.period_s, t_s)
        north, east = self.place_ne_m(t_s)
        range_m = math.hypot(own_ne_m[0] - north, own_ne_m[1] - east)
        noisy_m = range_m + self._std_m * float(self._generator.standard_normal())
        return (HeardRange(max(abs(noisy_m), _LEAST_HORIZONTAL_M), 0.0),)

    def place_ne_m(self, t_s: float) -> tuple[float, float]:
        """Return where the target is."""
        now = place(self._config.target, t_s)
        return now.north_m, now.east_m

    def velocity_ne_m_s(self, t_s: float) -> tuple[float, float]:
        """Return how it moves."""
        now = place(self._config.target, t_s)
        return now.north_m_s, now.east_m_s


class Hearing:
    """All ranges of one mission: those that come from outside, or those to its virtual target.

    Args:
        config: The mission.
        generator: Source of the noise of a virtual target's ranges.
    """

    def __init__(self, config: TrackingConfig, generator: np.random.Generator) -> None:
        is_virtual = config.target.kind == "virtual"
        self._config = config
        self._virtual = VirtualTarget(config, generator) if is_virtual else None
        self._waiting: list[HeardRange] = []
        self.time_s = 0.0
        """Time since the mission's pursuit began."""
        self.is_quiet = False
        """Whether nothing may be pinged; a virtual target falls silent as well."""

    @property
    def address(self) -> int | None:
        """Whom to ping; None for a virtual target."""
        return None if self._virtual else self._config.target.address

    @property
    def true_ne_m(self) -> tuple[float, float] | None:
        """Where a virtual target is now; None for a real one."""
        return self._virtual.place_ne_m(self.time_s) if self._virtual else None

    @property
    def known_velocity_ne_m_s(self) -> tuple[float, float] | None:
        """How the target moves, where the mission lets the robot know it."""
        if self._config.filter.target_velocity != "known":
            return None
        if self._virtual:
            return self._virtual.velocity_ne_m_s(self.time_s)
        return (0.0, 0.0) if self._config.target.kind == "beacon" else None

    def hear(self, range_m: float | None, age_s: float) -> None:
        """Note a slant range that is ``age_s`` old; None is a ping that nobody answered."""
        if range_m is not None and not self._virtual:
            self._waiting = [*self._waiting[1 - _MOST_WAITING :], HeardRange(range_m, age_s)]

    def forget(self) -> None:
        """Drop what was heard and not taken: it is old by the time that somebody listens again."""
        self._waiting = []

    def pass_time(self, dt_s: float) -> None:
        """Let time pass, and with it the target move."""
        self.time_s += dt_s

    def take(self, own_ne_m: tuple[float, float], depth_m: float) -> tuple[HeardRange, ...]:
        """Return what was heard since the last call, oldest first, taken into the horizontal.

        Args:
            own_ne_m: Where the robot is.
            depth_m: How deep.
        """
        if self._virtual:
            return () if self.is_quiet else self._virtual.step(own_ne_m, self.time_s)
        heard, self._waiting = self._waiting, []
        below_m = self._config.target.depth_m - depth_m
        heard.sort(key=lambda one: -one.age_s)
        return tuple(HeardRange(horizontal_range(one.range_m, below_m), one.age_s) for one in heard)


def horizontal_range(slant_m: float, depth_below_m: float) -> float:
    """Return the horizontal part of a slant range; a range that is none stays what it is.

    Noise may make a slant range shorter than the difference of depth: the target is then straight
    above or below.
    """
    if not (math.isfinite(slant_m) and slant_m > 0.0):
        return slant_m
    squared = slant_m * slant_m - depth_below_m * depth_below_m
    return max(math.sqrt(max(squared, 0.0)), min(slant_m, _LEAST_HORIZONTAL_M))
