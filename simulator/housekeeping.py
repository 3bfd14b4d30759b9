"""What a simulated robot's own instruments say of the robot itself."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vehicle.config import Vehicle
from simulator.water_field import WaterField

_DRY_HPA, _LEAK_RISE_HPA = 1013.0, 150.0
_DRY_HUMIDITY = 35.0
_WETTING_S = 120.0
"""Time in which a leaking hull becomes wet."""
_WARMING_S = 900.0
"""Time in which the inside of the hull follows the water."""
_WARMER_C_PER_W = 0.25
_DISK_MB, _LOG_MB_S = 28_600.0, 0.02
_LOAD_IDLE, _LOAD_SWING, _LOAD_TURN_S = 22.0, 6.0, 41.0
_SATELLITES, _HDOP = 9.0, 1.1


class Housekeeping:
    """Keeps what the robot's own condition depends on.

    Args:
        vehicle: Prices of its actuators.
        field: Its water, which cools it.
    """

    def __init__(self, vehicle: Vehicle, field: WaterField) -> None:
        self._prices = vehicle.energy.packed(vehicle.limits)
        self._field = field
        self._warmer_c = _WARMER_C_PER_W * vehicle.energy.electronics_w
        self._power_w = self._pump_w = self._mass_w = 0.0

    def advance(
        self, before: FloatArray, after: FloatArray, used_j: float, period_s: float
    ) -> None:
        """Note what actuators did in a period.

        Args:
            before: State as in ``Plant`` at its beginning.
            after: State at its end.
            used_j: Electrical energy that all took.
            period_s: Its length.
        """
        pump, mass = (after[12:14] - before[12:14]) / period_s
        self._power_w = used_j / period_s
        gained_c = _WARMER_C_PER_W * self._power_w - self._warmer_c
        self._warmer_c += gained_c * period_s / _WARMING_S
        self._pump_w = float(self._prices[1] * pump**2)
        self._mass_w = float(self._prices[2] * mass**2)

    def read(
        self,
        time_s: float,
        position_ned: tuple[float, float, float],
        voltage_v: float,
        leaking_s: float,
        has_gps: bool | None,
    ) -> dict[str, float]:
        """Return readings by the keys of their channels.

        Args:
            time_s: Time of the robot's life.
            position_ned: Where it truly is, m.
            voltage_v: Of the battery.
            leaking_s: How long water has got in; 0 or less is dry.
            has_gps: Whether its receiver hears GPS; None without a receiver.
        """
        wet = 1.0 - math.exp(-max(0.0, leaking_s) / _WETTING_S)
        swing = math.sin(2.0 * math.pi * time_s / _LOAD_TURN_S)
        found = {
            "leak": float(leaking_s > 0.0),
            "internal_pressure": _DRY_HPA + wet * _LEAK_RISE_HPA,
            "humidity": _DRY_HUMIDITY + wet * (100.0 - _DRY_HUMIDITY),
            "internal_temperature": self._inside_c(position_ned),
            "battery_current": self._power_w / voltage_v,
            "pump_current": self._pump_w / voltage_v,
            "mass_current": self._mass_w / voltage_v,
            "processor_load": _LOAD_IDLE + _LOAD_SWING * swing,
            "free_disk": max(0.0, _DISK_MB - _LOG_MB_S * time_s),
        }
        if has_gps is not None:
            found["gps_satellites"] = _SATELLITES if has_gps else 0.0
        if has_gps:
            found["gps_hdop"] = _HDOP
        return found

    def _inside_c(self, position_ned: tuple[float, float, float]) -> float:
        water_c = self._field.truth("temperature", np.array([position_ned]))[0]
        return float(water_c) + self._warmer_c
