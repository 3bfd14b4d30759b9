"""The charge of a robot's battery, and who uses it."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vehicle.config import ActuatorLimits


@dataclass(frozen=True, slots=True)
class BatteryModel:
    """Energy use of thesis Eq. 5.20: electronics, and actuators by their squared rates.

    The thesis gives no constants; each actuator's is stated as its power at full rate.
    """

    capacity_wh: float
    full_v: float
    """Terminal voltage when full."""
    empty_v: float
    """Terminal voltage when empty."""
    electronics_w: float
    pump_w: float
    """Power of the buoyancy pump at its greatest rate."""
    mass_w: float
    """Power of the sliding mass's actuator at its greatest rate."""
    tail_w: float
    """Power of the tail servo at its greatest rate."""


class Battery:
    """A battery that drains while the robot lives; it starts full.

    Args:
        model: Capacity and consumers.
        limits: Greatest rates that the powers refer to.
    """

    def __init__(self, model: BatteryModel, limits: ActuatorLimits) -> None:
        self._model = model
        self._full_rates = np.array(
            [limits.m0_rate_kg_s, limits.rp1_rate_m_s, limits.delta_rate_rad_s]
        )
        self._powers_w = np.array([model.pump_w, model.mass_w, model.tail_w])
        self.fraction = 1.0
        """Charge left, 0..1."""

    @property
    def voltage_v(self) -> float:
        """Terminal voltage, falling evenly with the charge."""
        return self._model.empty_v + self.fraction * (self._model.full_v - self._model.empty_v)

    def drain(self, actuator_rates: FloatArray, duration_s: float) -> None:
        """Use energy for ``duration_s``.

        Args:
            actuator_rates: Mean rates of net mass kg/s, sliding mass m/s, tail rad/s, shape (3,).
            duration_s: Time that passed.
        """
        actuators_w = float(self._powers_w @ (actuator_rates / self._full_rates) ** 2)
        used_wh = (self._model.electronics_w + actuators_w) * duration_s / 3600.0
        self.fraction = max(0.0, self.fraction - used_wh / self._model.capacity_wh)
