"""What the actuators make of their commands: how fast, how late, stuck, or swinging."""

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum

import numpy as np

from autonomy.control import actuator_kernel as bank_of
from autonomy.vehicle.config import Vehicle
from onboard.flight.hardware import Readings, SetPoints

_SLOWER_SHARE, _LATER_S = 0.7, 0.15
"""An actuator that is slower, or later, is not what the vehicle's model says."""
STUCK_S = 15.0
_STILL_SHARE = 0.02
_AWAY_SHARE = 0.08
"""What moves less than the first part of its travel for so long, and all the while stands farther
than the second from where it should go, is stuck."""
_MOVED_SHARE = 0.05
"""A command this part of the travel away teaches something of rate and delay."""
SWING_RAD = 0.25
SWINGS = 6
SWINGS_WITHIN_S = 30.0
"""So many swings of the pitch error and of the sliding mass, to and fro, within this time are a
limit cycle."""
MASS_SWING_SHARE = 0.15
CALM_S = 180.0
"""Without a new limit cycle for so long, the robot counts as calm again."""


class Actuator(Enum):
    """The actuators that are watched, by what a sentence calls them."""

    MASS = "sliding mass"
    PUMP = "pump"
    TAIL = "tail"


@dataclass(frozen=True, slots=True)
class ActuatorBelief:
    """How an actuator follows its commands."""

    rate_share: float
    """Greatest speed as a share of the nominal one; the nominal 1 while nothing refutes it."""
    rate_std_octaves: float
    """Standard deviation of its logarithm to base 2."""
    delay_s: float
    delay_std_s: float
    is_off: bool
    """Whether it is so slow or so late that a controller has to know."""
    age_s: float
    """Time since a command last said something of it."""


class Follower:
    """Learns rate and delay of one actuator, and whether it is stuck.

    Args:
        rate: Nominal rate, per second.
        travel: Way from one end stop to the other.
        period_s: Time between two steps.
    """

    def __init__(self, rate: float, travel: float, period_s: float) -> None:
        self._rate, self._travel, self._period_s = rate, travel, period_s
        self._bank = np.zeros(bank_of.BANK_SIZE)
        self._age_s = math.inf
        self._low = self._high = math.nan
        self._away_s = 0.0
        self._stuck_at = math.nan

    def step(self, command: float, feedback: float, *, must_move: bool = False) -> None:
        """Take a set point, and where the actuator stood one period later.

        Args:
            command: Inside the end stops.
            feedback: What the actuator says.
            must_move: Whether it was told to move to and fro, wherever it stands.
        """
        if not math.isfinite(feedback):
            return
        off = abs(command - feedback)
        self._age_s += self._period_s
        if off > _MOVED_SHARE * self._travel:
            self._age_s = 0.0
        if not must_move:
            bank_of.look_at(
                self._bank, command, feedback, self._rate, self._travel, 1.0, 0.0, self._period_s
            )
        still = _STILL_SHARE * self._travel
        low, high = min(self._low, feedback), max(self._high, feedback)
        if not (must_move or off > _AWAY_SHARE * self._travel) or not high - low <= still:
            low = high = feedback
            self._away_s = 0.0
        self._low, self._high = low, high
        self._away_s += self._period_s
        if self._away_s > STUCK_S and math.isnan(self._stuck_at):
            self._stuck_at = feedback
        elif abs(feedback - self._stuck_at) > still:
            self._stuck_at = math.nan

    @property
    def is_stuck(self) -> bool:
        """Whether it stood still though it was told to move, and has not moved since."""
        return not math.isnan(self._stuck_at)

    @property
    def belief(self) -> ActuatorBelief:
        """What is believed of it."""
        share = float(bank_of.known_rate(self._bank, 0, 1.0))
        delay_s = float(bank_of.known_delay(self._bank, 0, 0.0))
        rate_std = float(self._bank[bank_of.LOG_RATE_STD])
        delay_std = float(self._bank[bank_of.DELAY_STD])
        return ActuatorBelief(
            rate_share=share,
            rate_std_octaves=rate_std,
            delay_s=delay_s,
            delay_std_s=delay_std,
            is_off=_surely(math.log2(_SLOWER_SHARE) - math.log2(share), rate_std)
            or _surely(delay_s - _LATER_S, delay_std),
            age_s=self._age_s,
        )


