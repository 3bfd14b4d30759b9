"""Swimming level at a depth: pump and sliding mass move little, though the tail's beat shakes."""

import math
from collections import deque

from autonomy.vehicle.config import Vehicle
from onboard.flight.hardware import SetPoints
from onboard.flight.navigation import Estimate

_DIVING_RATE_M_S = 0.05
_FULL_RATE_SHARE = 0.25
"""Part of the leash by which the depth swings when the pump works at its full rate."""
_SLOWING_SHARE = 0.3
"""Part of the depth loop's frequency with which the way to a depth ends."""
_NOSE_DOWN_MAX_RAD = math.radians(12.0)
"""Pitch on the way to a depth: a level hull that swims fast is lifted more than the pump can sink.
"""
_THERE_SHARE = 0.2
"""Part of the diving rate below which the robot is as good as there, and learns what it missed."""
_INTEGRAL_SHARE = 0.07
"""How slowly lasting errors of ballast and trim are learned, relative to the depth loop."""
_PLAY_SHARE = 0.01
"""Part of an actuator's range by which a wanted set point differs before it is followed."""


class LevelKeeper:
    """Keeps a robot whose tail beats level at a depth.

    Depth and its rate are means over one beat of the tail, and the depth loop is slow enough for
    its pump: a loop that asks for more than the pump's full rate swings for ever. Net mass and
    sliding mass rest while what is wanted of them only jitters.

    Args:
        vehicle: The robot.
        leash_m: How far the depth to be at may run ahead of the robot.
        estimate: Where it begins.
        period_s: Time between two steps.
    """

    def __init__(
        self, vehicle: Vehicle, leash_m: float, estimate: Estimate, period_s: float
    ) -> None:
        limits, parameters = vehicle.limits, vehicle.parameters
        self._limits = limits
        self._leash_m = leash_m
        self._period_s = period_s
        self._seen: deque[tuple[float, float]] = deque(
            maxlen=max(round(1.0 / (vehicle.swim.frequency_hz * period_s)), 1)
        )
        self._sinking_m_s2_kg = parameters.gravity_m_s2 / parameters.mass_3_kg
        # at this frequency a swing so wide takes the pump at its full rate
        jerk_m_s3 = limits.m0_rate_kg_s * self._sinking_m_s2_kg
        self._frequency_rad_s = (jerk_m_s3 / (_FULL_RATE_SHARE * leash_m)) ** (1.0 / 3.0)
        self._depth_m = estimate.depth_m
        self._ballast_kg = 0.0
        self._slide_m = vehicle.swim.rp1_m
        self._net_buoyancy = _Play(
            _PLAY_SHARE * (limits.m0_max_kg - limits.m0_min_kg), estimate.readings.net_buoyancy_kg
        )
        self._mass_position = _Play(
            _PLAY_SHARE * (limits.rp1_max_m - limits.rp1_min_m), estimate.readings.mass_position_m
        )

    def step(self, estimate: Estimate, wanted_m: float) -> SetPoints:
        """Return net mass and sliding mass for the next step, tail straight.

        Args:
            estimate: Where the robot believes to be.
            wanted_m: Depth to go to and to be at.
        """
        depth_m, rate_m_s = self._mean(estimate)
        omega, dt_s = self._frequency_rad_s, self._period_s
        wanted_m_s = self._move_reference(depth_m, wanted_m)
        error_m = self._depth_m - depth_m
        acceleration = omega**2 * error_m + 2.0 * omega * (wanted_m_s - rate_m_s)
        net_buoyancy = self._ballast_kg + acceleration / self._sinking_m_s2_kg
        gain_m = abs(self._limits.rp1_min_m)
        diving = wanted_m_s / _DIVING_RATE_M_S
        nose_up_rad = estimate.pitch_rad + _NOSE_DOWN_MAX_RAD * diving
        position = self._slide_m + gain_m * nose_up_rad
        reachable = self._limits.clip(net_buoyancy, position, 0.0)
        if abs(diving) < _THERE_SHARE:
            # what is missed by an actuator at its end stop teaches nothing
            learned = _INTEGRAL_SHARE * omega * dt_s
            if reachable[0] == net_buoyancy:
                self._ballast_kg += learned * omega**2 * error_m / self._sinking_m_s2_kg
            if reachable[1] == position:
                self._slide_m += learned * gain_m * nose_up_rad
        return SetPoints(
            self._net_buoyancy.follow(reachable[0]), self._mass_position.follow(reachable[1])
        )

    def _move_reference(self, depth_m: float, wanted_m: float) -> float:
        """Move the depth to be at towards the wanted one, on the leash; return how fast."""
        left_m = wanted_m - self._depth_m
        slowing_m_s = _SLOWING_SHARE * self._frequency_rad_s * abs(left_m)
        rate_m_s = math.copysign(min(slowing_m_s, _DIVING_RATE_M_S), left_m)
        ahead_m = self._depth_m + rate_m_s * self._period_s - depth_m
        self._depth_m = depth_m + math.copysign(min(abs(ahead_m), self._leash_m), ahead_m)
        return rate_m_s

    def _mean(self, estimate: Estimate) -> tuple[float, float]:
        """Return depth and its rate without the swing of the tail's beat."""
        self._seen.append((estimate.depth_m, estimate.velocity_ned[2]))
        depth_m, rate_m_s = (
            sum(values) / len(self._seen) for values in zip(*self._seen, strict=True)
        )
        return depth_m, rate_m_s


class _Play:
    """A set point that follows what is wanted at a distance, and rests while that only jitters."""

    def __init__(self, play: float, value: float) -> None:
        self._play = play
        self._value = value

    def follow(self, wanted: float) -> float:
        self._value = min(max(self._value, wanted - self._play), wanted + self._play)
        return self._value
