"""Parts of a robot's life of which the battery tells what they took, cut from its words."""

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.energy_use import Use
from db.query.measured.battery import BatteryReading
from robot_link.messages import RobotMode

_USES = {
    RobotMode.GLIDING: Use.GLIDE,
    RobotMode.SPIRALLING: Use.SPIRAL,
    RobotMode.DIVING: Use.DIVE,
    RobotMode.ABORTING: Use.DIVE,
    RobotMode.SWIMMING: Use.SWIM,
    RobotMode.TURNING: Use.SWIM,
    RobotMode.TRACKING: Use.SWIM,
    RobotMode.SEARCHING: Use.SWIM,
}
_FINE, _COARSE = 1e-4, 1.0 / 255.0
"""Steps in which the charge travels: by radio, and by satellite."""
_RISE = 0.003
"""A charge that rose by more was charged, or is another battery's."""
_SILENCE_S = 60.0
"""Between two words that are farther apart the robot may have done more than it says."""
_LEAST_STEPS = 10.0
"""An interval goes on until the charge has fallen by so many steps."""
_SHORTEST_H, _LONGEST_H = 0.15, 6.0
_S_PER_H = 3600.0

FlownHours = Callable[[datetime, datetime], FloatArray | None]
"""Hours of each use between two words, by the plan flown then; ``None`` where there was none."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnInterval:
    """What a time took."""

    started_at: datetime
    ended_at: datetime
    hours: FloatArray
    """In each use, shape ``(5,)``."""
    fraction: float
    """Of the full battery."""
    reading_std: float
    """What reading the charge twice adds, as part of the full battery."""


def use_of(mode: RobotMode) -> Use:
    """Return what a robot that does this uses its battery for."""
    return _USES.get(mode, Use.AFLOAT)


@dataclass(slots=True)
class IntervalCutter:
    """Cuts what a robot says, word by word, into intervals. Its clock is the robot's."""

    first: BatteryReading | None = None
    last: BatteryReading | None = None
    hours: FloatArray = field(default_factory=lambda: np.zeros(len(Use)))

    def take(self, word: BatteryReading, flown: FlownHours) -> DrawnInterval | None:
        """Take the next word, and return the interval that it ends, if it ends one."""
        first, last, self.last = self.first, self.last, word
        if not 0.0 <= word.fraction <= 1.0:
            self.last = last
            return None
        if first is None or last is None or word.fraction > last.fraction + _RISE:
            return self._begin(word)
        gone = _passed(last, word, flown)
        if gone is None:
            return self._begin(word)
        self.hours = self.hours + gone
        steps = np.hypot(_step(first.fraction), _step(word.fraction))
        drop, total_h = first.fraction - word.fraction, float(self.hours.sum())
        is_other = use_of(last.mode) is not use_of(word.mode)
        is_told = drop >= _LEAST_STEPS * steps and total_h >= _SHORTEST_H
        if not ((is_told and (is_other or total_h >= 1.0)) or total_h >= _LONGEST_H):
            return None
        found = DrawnInterval(
            first.measured_at, word.measured_at, self.hours, drop, float(steps) / np.sqrt(12.0)
        )
        self._begin(word)
        return found

    def _begin(self, word: BatteryReading) -> None:
        self.first, self.hours = word, np.zeros(len(Use))


def _step(fraction: float) -> float:
    is_fine = abs(fraction / _COARSE - round(fraction / _COARSE)) > 1e-6
    return _FINE if is_fine else _COARSE


def _passed(last: BatteryReading, word: BatteryReading, flown: FlownHours) -> FloatArray | None:
    passed_s = (word.measured_at - last.measured_at).total_seconds()
    hours = np.zeros(len(Use))
    if passed_s <= _SILENCE_S:
        hours[use_of(last.mode)] = passed_s / _S_PER_H
        return hours
    by_plan = flown(last.measured_at, word.measured_at)
    if by_plan is not None:
        return by_plan
    stayed = last.mode is word.mode and use_of(word.mode) is Use.AFLOAT
    if not stayed:
        return None
    hours[Use.AFLOAT] = passed_s / _S_PER_H
    return hours
