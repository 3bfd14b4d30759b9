"""The robot's true motion; only sensors and the emulated radio look at it."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import rotation_ned_from_body
from autonomy.site import Site
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.extended_kernel import advance
from autonomy.vehicle.surroundings import Surroundings
from onboard.flight.hardware import SetPoints
from simulator.current import DriftingCurrent
from simulator.flow import Flow

PHYSICS_STEP_S = 0.02
"""Runge-Kutta step: accurate to micrometres and stable in contact with floor and walls."""

FLOOR = 7
"""Place of the floor's depth among the packed surroundings."""
SHALLOWEST_M = 0.2
"""Where the survey says land, the robot lies in this much water, aground."""


class Plant:
    """Full dynamics of one robot in its water body.

    Args:
        vehicle: Model and actuator limits.
        surroundings: Floor, walls, layers and waves of the water.
        current: Drift of that water; advanced together with the robot.
        start_ne_m: Where the robot floats at first, in the site frame.
        heading_rad: Where its nose points at first.
        site: The water body, whose floor the robot meets; without one, or without a survey of its
            floor, that of the surroundings.
        flow: What else moves the water, by place and time.
        water_s: Time of the water at the beginning, s: where a tide is then.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        surroundings: Surroundings,
        current: DriftingCurrent,
        start_ne_m: tuple[float, float],
        heading_rad: float,
        site: Site | None = None,
        flow: Flow | None = None,
        water_s: float = 0.0,
    ) -> None:
        self._packed = vehicle.packed()
        self._current = current
        self._flow = flow
        self._water_s = water_s
        self._surroundings = surroundings.packed()
        self._uneven = site if site is not None and site.bathymetry is not None else None
        self.time_s = 0.0
        self.state: FloatArray = np.zeros(15)
        """Position NED m, Euler angles rad, velocity through the water in body axes m/s, body
        rates rad/s, net mass kg, sliding mass m, tail rad."""
        self.state[0:2] = start_ne_m
        self.state[5] = heading_rad
        self.state[12] = 0.3 * vehicle.limits.m0_min_kg

    def advance(self, command: SetPoints, duration_s: float) -> float:
        """Move on by ``duration_s``, a multiple of ``PHYSICS_STEP_S``, under one command.

        Returns:
            Electrical energy that electronics and actuators used, J.
        """
        self._current.advance(duration_s)
        self._surroundings[0:2] = self._current.velocity_ne_m_s
        if self._flow is not None:
            north, east, depth = self.position_ned
            here = np.array([[north, east, depth, self._water_s + self.time_s]])
            self._surroundings[0:2] += self._flow.velocity_ne_m_s(here)[0]
        if self._uneven is not None:
            below_m = float(self._uneven.floor_m(self.state[0], self.state[1]))
            self._surroundings[FLOOR] = max(below_m, SHALLOWEST_M)
        set_points = np.array(
            [
                command.net_buoyancy_kg,
                command.mass_position_m,
                command.tail_rad,
                command.tail_amplitude_rad,
                command.tail_frequency_hz,
            ]
        )
        steps = round(duration_s / PHYSICS_STEP_S)
        metered = advance(
            np.append(self.state, 0.0),
            set_points,
            self._packed,
            self._surroundings,
            self.time_s,
            PHYSICS_STEP_S,
            steps,
        )
        self.state = metered[:15]
        self.time_s += steps * PHYSICS_STEP_S
        return float(metered[15])

    @property
    def velocity_ned_m_s(self) -> FloatArray:
        """True velocity over ground in the site frame, shape ``(3,)``."""
        velocity = rotation_ned_from_body(*self.state[3:6].tolist()) @ self.state[6:9]
        velocity[:2] += self._surroundings[0:2]
        return velocity

    @property
    def position_ned(self) -> tuple[float, float, float]:
        """True position in the site frame, m; depth is never negative."""
        north, east, down = self.state[:3].tolist()
        return north, east, max(down, 0.0)
