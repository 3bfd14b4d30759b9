"""What a robot's battery holds, and what swimming takes from it."""

import math

from autonomy.configuration import Configuration, quantity
from autonomy.vehicle.config import Vehicle

RESERVE = 0.05
"""Charge at which a robot ends its mission, and below which it begins none."""
_DEPTH_KEEPING = 0.3
"""Root mean square rate of the pump, as part of the greatest, where depth is kept with a beating
tail. Of its full power the simulated Miniglider takes 0.01 so, GRACE 3 0.02, and 0.07 with the way
down; of the sliding mass's both take next to none."""


class BatteryConfig(Configuration):
    """The battery of a robot."""

    capacity_wh: float = quantity(48.0, "Wh", title="Capacity", gt=0.0, le=1e5)
    """Energy of the full battery. By it the station says whether a mission's battery lasts."""
    reserve: float = quantity(0.1, title="Reserve", ge=RESERVE, le=0.9)
    """Part of the full battery that a plan and the way home must leave. It is not less than the
    0.05 at which the robot ends its mission by itself."""


BATTERY_PRESETS: dict[str, BatteryConfig] = {
    "miniglider": BatteryConfig(),
    "grace3": BatteryConfig(capacity_wh=2 * 388.0),
}
"""Battery by vehicle. Thesis Table 2.3 has GRACE 3's two packs; of the Miniglider's nickel cells it
names the 9.6 V but not the charge, estimated as 5 Ah."""


def swimming_power_w(vehicle: Vehicle, *, is_deep: bool) -> float:
    """Return what a robot draws that swims with its full beat, W.

    Steering by the tail takes nearly the full beat whatever the speed, so this is hardly more than
    a pursuit draws.

    Args:
        vehicle: Its actuators and their power (thesis Eq. 5.20).
        is_deep: Whether it keeps a depth, for which the pump works now and then.
    """
    gait, limits = vehicle.swim, vehicle.limits
    pump_kg_s = _DEPTH_KEEPING * limits.m0_rate_kg_s if is_deep else 0.0
    beat_rad_s = math.sqrt(2.0) * math.pi * gait.frequency_hz * gait.amplitude_rad
    return vehicle.energy.power_w(limits, pump_kg_s, 0.0, beat_rad_s)
