"""How a submarine of six thrusters moves: first-order velocities, a little buoyant."""

import math
from collections.abc import Callable
from dataclasses import dataclass

_LAG_S = 1.2
_FORWARD_M_S = 0.9
_VERTICAL_M_S = 0.5
_YAW_RAD_S = 0.6
_BUOYANT_M_S = 0.04
"""How fast it rises with its motors off."""
_IDLE_W = 18.0
_THRUST_W = 240.0
_CAPACITY_WH = 266.0
_FULL_V = 16.6
_EMPTY_V = 13.2


@dataclass(frozen=True, slots=True)
class Demand:
    """What the motors are to do, each -1 to 1, in the body's frame."""

    forward: float = 0.0
    right: float = 0.0
    down: float = 0.0
    turn: float = 0.0

    @property
    def effort(self) -> float:
        """Share of full power."""
        return min(1.0, abs(self.forward) + abs(self.right) + abs(self.down) + abs(self.turn)) ** 2


IDLE = Demand()


class SubPlant:
    """Position, velocity, heading and battery; NED, SI.

    Args:
        start_ne_m: Where it floats at first.
        heading_rad: Where its nose points at first.
        floor_m: Depth of the water at a place.
    """

    def __init__(
        self,
        start_ne_m: tuple[float, float],
        heading_rad: float,
        floor_m: Callable[[float, float], float],
    ) -> None:
        self.north_m, self.east_m = start_ne_m
        self.depth_m = 0.0
        self.heading_rad = heading_rad
        self.velocity_ned = (0.0, 0.0, 0.0)
        self.turn_rad_s = 0.0
        self.time_s = 0.0
        self.charge = 1.0
        self.current_a = 0.0
        self._floor_m = floor_m

    @property
    def floor_m(self) -> float:
        """Depth of the water here."""
        return self._floor_m(self.north_m, self.east_m)

    @property
    def voltage_v(self) -> float:
        """Of the battery under its load."""
        return _EMPTY_V + (_FULL_V - _EMPTY_V) * self.charge - 0.02 * self.current_a

    @property
    def roll_rad(self) -> float:
        """It leans a little into its turns."""
        return 0.08 * self.turn_rad_s / _YAW_RAD_S

    @property
    def pitch_rad(self) -> float:
        """It lifts its nose a little as it speeds up."""
        return 0.03 * math.hypot(*self.velocity_ned[:2]) / _FORWARD_M_S

    def step(self, period_s: float, demand: Demand) -> None:
        """Move on by a period with a demand."""
        share = 1.0 - math.exp(-period_s / _LAG_S)
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        forward, right = _FORWARD_M_S * demand.forward, _FORWARD_M_S * demand.right
        wanted = (
            forward * cos - right * sin,
            forward * sin + right * cos,
            _VERTICAL_M_S * demand.down - (_BUOYANT_M_S if demand is IDLE else 0.0),
        )
        north, east, down = (
            now + share * (then - now) for now, then in zip(self.velocity_ned, wanted, strict=True)
        )
        self.turn_rad_s += share * (_YAW_RAD_S * demand.turn - self.turn_rad_s)
        self.heading_rad = math.remainder(
            self.heading_rad + period_s * self.turn_rad_s, 2.0 * math.pi
        )
        self.north_m += period_s * north
        self.east_m += period_s * east
        depth_m = self.depth_m + period_s * down
        self.depth_m = min(max(depth_m, 0.0), max(0.0, self.floor_m - 0.2))
        if self.depth_m != depth_m:
            down = 0.0
        self.velocity_ned = (north, east, down)
        power_w = _IDLE_W + _THRUST_W * demand.effort
        self.current_a = power_w / _FULL_V
        self.charge = max(0.0, self.charge - power_w * period_s / 3600.0 / _CAPACITY_WH)
        self.time_s += period_s
