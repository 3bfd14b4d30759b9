"""Standing corrections of a robot's actuators, as glider pilots find them from past dives."""

from autonomy.configuration import Configuration, quantity
from autonomy.vehicle.config import ActuatorLimits

_SHARE_MAX = 0.3
"""Greatest part of an actuator's shorter travel: a robot told a wrong trim still comes up, for it
rises with twice as much buoyancy."""


class TrimConfig(Configuration):
    """What to add to every set point so that the robot does what its model says.

    A robot whose ballast is a few grams off sinks too fast and rises too slowly; one whose
    battery lies a little aft flies nose up. The offsets are added to the commands alone: the
    feedback of pump and sliding mass keeps telling what their sensors measure.
    """

    net_buoyancy_offset_kg: float = quantity(
        0.0, "kg", title="Net buoyancy offset", ge=-0.3, le=0.3, display_unit="g"
    )
    """Added to every net buoyancy set point; positive makes the robot heavier."""
    mass_position_offset_m: float = quantity(
        0.0, "m", title="Mass position offset", ge=-0.05, le=0.05, display_unit="mm"
    )
    """Added to every position of the sliding mass; positive moves it forward, nose down."""


TRIM_PRESETS: dict[str, TrimConfig] = {"miniglider": TrimConfig(), "grace3": TrimConfig()}
"""Trim of a robot that nobody has trimmed yet, by vehicle."""


def trim_flaw(
    net_buoyancy_offset_kg: float, mass_position_offset_m: float, limits: ActuatorLimits
) -> str:
    """Return why a robot must not fly with a trim, or "".

    Args:
        net_buoyancy_offset_kg: As in ``TrimConfig``.
        mass_position_offset_m: As in ``TrimConfig``.
        limits: End stops of the robot's actuators.
    """
    for name, offset, low, high in (
        ("net buoyancy", net_buoyancy_offset_kg, limits.m0_min_kg, limits.m0_max_kg),
        ("mass position", mass_position_offset_m, limits.rp1_min_m, limits.rp1_max_m),
    ):
        if abs(offset) > _SHARE_MAX * min(-low, high):
            return f"the trim of the {name} is beyond {_SHARE_MAX:.0%} of the actuator's travel"
    return ""
