"""Settings of the integral backstepping controller."""

import math
from typing import Self

from pydantic import model_validator

from autonomy.configuration import quantity
from autonomy.control.config import BACKSTEPPING_SIMULATION, BacksteppingConfig


class IntegralConfig(BacksteppingConfig):
    """Gains of backstepping that learns its offsets, and how far it trusts them.

    Three numbers are learned while the robot tracks: the net mass and the position of the sliding
    mass that the model has wrong, and the distance by which a current or an unfitting reference
    leaves the robot behind. None of them is learned far from the reference, nor further into the
    end stop of the actuator that it acts on.
    """

    k_depth_integral: float = quantity(0.006, "1/s3", title="Depth integral gain", ge=0.0)
    """Acceleration by integral of the depth error; stable, and accepted, below depth gain x
    depth rate gain (Routh)."""
    k_pitch_integral: float = quantity(0.8, "1/s3", title="Pitch integral gain", ge=0.0)
    """Angular acceleration by integral of the hybrid error; stable, and accepted, below pitch gain
    x pitch rate gain (Routh)."""
    k_along_integral: float = quantity(0.003, "1/s", title="Distance integral gain", ge=0.0)
    """Growth of the added distance by the distance to the target ahead."""
    depth_window_m: float = quantity(0.3, "m", title="Learn depth within", gt=0.0, advanced=True)
    """Greatest depth error at which the net mass is learned."""
    pitch_window_rad: float = quantity(
        0.3, "rad", title="Learn pitch within", gt=0.0, display_unit="deg", advanced=True
    )
    """Greatest hybrid error at which the sliding mass is learned."""
    along_window_m: float = quantity(1.0, "m", title="Learn distance within", gt=0.0, advanced=True)
    """Greatest horizontal error at which the added distance is learned."""
    net_buoyancy_most_kg: float = quantity(
        0.01, "kg", title="Most net buoyancy learned", ge=0.0, display_unit="g", advanced=True
    )
    """Greatest error of the net mass that is believed."""
    mass_position_most_m: float = quantity(
        0.01, "m", title="Most mass position learned", ge=0.0, display_unit="mm", advanced=True
    )
    """Greatest error of the sliding mass's position that is believed."""
    along_most_m: float = quantity(
        1.0, "m", title="Most distance added", ge=0.0, le=3.0, advanced=True
    )
    """Greatest added distance; the pitch that wins back distance is nearly all given up at 2 m."""

    @model_validator(mode="after")
    def _integrals_are_stable(self) -> Self:
        for name, value, most in (
            ("k_depth_integral", self.k_depth_integral, self.k_z * self.k_1),
            ("k_pitch_integral", self.k_pitch_integral, self.k_xi * self.k_3),
        ):
            if value >= most:
                raise ValueError(f"{name} must be below {most:g}, gain x rate gain, to be stable")
        return self


INTEGRAL_EXPERIMENT = IntegralConfig()
"""Gains of the thesis's experiments with integrals that keep a third of the phase margin."""
INTEGRAL_SIMULATION = IntegralConfig(
    **(BACKSTEPPING_SIMULATION.model_dump()), k_depth_integral=0.1, k_pitch_integral=0.2
)
"""Gains of the thesis's simulation, for exact states."""

_LENGTH, _BUOYANCY = 100.0 / 40.0, 420.0 / 50.0
INTEGRAL_PRESETS: dict[str, IntegralConfig] = {
    "miniglider": INTEGRAL_EXPERIMENT,
    "grace3": IntegralConfig(
        k_along_integral=0.003 / math.sqrt(_LENGTH),
        depth_window_m=0.3 * _LENGTH,
        along_window_m=_LENGTH,
        net_buoyancy_most_kg=0.01 * _BUOYANCY,
        mass_position_most_m=0.01 * _LENGTH,
    ),
}
"""Gains a robot starts with, by vehicle; GRACE 3's windows are the Miniglider's in its scale."""
