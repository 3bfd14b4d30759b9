"""Velocity through the water from the vehicle's own model, corrected by the depth sensor."""

import math
from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig
from autonomy.estimation.kernel import step_observer
from autonomy.frames import rotation_ned_from_body
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.surroundings import Surroundings

LONGEST_STEP_S = 0.02
"""Longest Runge-Kutta step of the observer's model."""


def observer_gains(config: EstimatorConfig) -> FloatArray:
    """Return K1 and K2 as the kernel takes them, shape ``(2,)``."""
    return np.array([config.observer_velocity_gain, config.observer_depth_gain])


class VelocityObserver:
    r"""Estimates the velocity that no sensor on board measures.

    Each step predicts with the equations of motion from what was measured last, then lets the
    error of the predicted depth correct depth and velocity:
    :math:`\dot{\hat z} = \dots + K_2 (z - \hat z)` and
    :math:`\dot{\hat v} = \dots + K_1 R^T [0, 0, z - \hat z]^T`. Drag makes the horizontal velocity
    converge without a correction. A current is not seen: the velocity is through the water.

    Source:
        Coleman, thesis, section 3.4, which prints no gains; the model is that of section 5.3.
    """

    def __init__(self, config: EstimatorConfig, vehicle: Vehicle, depth_m: float) -> None:
        """Begin level and at rest at a measured depth."""
        self._gains = observer_gains(config)
        self._packed = vehicle.packed()
        self._open_water = Surroundings().packed()
        self._state = np.zeros(15)
        self._state[2] = depth_m

    @property
    def velocity_body(self) -> tuple[float, float, float]:
        """Velocity through the water in body axes, m/s."""
        forward, starboard, down = self._state[6:9].tolist()
        return (forward, starboard, down)

    @property
    def velocity_ned(self) -> tuple[float, float, float]:
        """Velocity through the water in NED, m/s."""
        roll, pitch, heading = self._state[3:6].tolist()
        rotation = rotation_ned_from_body(roll, pitch, heading)
        north, east, down = (rotation @ self._state[6:9]).tolist()
        return (north, east, down)

    @property
    def depth_m(self) -> float:
        """Depth by the model after correction."""
        return float(self._state[2])

    def step(
        self,
        dt_s: float,
        command: FloatArray,
        time_s: float,
        *,
        attitude_rad: Sequence[float] | FloatArray,
        angular_velocity_rad_s: Sequence[float] | FloatArray,
        actuators: Sequence[float] | FloatArray,
        depth_m: float,
    ) -> None:
        """Let ``dt_s`` pass under a command, then take in what is measured at its end.

        Args:
            dt_s: Time since the last step, s; positive.
            command: In force during that time, shape ``(5,)``: net mass kg, sliding mass m, tail
                bias rad, tail amplitude rad, tail frequency Hz.
            time_s: Time at its beginning, on the clock of the tail's flap.
            attitude_rad: Roll, pitch and heading.
            angular_velocity_rad_s: In body axes.
            actuators: Net mass kg, sliding mass m, tail angle rad.
            depth_m: From the pressure sensor.

        Raises:
            ValueError: If ``dt_s`` is not positive or a measurement is not finite.
        """
        attitude, rates, inside = (
            np.array(measured, dtype=np.float64)
            for measured in (attitude_rad, angular_velocity_rad_s, actuators)
        )
        measured = (*attitude, *rates, *inside, depth_m, *command)
        if not (0.0 < dt_s < math.inf and np.isfinite(measured).all()):
            raise ValueError("the velocity observer needs dt > 0 and finite measurements")
        self._state = step_observer(
            self._state,
            dt_s,
            command,
            time_s,
            attitude,
            rates,
            inside,
            depth_m,
            self._gains,
            self._packed,
            self._open_water,
            math.ceil(dt_s / LONGEST_STEP_S),
        )
