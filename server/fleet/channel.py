"""The gauges of a robot: one row each."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from robot_link.messages import StateReport


@dataclass(frozen=True, slots=True)
class Channel:
    """One number of a state report."""

    key: str
    """Name with the unit's suffix."""
    unit: str
    """SI unit of the value."""
    display_unit: str | None
    """Unit on a screen where it differs."""
    limit_s: float
    """Age from which the value must look old, at the clock's normal speed."""
    value: Callable[[StateReport], float]


def _speed(state: StateReport) -> float:
    return math.hypot(*state.velocity_ned)


CHANNELS: tuple[Channel, ...] = (
    Channel("depth_m", "m", None, 5.0, lambda state: state.position_ned[2]),
    Channel("pitch_rad", "rad", "deg", 5.0, lambda state: state.pitch_rad),
    Channel("roll_rad", "rad", "deg", 5.0, lambda state: state.roll_rad),
    Channel("heading_rad", "rad", "deg", 5.0, lambda state: state.heading_rad),
    Channel("speed_m_s", "m/s", None, 5.0, _speed),
    Channel("net_buoyancy_kg", "kg", "g", 5.0, lambda state: state.net_buoyancy_kg),
    Channel("mass_position_m", "m", "mm", 5.0, lambda state: state.mass_position_m),
    Channel("tail_rad", "rad", "deg", 5.0, lambda state: state.tail_rad),
    Channel("battery_fraction", "", "%", 60.0, lambda state: state.battery_fraction),
    Channel("battery_v", "V", None, 60.0, lambda state: state.battery_v),
    Channel("position_std_m", "m", None, 5.0, lambda state: state.position_std_m),
    Channel("energy_used", "", None, 60.0, lambda state: state.energy_used),
)
"""Every channel of a state report, in the order in which a screen shows them."""

POSITION_LIMIT_S = 5.0
"""Age from which a position must look old, at the clock's normal speed."""
FIELD_LIMIT_S = 120.0
"""The same for a measurement of a field."""
