"""Water that is not the same everywhere: currents, density and temperature, waves.

The readable reference of ``autonomy.vehicle.water_kernel``. Positions are NED in the site's frame.
Beyond the ends of a profile or grid the value at the end holds.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from autonomy.arrays import FloatArray

STEEPEST_WAVE = 1.0 / 7.0
"""Height by length at which waves break (Michell's limit)."""
_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """The motion of the water at one place and time, in NED."""

    velocity_m_s: FloatArray
    """Shape ``(3,)``."""
    gradient_per_s: FloatArray
    """Rate of each component (row) along each axis (column), shape ``(3, 3)``."""
    change_m_s2: FloatArray
    """Rate of the velocity at a fixed place, shape ``(3,)``."""

    def __add__(self, other: "Flow") -> "Flow":
        """Return the flow of both together."""
        return Flow(
            self.velocity_m_s + other.velocity_m_s,
            self.gradient_per_s + other.gradient_per_s,
            self.change_m_s2 + other.change_m_s2,
        )

    @property
    def acceleration_m_s2(self) -> FloatArray:
        """Acceleration of a water particle: it changes in time, and moves on."""
        return self.change_m_s2 + self.gradient_per_s @ self.velocity_m_s

    @classmethod
    def steady(cls, velocity_m_s: FloatArray, gradient_per_s: FloatArray | None = None) -> Self:
        """Return a flow that does not change in time."""
        gradient = np.zeros((3, 3)) if gradient_per_s is None else gradient_per_s
        return cls(velocity_m_s, gradient, np.zeros(3))


@dataclass(frozen=True, slots=True, eq=False)
class CurrentProfile:
    """A horizontal current that is sheared: it depends on depth."""

    depth_m: FloatArray
    """Increasing, shape ``(n,)``, at least two."""
    velocity_ne_m_s: FloatArray
    """To the north and to the east, shape ``(n, 2)``."""

    def __post_init__(self) -> None:
        """Check the shapes."""
        _check_axis("depth_m", self.depth_m)
        _check_values("velocity_ne_m_s", self.velocity_ne_m_s, (len(self.depth_m), 2))

    def flow(self, depth_m: float) -> Flow:
        """Return the flow at a depth."""
        i, share, per_m = _place(self.depth_m, depth_m)
        low, high = self.velocity_ne_m_s[i : i + 2]
        velocity, gradient = np.zeros(3), np.zeros((3, 3))
        velocity[:2] = low + share * (high - low)
        gradient[:2, 2] = per_m * (high - low)
        return Flow.steady(velocity, gradient)


@dataclass(frozen=True, slots=True, eq=False)
class CurrentGrid:
    """A current given on a grid; in between it is trilinear."""

    x_m: FloatArray
    """Northings, increasing, shape ``(nx,)``, at least two."""
    y_m: FloatArray
    """Eastings, increasing, shape ``(ny,)``, at least two."""
    z_m: FloatArray
    """Depths, increasing, shape ``(nz,)``, at least two."""
    velocity_ned_m_s: FloatArray
    """Shape ``(nx, ny, nz, 3)``."""

    def __post_init__(self) -> None:
        """Check the shapes."""
        for name, axis in (("x_m", self.x_m), ("y_m", self.y_m), ("z_m", self.z_m)):
            _check_axis(name, axis)
        shape = (len(self.x_m), len(self.y_m), len(self.z_m), 3)
        _check_values("velocity_ned_m_s", self.velocity_ned_m_s, shape)

    def flow(self, position_ned: FloatArray) -> Flow:
        """Return the flow at a place."""
        axes = (self.x_m, self.y_m, self.z_m)
        corner: list[slice] = []
        weights: list[FloatArray] = []
        slopes: list[FloatArray] = []
        for axis, value in zip(axes, position_ned, strict=True):
            i, share, per_m = _place(axis, float(value))
            corner.append(slice(i, i + 2))
            weights.append(np.array([1.0 - share, share]))
            slopes.append(np.array([-per_m, per_m]))
        cell = self.velocity_ned_m_s[tuple(corner)]
        (wx, wy, wz), (sx, sy, sz) = weights, slopes
        gradient = [
            np.einsum("i,j,k,ijkc->c", *three, cell)
            for three in ((sx, wy, wz), (wx, sy, wz), (wx, wy, sz))
        ]
        velocity = np.einsum("i,j,k,ijkc->c", wx, wy, wz, cell)
        return Flow.steady(velocity, np.stack(gradient, axis=1))


@dataclass(frozen=True, slots=True)
class Wave:
    """A regular wave in deep water (Airy's linear theory).

    Left out: the floor (it is felt where the water is shallower than half a wave length),
    reflection from walls, breaking, what the hull does to the wave, and that the water's motion
    differs along a hull; all small where the hull is short beside the wave.
    """

    height_m: float
    """From trough to crest."""
    period_s: float
    direction_rad: float = 0.0
    """Where it runs to, from north towards east."""
    phase_rad: float = 0.0
    """0 for a crest at the origin at time 0."""

    def __post_init__(self) -> None:
        """Check that such a wave can be."""
        given = (self.height_m, self.period_s, self.direction_rad, self.phase_rad)
        if not all(map(math.isfinite, given)) or self.height_m < 0.0 or self.period_s <= 0.0:
            raise ValueError("a wave needs a height of at least 0 and a period above 0")
        if self.height_m > STEEPEST_WAVE * self.length_m:
            raise ValueError(
                f"a wave of {self.period_s:g} s breaks at {STEEPEST_WAVE * self.length_m:.3g} m;"
                f" {self.height_m:g} m is higher"
            )

    @property
    def length_m(self) -> float:
        """From crest to crest."""
        return _GRAVITY_M_S2 * self.period_s**2 / (2.0 * math.pi)

    def packed(self) -> tuple[float, ...]:
        """Return amplitude, wave number, angular frequency, direction north, east, and phase."""
        north, east = math.cos(self.direction_rad), math.sin(self.direction_rad)
        number, frequency = 2.0 * math.pi / self.length_m, 2.0 * math.pi / self.period_s
        return (0.5 * self.height_m, number, frequency, north, east, self.phase_rad)

    def elevation_m(self, position_ned: FloatArray, time_s: float) -> float:
        """Return how high the surface stands above its mean."""
        return 0.5 * self.height_m * math.cos(self._angle(position_ned, time_s))

    def elevation_slope(self, position_ned: FloatArray, time_s: float) -> tuple[FloatArray, float]:
        """Return the surface's slope to north and east, shape ``(2,)``, and its rate m/s."""
        amplitude, number, frequency, north, east, _ = self.packed()
        steepness = amplitude * math.sin(self._angle(position_ned, time_s))
        return -number * steepness * np.array([north, east]), frequency * steepness

    def flow(self, position_ned: FloatArray, time_s: float) -> Flow:
        """Return the flow at a place, decaying with depth; above the mean surface as at it."""
        amplitude, number, frequency, north, east, _ = self.packed()
        depth = max(float(position_ned[2]), 0.0)
        angle = self._angle(position_ned, time_s)
        speed = amplitude * frequency * math.exp(-number * depth)
        s, c = math.sin(angle), math.cos(angle)
        along = np.array([north, east, 0.0])
        down = np.array([0.0, 0.0, 1.0])
        velocity = speed * (c * along - s * down)
        change = frequency * speed * (s * along + c * down)
        gradient = np.outer(-number * speed * (s * along + c * down), along)
        if position_ned[2] > 0.0:
            gradient += np.outer(-number * velocity, down)
        return Flow(velocity, gradient, change)

    def _angle(self, position_ned: FloatArray, time_s: float) -> float:
        _, number, frequency, north, east, phase = self.packed()
        way = north * position_ned[0] + east * position_ned[1]
        return float(number * way - frequency * time_s + phase)


@dataclass(frozen=True, slots=True, eq=False)
class WaterColumn:
    """Density and temperature over depth."""

    depth_m: FloatArray
    """Increasing, shape ``(n,)``, at least two."""
    density_kg_m3: FloatArray
    """Shape ``(n,)``."""
    temperature_c: FloatArray | None = None
    """Shape ``(n,)``, if it is known."""
    ballast_density_kg_m3: float | None = None
    """Of the water in which the robot's net buoyancy was called 0; by default the uppermost."""

    def __post_init__(self) -> None:
        """Check the shapes."""
        _check_axis("depth_m", self.depth_m)
        _check_values("density_kg_m3", self.density_kg_m3, self.depth_m.shape)
        if np.any(self.density_kg_m3 <= 0.0) or not self.ballast_kg_m3 > 0.0:
            raise ValueError("density_kg_m3 must be above 0")
        if self.temperature_c is not None:
            _check_values("temperature_c", self.temperature_c, self.depth_m.shape)

    @classmethod
    def fresh(cls, depth_m: FloatArray, temperature_c: FloatArray) -> Self:
        """Return a lake's column from its temperature."""
        density = np.array([fresh_water_density(float(value)) for value in temperature_c])
        return cls(depth_m, density, temperature_c)

    @property
    def ballast_kg_m3(self) -> float:
        """Density of the water in which the robot was ballasted."""
        given = self.ballast_density_kg_m3
        return float(self.density_kg_m3[0]) if given is None else given

    def density_at(self, depth_m: float) -> float:
        """Return the density at a depth, kg/m3."""
        return float(np.interp(depth_m, self.depth_m, self.density_kg_m3))


def fresh_water_density(temperature_c: float) -> float:
    """Density of air-free fresh water at the surface, kg/m3.

    Args:
        temperature_c: From 0 to 40 degrees Celsius.

    Raises:
        ValueError: Outside of that range.

    Source:
        M. Tanaka et al., "Recommended table for the density of water between 0 C and 40 C based
        on recent experimental reports", Metrologia 38, 2001.
    """
    if not 0.0 <= temperature_c <= 40.0:
        raise ValueError(f"the density of water is known from 0 to 40 C, not at {temperature_c:g}")
    t = temperature_c
    lost = (t - 3.983035) ** 2 * (t + 301.797) / (522528.9 * (t + 69.34881))
    return 999.974950 * (1.0 - lost)


def _place(axis: FloatArray, value: float) -> tuple[int, float, float]:
    """Return cell, share of the way through it, and that share's rate by metre (0 beyond)."""
    i = int(np.clip(np.searchsorted(axis, value, side="right") - 1, 0, len(axis) - 2))
    width = float(axis[i + 1] - axis[i])
    share = (value - float(axis[i])) / width
    if 0.0 <= share < 1.0:
        return i, share, 1.0 / width
    return i, min(max(share, 0.0), 1.0), 0.0


def _check_axis(name: str, axis: FloatArray) -> None:
    if axis.ndim != 1 or len(axis) < 2 or not np.all(np.isfinite(axis)):
        raise ValueError(f"{name} must be at least two finite numbers")
    if np.any(np.diff(axis) <= 0.0):
        raise ValueError(f"{name} must increase")


def _check_values(name: str, values: FloatArray, shape: tuple[int, ...]) -> None:
    if values.shape != shape or not np.all(np.isfinite(values)):
        raise ValueError(f"{name} must be finite and have the shape {shape}")
