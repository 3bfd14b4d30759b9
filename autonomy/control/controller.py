"""Controllers as the onboard program steps them: an estimate and a reference in, a command out."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.control import governor_kernel, law, law_number
from autonomy.control.config import BacksteppingConfig
from autonomy.control.trajectory import Reference
from autonomy.vehicle.config import Vehicle


@dataclass(frozen=True, slots=True)
class ActuatorCommand:
    """Setpoints of the three actuators, inside their end stops, and the flap of the tail."""

    m0_kg: float
    rp1_m: float
    delta_rad: float
    """Tail angle, or the angle about which the tail flaps."""
    tail_amplitude_rad: float = 0.0
    tail_frequency_hz: float = 0.0


class Controller(Protocol):
    """Tracks a reference; called at a steady rate of about 10 Hz."""

    def command(self, estimate: FloatArray, reference: Reference, dt_s: float) -> ActuatorCommand:
        """Return the setpoints for an estimate ``(12,)`` of the states, ``dt_s`` after the last."""
        ...

    @property
    def knows_mass(self) -> bool:
        """Whether the law makes use of what is known of the sliding mass."""
        ...

    def hear(self, m0_kg: float, rp1_m: float, delta_rad: float) -> None:
        """Take where the actuators say that they are, before the next command."""
        ...

    def know_mass(self, rate_share: float, delay_s: float) -> None:
        """Count on this share of the sliding mass's nominal rate, and on this delay."""
        ...

    def forget_mass(self) -> None:
        """Count on what the gains say of the sliding mass."""
        ...

    def reset(self) -> None:
        """Forget what was learned of an earlier leg."""
        ...


class CompiledController:
    """Runs one compiled law and keeps what it remembers.

    Args:
        number: Which law, of ``autonomy.control.law_number``.
        vehicle: The robot, whose model the law uses and whose end stops it respects.
        gains: The packed configuration of that law.
    """

    def __init__(self, number: int, vehicle: Vehicle, gains: FloatArray) -> None:
        self._law = number
        self._packed = vehicle.packed()
        self._told, self._gains = gains, gains.copy()
        self._memory = np.zeros(law.MEMORY_SIZE)

    def command(self, estimate: FloatArray, reference: Reference, dt_s: float) -> ActuatorCommand:
        """Return the setpoints for an estimate ``(12,)``; neutral ones if it is not finite."""
        wanted = law.command(
            self._law, estimate, reference.packed(), self._gains, self._packed, dt_s, self._memory
        )
        return ActuatorCommand(*wanted.tolist())

    @property
    def knows_mass(self) -> bool:
        """Whether the law makes use of what is known of the sliding mass."""
        return self._law == law_number.GOVERNOR

    def hear(self, m0_kg: float, rp1_m: float, delta_rad: float) -> None:
        """Take where the actuators say that they are, before the next command."""
        if self.knows_mass:
            fed = governor_kernel.FED
            self._memory[fed : fed + 4] = (governor_kernel.KNOWN, m0_kg, rp1_m, delta_rad)

    def know_mass(self, rate_share: float, delay_s: float) -> None:
        """Count on this share of the sliding mass's nominal rate, and on this delay."""
        if self.knows_mass:
            self._gains[governor_kernel.MASS_RATE_SHARE] = rate_share
            self._gains[governor_kernel.MASS_DELAY] = delay_s

    def forget_mass(self) -> None:
        """Count on what the gains say of the sliding mass."""
        self._gains[:] = self._told

    def reset(self) -> None:
        """Forget the integrals and whatever else was learned; not what is on its way."""
        self._memory[: governor_kernel.SENT if self.knows_mass else None] = 0.0


class BacksteppingController(CompiledController):
    """The proposed controller; the baseline if its ``pitch_trade_rad`` is 0. It has no memory."""

    def __init__(self, vehicle: Vehicle, config: BacksteppingConfig) -> None:
        super().__init__(law_number.BACKSTEPPING, vehicle, config.packed())
