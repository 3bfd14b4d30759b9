"""What may be wrong with a simulated robot; nobody tells the robot."""

import math
from collections import deque
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from autonomy.arrays import FloatArray
from autonomy.vehicle.config import Vehicle
from onboard.flight.hardware import SetPoints


@dataclass(frozen=True, slots=True)
class RobotFaults:
    """Actuators that are slower and later than the vehicle's, or that stick, and what breaks."""

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
    leak_s: float = math.inf
    """From this time on water gets into the hull."""
    sensor_dies_s: float = math.inf
    """From this time on the instrument of the planned field says nothing."""
    optode_drifts_s: float = math.inf
    """From this time on the oxygen optode reads less and less."""
    battery_flat_s: float = math.inf
    """From this time on the battery has next to no charge."""
    gps_lost_s: float = math.inf
    """From this time on no fix comes, and no time by GPS."""
    depth_off_s: float = math.inf
    """From this time on the depth sensor reads ``DEPTH_OFF_M`` too much."""
    antenna_lost_s: float = math.inf
    """From this time on neither radio nor satellite carries a word to it or from it."""

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


NO_FAULTS = RobotFaults()
"""A robot as the vehicle's model says."""


@dataclass(frozen=True, slots=True)
class FaultKind:
    """Something that somebody may cause, and what undoes it."""

    field: str
    """The time of ``RobotFaults`` that says when it comes; empty of what is no robot's."""
    title: str
    words: str
    """What happens, as a sentence goes on."""
    over: str
    """What is so when it is undone."""
    needs_hands: bool = False
    """Whether it can be undone only where somebody reaches the robot: at the surface."""


CAUSED_FAULTS: Mapping[str, FaultKind] = {
    "leak": FaultKind(
        "leak_s", "Leak", "water gets into the hull", "the hull is dry and tight", True
    ),
    "pump": FaultKind(
        "pump_sticks_s", "Stuck pump", "the buoyancy pump stands still", "the pump runs again"
    ),
    "sensor": FaultKind(
        "sensor_dies_s",
        "Dead sensor",
        "the main science instrument says nothing any more",
        "the main science instrument answers again",
    ),
    "optode": FaultKind(
        "optode_drifts_s",
        "Drifting optode",
        "the oxygen optode begins to drift",
        "the optode is calibrated",
        True,
    ),
    "battery": FaultKind(
        "battery_flat_s", "Flat battery", "the battery is flat", "the battery is a full one", True
    ),
    "depth": FaultKind(
        "depth_off_s",
        "Depth sensor off zero",
        "the depth sensor reads 0.20 m too much",
        "the depth sensor reads as it was built to",
    ),
    "gps": FaultKind(
        "gps_lost_s",
        "No position fixes",
        "no position fix comes, by GPS or by cameras",
        "position fixes come again",
    ),
    "antenna": FaultKind(
        "antenna_lost_s",
        "Lost antennas",
        "neither radio nor satellite carries a word to or from it",
        "radio and satellite carry its words again",
    ),
}
"""What somebody may cause, by its name."""

OXYGEN = ("dissolved_oxygen", "oxygen_saturation")
"""Channels of an optode."""
DEPTH_OFF_M = 0.20
"""What a depth sensor that is off its zero reads at the surface."""
FLAT_FRACTION = 0.04
"""Charge of a battery that went flat."""
_DRIFT_S = 1800.0
_DRIFT_LEAST = 0.4


@dataclass(frozen=True, slots=True)
class CausedFault:
    """A fault that somebody causes."""

    name: str
    """A key of ``CAUSED_FAULTS``."""
    at_s: float
    """When it comes, of the robot's life."""
    robot: str = ""
    """Whom it meets; empty for every robot."""

    @classmethod
    def of(cls, text: str) -> "CausedFault":
        """Read ``[ROBOT:]NAME@SECONDS``.

        Raises:
            ValueError: If it is none; the sentence says what there is.
        """
        who, _, when = text.partition("@")
        robot, _, name = who.rpartition(":")
        names = ", ".join(CAUSED_FAULTS)
        if name not in CAUSED_FAULTS:
            raise ValueError(f"{text}: there is no fault {name!r}; there are {names}")
        try:
            at_s = float(when)
        except ValueError:
            at_s = -1.0
        if not 0.0 <= at_s < math.inf:
            raise ValueError(f"{text}: say {name}@SECONDS, such as {name}@60")
        return cls(name, at_s, robot)

    def refusal(self, robots: Mapping[str, Collection[str]]) -> str:
        """Return why it can meet none of these robots, each with its faults, or ""."""
        if self.robot and self.robot not in robots:
            return f"no robot {self.robot} for the fault {self.name}; there are {', '.join(robots)}"
        if self.robot and self.name not in robots[self.robot]:
            there = ", ".join(robots[self.robot])
            return f"{self.robot} has no fault {self.name}; there are {there}"
        return ""

    def meets(self, robot: str) -> bool:
        """Tell whether it is this robot's."""
        return self.robot in ("", robot)

    def added(self, faults: RobotFaults) -> RobotFaults:
        """Return faults with this one among them; the earlier of two of a name holds."""
        return caused_at(faults, self.name, min(self.at_s, begin_of(faults, self.name)))


def begin_of(faults: RobotFaults, name: str) -> float:
    """Return when a fault comes, of the robot's life; infinity if it does not."""
    return float(getattr(faults, CAUSED_FAULTS[name].field))


def caused_at(faults: RobotFaults, name: str, at_s: float) -> RobotFaults:
    """Return faults of which one comes at a time; at infinity it does not."""
    return replace(faults, **{CAUSED_FAULTS[name].field: at_s})


def drifted_share(drifting_s: float) -> float:
    """Return what an optode reads of the truth after so long a drift."""
    return max(_DRIFT_LEAST, math.exp(-max(0.0, drifting_s) / _DRIFT_S))


class FaultyActuators:
    """Passes set points on as late as they arrive, and none to what sticks.

    Args:
        faults: What is wrong.
        period_s: Time between two set points.
    """

    def __init__(self, faults: RobotFaults, period_s: float) -> None:
        self.faults = faults
        """What is wrong; it may change as the robot lives."""
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
        faults = self.faults
        if time_s >= faults.mass_sticks_s:
            command = replace(command, mass_position_m=float(state[13]))
        if time_s >= faults.pump_sticks_s:
            command = replace(command, net_buoyancy_kg=float(state[12]))
        if time_s >= faults.tail_sticks_s:
            command = replace(command, tail_rad=float(state[14]), tail_amplitude_rad=0.0)
        return command
