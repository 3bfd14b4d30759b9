"""Gains of the trajectory controllers of the thesis."""

import math
from typing import Literal, Self, get_args

import numpy as np
from pydantic import model_validator

from autonomy.arrays import FloatArray
from autonomy.configuration import Configuration, quantity


class BacksteppingConfig(Configuration):
    """Gains of the proposed backstepping controller; with ``pitch_trade_rad`` 0 of the baseline.

    The defaults are those of the thesis's experiments (section 3.4.3). The three laws of Eq. 3.19
    are solved in the order tail, net mass, sliding mass, because the tail's force enters the depth
    equation. What they ask for is cut at the end stops, and the actuators then follow as fast as
    their rates allow; the law has no memory, so nothing winds up meanwhile.
    """

    k_z: float = quantity(0.08, "1/s2", title="Depth gain", gt=0.0)
    """Acceleration by depth error (k_z)."""
    k_1: float = quantity(0.9, "1/s", title="Depth rate gain", gt=0.0)
    """Acceleration by rate of the depth error (k_1)."""
    k_psi: float = quantity(1.0, "1/s2", title="Heading gain", gt=0.0)
    """Angular acceleration by heading error (k_psi)."""
    k_2: float = quantity(0.1, "1/s", title="Heading rate gain", gt=0.0)
    """Angular acceleration by rate of the heading error (k_2)."""
    k_xi: float = quantity(4.0, "1/s2", title="Pitch gain", gt=0.0)
    """Angular acceleration by the hybrid pitch error (k_xi)."""
    k_3: float = quantity(4.0, "1/s", title="Pitch rate gain", gt=0.0)
    """Angular acceleration by rate of the hybrid pitch error (k_3)."""
    pitch_trade_rad: float = quantity(
        math.pi / 9.0,
        "rad",
        title="Pitch given up for position",
        ge=0.0,
        lt=math.pi / 2.0,
        display_unit="deg",
    )
    """Greatest pitch error that the controller accepts to win back horizontal distance (c)."""
    tail_effect_min: float = quantity(
        1.0, "1/s2", title="Smallest tail effect", ge=0.0, advanced=True
    )
    """Floor of the tail's modelled effect on the heading; 0 is the literal law of Eq. 3.19, which
    asks for hundreds of radians at low speed and, at rest, for nothing. 1 makes the tail command
    the wanted acceleration."""
    near_m: float = quantity(0.05, "m", title="Near the target", gt=0.0, advanced=True)
    """Within this distance the direction to the target is averaged over two points (epsilon_0)."""
    near_offset_m: float = quantity(0.15, "m", title="Offset near target", gt=0.0, advanced=True)
    """Distance of those two points to either side of the target (l), not below ``near_m``: a robot
    at one of them has no direction."""
    is_tail_clipped_first: bool = quantity(
        True, title="Depth counts on the reachable tail", advanced=True
    )
    """Whether the depth law counts on the tail angle within its end stops; if not, on the angle
    that was asked for, which the literal law with a small tail effect makes hundreds of radians."""

    @model_validator(mode="after")
    def _points_lie_outside(self) -> Self:
        if self.near_offset_m < self.near_m:
            raise ValueError("near_offset_m must not be below near_m")
        return self

    def without_trade(self) -> "BacksteppingConfig":
        """Return the gains of the baseline: the same law with ``c = 0`` (thesis section 3.3)."""
        return self.model_copy(update={"pitch_trade_rad": 0.0})

    def packed(self) -> FloatArray:
        """Return the values in the order of declaration, shape ``(11,)``."""
        return np.array(list(self.model_dump().values()), dtype=np.float64)


AntiWindup = Literal["none", "hold", "back_calculation"]
"""What becomes of an integral while its actuator is at an end stop."""


