"""The charge of a robot's battery."""

from dataclasses import dataclass

_J_PER_WH = 3600.0


@dataclass(frozen=True, slots=True)
class BatteryModel:
    """A battery; what drains it are the vehicle's ``EnergyPrices``."""

    capacity_wh: float
    full_v: float
    """Terminal voltage when full."""
    empty_v: float
    """Terminal voltage when empty."""


class Battery:
    """A battery that drains while the robot lives; it starts full.

    Args:
        model: Capacity and voltages.
    """

    def __init__(self, model: BatteryModel) -> None:
        self._model = model
        self.fraction = 1.0
        """Charge left, 0..1."""

    @property
    def voltage_v(self) -> float:
        """Terminal voltage, falling evenly with the charge."""
        return self._model.empty_v + self.fraction * (self._model.full_v - self._model.empty_v)

    def use(self, energy_j: float) -> None:
        """Take energy out, at most what is left."""
        used = energy_j / _J_PER_WH / self._model.capacity_wh
        self.fraction = max(0.0, self.fraction - used)
