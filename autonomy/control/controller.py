"""Controllers as the onboard program steps them: an estimate and a reference in, a command out."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.control import kernel
from autonomy.control.config import BacksteppingConfig, PidConfig
from autonomy.control.reference import Reference
from autonomy.vehicle.config import ActuatorLimits, Vehicle


@dataclass(frozen=True, slots=True)
class ActuatorCommand:
    """Setpoints of the three actuators, inside their end stops."""

    m0_kg: float
    rp1_m: float
    delta_rad: float

    @classmethod
    def clipped(cls, inputs: FloatArray, limits: ActuatorLimits) -> "ActuatorCommand":
        """Cut what a law asks for at the end stops; what is not a number becomes neutral."""
        m0, rp1, delta = np.nan_to_num(inputs, nan=0.0, posinf=np.inf, neginf=-np.inf).tolist()
        return cls(*limits.clip(m0, rp1, delta))


class Controller(Protocol):
    """Tracks a reference; called at a steady rate of about 10 Hz."""

    def command(self, estimate: FloatArray, reference: Reference, dt_s: float) -> ActuatorCommand:
        """Return the setpoints for an estimate of the 12 states, ``dt_s`` after the last call."""
        ...

    def reset(self) -> None:
        """Forget what was learned of an earlier leg."""
        ...


class BacksteppingController:
    """The proposed controller; the baseline if its ``pitch_trade_rad`` is 0. It has no memory."""

    def __init__(self, vehicle: Vehicle, config: BacksteppingConfig) -> None:
        self._limits = vehicle.limits
        self._packed = vehicle.packed()
        self._gains = config.packed()

    def command(
        self,
        estimate: FloatArray,
        reference: Reference,
        dt_s: float,
    ) -> ActuatorCommand:
        """Return the setpoints; the time since the last call does not matter."""
        inputs = kernel.backstepping(estimate, reference.packed(), self._gains, self._packed)
        return ActuatorCommand.clipped(inputs, self._limits)

    def reset(self) -> None:
        """Do nothing: there is no memory."""


class PidController:
    """Three PID loops; remembers the integrals of their errors."""

    def __init__(self, vehicle: Vehicle, config: PidConfig) -> None:
        self._limits = vehicle.limits
        self._gains = config.packed()
        self._integrals = np.zeros(3)

    def command(self, estimate: FloatArray, reference: Reference, dt_s: float) -> ActuatorCommand:
        """Return the setpoints and add to the integrals."""
        inputs = kernel.pid(estimate, reference.packed(), self._gains, self._integrals, dt_s)
        return ActuatorCommand.clipped(inputs, self._limits)

    def reset(self) -> None:
        """Set the integrals to 0."""
        self._integrals[:] = 0.0
