"""What may be wrong with a simulated robot's actuators; nobody tells the robot."""

import math
from collections import deque
from dataclasses import dataclass, replace

from autonomy.arrays import FloatArray
from autonomy.vehicle.config import Vehicle
from onboard.flight.hardware import SetPoints


@dataclass(frozen=True, slots=True)
class ActuatorFaults:
    """Actuators that are slower and later than the vehicle's, or that stick."""

    mass_rate_share: float = 1.0
    """Greatest speed of the sliding mass as a share of the nominal one."""
    mass_delay_s: float = 0.0
    """Time between a command and the beginning of the sliding mass's answer."""
    pump_rate_share: float = 1.0
    """Greatest rate of the net mass as a share of the nominal one."""
    mass_sticks_s: float = math.inf
    """From this time of the robot's life on the sliding mass stands still."""
    pump_sticks_s: float = math.inf
    """From this time on the pump stands still."""
    tail_sticks_s: float = math.inf
    """From this time on the tail stands still."""

    def true(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle with the rates that it really has."""
        limits = vehicle.limits
        slow = limits.model_copy(
            update={
                "rp1_rate_m_s": self.mass_rate_share * limits.rp1_rate_m_s,
                "m0_rate_kg_s": self.pump_rate_share * limits.m0_rate_kg_s,
            }
        )
        return replace(vehicle, limits=slow)


NO_FAULTS = ActuatorFaults()
"""Actuators as the vehicle's model says."""


class FaultyActuators:
    """Passes set points on as late as they arrive, and none to what sticks.

    Args:
        faults: What is wrong.
        period_s: Time between two set points.
    """

    def __init__(self, faults: ActuatorFaults, period_s: float) -> None:
        self._faults = faults
        self._late: deque[float] = deque(maxlen=round(faults.mass_delay_s / period_s) + 1)

    def reached(self, command: SetPoints, state: FloatArray, time_s: float) -> SetPoints:
        """Return what the actuators act on now.

        Args:
            command: The newest set points.
            state: True state as in ``Plant``, shape ``(15,)``.
            time_s: Time of the robot's life.
        """
        self._late.append(command.mass_position_m)
        command = replace(command, mass_position_m=self._late[0])
        faults = self._faults
        if time_s >= faults.mass_sticks_s:
            command = replace(command, mass_position_m=float(state[13]))
        if time_s >= faults.pump_sticks_s:
            command = replace(command, net_buoyancy_kg=float(state[12]))
        if time_s >= faults.tail_sticks_s:
            command = replace(command, tail_rad=float(state[14]), tail_amplitude_rad=0.0)
        return command