class PidConfig(Configuration):
    """Gains of three PID loops: depth by net mass, pitch by sliding mass, heading by tail.

    The defaults are those of the thesis's experiments (section 3.4.3), in SI units; the thesis's
    integrals grow on at an end stop.
    """

    z_proportional: float = quantity(0.08, "kg/m", title="Depth, proportional")
    """Net mass by depth error."""
    z_integral: float = quantity(0.0, "kg/(m s)", title="Depth, integral")
    """Net mass by integral of the depth error."""
    z_derivative: float = quantity(0.1, "kg s/m", title="Depth, derivative")
    """Net mass by rate of the depth error."""
    pitch_proportional: float = quantity(0.08, "m/rad", title="Pitch, proportional")
    """Sliding mass, aft, by pitch error."""
    pitch_integral: float = quantity(0.05, "m/(rad s)", title="Pitch, integral")
    """Sliding mass, aft, by integral of the pitch error."""
    pitch_derivative: float = quantity(0.0375, "m s/rad", title="Pitch, derivative")
    """Sliding mass, aft, by rate of the pitch error."""
    heading_proportional: float = quantity(1.0, "", title="Heading, proportional")
    """Tail angle by heading error."""
    heading_integral: float = quantity(0.001, "1/s", title="Heading, integral")
    """Tail angle by integral of the heading error."""
    heading_derivative: float = quantity(1.0, "s", title="Heading, derivative")
    """Tail angle by rate of the heading error."""
    near_m: float = quantity(0.05, "m", title="Near the target", gt=0.0, advanced=True)
    """Within this distance the direction to the target is averaged over two points (epsilon_0)."""
    near_offset_m: float = quantity(0.15, "m", title="Offset near target", gt=0.0, advanced=True)
    """Distance of those two points to either side of the target (l), not below ``near_m``: a robot
    at one of them has no direction."""

    anti_windup: AntiWindup = quantity("none", title="Anti-windup", advanced=True)
    """At an end stop an integral grows on (none), stops growing into the stop (hold: conditional
    integration), or runs back by what the stop cut off (back calculation)."""
    windup_recovery_s: float = quantity(
        5.0, "s", title="Anti-windup recovery", gt=0.0, le=1000.0, advanced=True
    )
    """Time constant with which back calculation runs an integral back."""

    @model_validator(mode="after")
    def _points_lie_outside(self) -> Self:
        if self.near_offset_m < self.near_m:
            raise ValueError("near_offset_m must not be below near_m")
        return self

    def packed(self) -> FloatArray:
        """Return the values in the order of declaration, shape ``(13,)``; a choice as its index."""
        values = self.model_dump()
        values["anti_windup"] = get_args(AntiWindup).index(self.anti_windup)
        return np.array(list(values.values()), dtype=np.float64)


BACKSTEPPING_EXPERIMENT = BacksteppingConfig()
"""Gains of thesis section 3.4.3: slow enough for measured states at 10 Hz."""
BACKSTEPPING_SIMULATION = BacksteppingConfig(k_z=1.0, k_1=10.0, k_2=1.0, k_xi=1.0, k_3=2.0)
"""Gains of thesis section 3.3: for exact states."""
PID_EXPERIMENT = PidConfig()
"""Gains of thesis section 3.4.3."""
PID_SIMULATION = PidConfig(
    z_proportional=1.0,
    z_derivative=10.0,
    pitch_proportional=1.0,
    pitch_integral=0.0,
    pitch_derivative=2.0,
)
"""Gains of thesis section 3.3."""

BACKSTEPPING_PRESETS: dict[str, BacksteppingConfig] = {
    "miniglider": BACKSTEPPING_EXPERIMENT,
    "grace3": BACKSTEPPING_EXPERIMENT,
}
"""Gains a robot starts with, by vehicle; the law is model based, so one set serves both."""

_LENGTH, _BUOYANCY = 100.0 / 40.0, 420.0 / 50.0
_TIME = math.sqrt(_LENGTH)
PID_PRESETS: dict[str, PidConfig] = {
    "miniglider": PID_EXPERIMENT,
    "grace3": PidConfig(
        z_proportional=0.08 * _BUOYANCY / _LENGTH,
        z_derivative=0.1 * _BUOYANCY / _LENGTH * _TIME,
        pitch_proportional=0.08 * _LENGTH,
        pitch_integral=0.05 * _LENGTH / _TIME,
        pitch_derivative=0.0375 * _LENGTH * _TIME,
        heading_integral=0.001 / _TIME,
        heading_derivative=_TIME,
        near_m=0.05 * _LENGTH,
        near_offset_m=0.15 * _LENGTH,
    ),
}
"""Gains a robot starts with, by vehicle; GRACE 3's are the Miniglider's in Froude's scale."""
