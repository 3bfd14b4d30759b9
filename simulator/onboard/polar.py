"""Trim of steady glides over the range of path angles that a vehicle can fly."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.steady import NoSteadyGlideError, angle_of_attack, glide_inputs

_GRID_RAD = np.radians(np.arange(25.0, 76.0, 1.0))


@dataclass(frozen=True, slots=True)
class GlideTrim:
    """What holds one steady glide."""

    path_angle_rad: float
    """Inclination of the path, positive up."""
    pitch_rad: float
    net_buoyancy_kg: float
    mass_position_m: float


class GlidePolar:
    """Steady glides of a vehicle at one vertical speed, one way.

    Args:
        vehicle: The robot.
        vertical_speed_m_s: Rate of depth, positive down, not 0. If the buoyancy pump cannot reach
            it on a path, the trim is that of the pump's limit, so the robot glides slower.

    Raises:
        NoSteadyGlideError: If the vehicle can hold no path at that speed.
    """

    def __init__(self, vehicle: Vehicle, vertical_speed_m_s: float) -> None:
        self._sign = -1.0 if vertical_speed_m_s > 0.0 else 1.0
        rows: list[tuple[float, float, float, float]] = []
        for steepness in _GRID_RAD.tolist():
            try:
                pitch = self._sign * steepness + angle_of_attack(
                    vehicle.parameters, self._sign * steepness
                )
                m0, rp1 = glide_inputs(vehicle, self._sign * steepness, abs(vertical_speed_m_s))
            except NoSteadyGlideError:
                continue
            rows.append((steepness, pitch, m0, rp1))
        if not rows:
            raise NoSteadyGlideError(
                f"{vehicle.title} holds no glide at {vertical_speed_m_s:+.3f} m/s"
            )
        self._steepness, self._pitch, self._m0, self._rp1 = np.array(rows).T

    def trim(self, steepness_rad: float) -> GlideTrim:
        """Return the trim of the path nearest to a steepness (0 level, pi/2 straight)."""
        steepness = float(np.clip(steepness_rad, self._steepness[0], self._steepness[-1]))
        return GlideTrim(
            path_angle_rad=self._sign * steepness,
            pitch_rad=float(np.interp(steepness, self._steepness, self._pitch)),
            net_buoyancy_kg=float(np.interp(steepness, self._steepness, self._m0)),
            mass_position_m=float(np.interp(steepness, self._steepness, self._rp1)),
        )

    @property
    def flattest_rad(self) -> float:
        """Smallest steepness that can be held."""
        return float(self._steepness[0])

    @property
    def steepest_rad(self) -> float:
        """Greatest steepness that can be held."""
        return float(self._steepness[-1])


def horizontal_speed(vertical_speed_m_s: float, steepness_rad: float) -> float:
    """Return the speed over ground of a steady glide in still water."""
    return abs(vertical_speed_m_s) / math.tan(steepness_rad)
