"""The robot's clock: a counter that runs a little wrong, set by the pulses of a GPS receiver."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np


@dataclass(frozen=True, slots=True)
class ClockModel:
    """How wrong a robot's counter and its captures of GPS pulses are."""

    rate_std_ppm: float
    """Standard deviation of the counter's constant rate error, parts per million."""
    pulse_std_s: float = 1e-6
    """Noise of one captured pulse."""


class Oscillator:
    """Counts the seconds since the robot was switched on, at a rate that is never exact.

    Args:
        model: How wrong it is.
        generator: Source of randomness.
    """

    def __init__(self, model: ClockModel, generator: np.random.Generator) -> None:
        self.rate_error = 1e-6 * model.rate_std_ppm * float(generator.standard_normal())
        """Seconds that it counts too many in each second."""
        self._pulse_std_s = model.pulse_std_s
        self._generator = generator

    def count_s(self, true_s: float) -> float:
        """Return what the counter shows this many true seconds after switching on."""
        return true_s * (1.0 + self.rate_error)

    def captured_s(self, true_s: float) -> float:
        """Return what the counter is caught at by a pulse at this true time."""
        return self.count_s(true_s) + self._pulse_std_s * float(self._generator.standard_normal())


class OnboardClock:
    """Tells the time by the counter, from the last pulse on; under water it drifts with it.

    A pulse sets the clock at once, by a step: the robot that comes up after a long dive is right
    from the first pulse on.

    Args:
        at: The time, as well as it is known.
        count_s: What the counter shows at that time.
    """

    def __init__(self, at: datetime, count_s: float = 0.0) -> None:
        self._at = at
        self._count_s = count_s
        self.last_step_s: float | None = None
        """By how much the last pulse set the clock, positive forward; None before the first."""

    def at(self, count_s: float) -> datetime:
        """Return the time at a count of the counter."""
        return self._at + timedelta(seconds=count_s - self._count_s)

    def take_pulse(self, utc: datetime, count_s: float) -> None:
        """Set the clock by a pulse.

        Args:
            utc: The full second that the pulse marks.
            count_s: What the counter was caught at by the pulse.
        """
        self.last_step_s = (utc - self.at(count_s)).total_seconds()
        self._at, self._count_s = utc, count_s


class RunningClock:
    """An onboard clock as a ``Clock``: for what asks for the time whenever it likes.

    Args:
        onboard: What the counts mean.
        count_s: The counter now.
        speed: Seconds of the robot per second of the wall.
    """

    def __init__(self, onboard: OnboardClock, count_s: Callable[[], float], speed: float) -> None:
        self._onboard = onboard
        self._count_s = count_s
        self._speed = speed

    @property
    def speed(self) -> float:
        """Seconds of this clock per second of the wall."""
        return self._speed

    def now(self) -> datetime:
        """Return the robot's time."""
        return self._onboard.at(self._count_s())
