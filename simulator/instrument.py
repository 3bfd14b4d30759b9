"""The instruments that a simulated robot carries beside the one of its planned field."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from autonomy.channel import CHANNELS
from simulator.water_field import WaterField


@dataclass(frozen=True, slots=True)
class Instrument:
    """One channel that a robot measures."""

    channel: str
    """Its key."""
    period_s: float
    """Time between two measurements."""
    noise: float
    """Standard deviation of one measurement, in the channel's unit."""


_NOISE = {
    "temperature": 0.02,
    "dissolved_oxygen": 0.05,
    "par": 0.5,
    "blue_green_algae": 0.1,
    "conductivity": 0.003,
    "salinity": 0.003,
    "pressure": 0.01,
    "oxygen_saturation": 0.5,
    "cdom": 0.1,
    "backscatter": 5e-5,
    "turbidity": 0.05,
    "ph": 0.005,
    "nitrate": 0.5,
    "sound_level": 1.0,
    "water_depth": 0.05,
}
_USUAL_NOISE = 0.02


def instrument(channel: str, period_s: float) -> Instrument:
    """Return an instrument as good as those of its kind that are on the market."""
    return Instrument(channel, period_s, _NOISE.get(channel, _USUAL_NOISE))


CTD = tuple(instrument(channel, 10.0) for channel in ("conductivity", "pressure", "salinity"))
"""Beside a thermometer, what measures salt; the salinity is computed aboard."""


class Instruments:
    """Measures the water with errors drawn from a generator of its own.

    Args:
        carried: What the robot carries.
        field: Its water.
        generator: Source of randomness.
    """

    def __init__(
        self, carried: Iterable[Instrument], field: WaterField, generator: np.random.Generator
    ) -> None:
        self._carried = {one.channel: one for one in carried}
        self._field = field
        self._generator = generator
        self.periods_s: Mapping[str, float] = {
            key: one.period_s for key, one in self._carried.items()
        }
        """How often each wants to be asked, by channel."""

    def measure(
        self, channels: Iterable[str], position_ned: tuple[float, float, float]
    ) -> dict[str, float]:
        """Return a measurement of each channel that is carried, at a true position."""
        wanted = [self._carried[key] for key in channels if key in self._carried]
        if not wanted:
            return {}
        exact = self._field.truths((one.channel for one in wanted), np.array([position_ned]))
        found: dict[str, float] = {}
        for one in wanted:
            noise = one.noise * float(self._generator.standard_normal())
            value, declared = float(exact[one.channel][0]) + noise, CHANNELS.get(one.channel)
            is_free = declared is None
            found[one.channel] = value if is_free else min(max(value, declared.low), declared.high)
        return found