def _surely(excess: float, std: float) -> bool:
    """Tell whether an excess is more than chance."""
    return excess > 2.0 * std


class SwingCount:
    """Counts how often a signal turned back by more than a size within a time."""

    def __init__(self, size: float) -> None:
        self._size = size
        self._extreme = math.nan
        self._way = 0
        self._turned_s: deque[float] = deque(maxlen=SWINGS)

    def step(self, value: float, time_s: float) -> None:
        """Take the newest value."""
        if math.isnan(self._extreme):
            self._extreme = value
        moved = value - self._extreme
        if self._way * moved > 0.0 or (self._way == 0 and abs(moved) > self._size):
            self._extreme, self._way = value, int(math.copysign(1, moved))
        elif self._way * moved < -self._size:
            self._extreme, self._way = value, -self._way
            self._turned_s.append(time_s)

    def swings(self, time_s: float) -> bool:
        """Tell whether it turned back so often of late."""
        turned = self._turned_s
        return len(turned) == SWINGS and time_s - turned[0] < SWINGS_WITHIN_S


class ActuatorWatch:
    """Watches the three actuators of a robot, and whether its pitch swings.

    Args:
        vehicle: The robot.
        period_s: Time between two steps.
    """

    def __init__(self, vehicle: Vehicle, period_s: float) -> None:
        limits = vehicle.limits
        self._period_s = period_s
        self._time_s = 0.0
        self._swung_s = -math.inf
        travel_m = limits.rp1_max_m - limits.rp1_min_m
        self._tail_travel_rad = 2.0 * limits.delta_max_rad
        self.mass = Follower(limits.rp1_rate_m_s, travel_m, period_s)
        """The sliding mass."""
        self.pump = Follower(limits.m0_rate_kg_s, limits.m0_max_kg - limits.m0_min_kg, period_s)
        """The buoyancy pump."""
        self.tail = Follower(limits.delta_rate_rad_s, self._tail_travel_rad, period_s)
        """The tail; while it beats, its rate and delay are not learned."""
        self._pitch_swings = SwingCount(SWING_RAD)
        self._mass_swings = SwingCount(MASS_SWING_SHARE * travel_m)

    def step(self, sent: SetPoints, readings: Readings, wanted_pitch_rad: float | None) -> None:
        """Take what the actuators were told, and what the sensors said one period later.

        Args:
            sent: Set points as they left, trim and end stops included.
            readings: Of the sensors as they are.
            wanted_pitch_rad: What a controller holds; None while none does.
        """
        self._time_s += self._period_s
        self.mass.step(sent.mass_position_m, readings.mass_position_m)
        self.pump.step(sent.net_buoyancy_kg, readings.net_buoyancy_kg)
        beats = sent.tail_amplitude_rad * min(sent.tail_frequency_hz, 1.0)
        is_beating = beats > _STILL_SHARE * self._tail_travel_rad
        self.tail.step(sent.tail_rad, readings.tail_rad, must_move=is_beating)
        if wanted_pitch_rad is not None:
            self._pitch_swings.step(readings.pitch_rad - wanted_pitch_rad, self._time_s)
            self._mass_swings.step(sent.mass_position_m, self._time_s)
            if self._pitch_swings.swings(self._time_s) and self._mass_swings.swings(self._time_s):
                self._swung_s = self._time_s

    @property
    def is_swinging(self) -> bool:
        """Whether pitch and sliding mass chased each other of late."""
        return self._time_s - self._swung_s < CALM_S

    @property
    def stuck(self) -> tuple[Actuator, ...]:
        """The actuators that stood still though they were told to move, and have not since."""
        every = ((Actuator.MASS, self.mass), (Actuator.PUMP, self.pump), (Actuator.TAIL, self.tail))
        return tuple(name for name, follower in every if follower.is_stuck)
