"""Standing corrections of a robot's actuators, as glider pilots find them from past dives."""

from autonomy.configuration import Configuration, quantity


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
