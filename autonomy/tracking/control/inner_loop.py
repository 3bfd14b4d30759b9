"""From turn rate and acceleration to the tail's bias and amplitude (thesis section 4.5)."""

import math
from collections import deque
from dataclasses import dataclass

from autonomy.tracking.control.inner_loop_config import InnerLoopConfig

_FLOOR_BIAS_SHARE = 0.4
"""Part of the bias that a robot without speed may still steer with."""


@dataclass(frozen=True, slots=True)
class Swimming:
    """How the robot moves, with the swing of the tail's beat taken out."""

    course_rad: float
    """Direction of the motion, from north towards east, in -pi..pi."""
    speed_m_s: float
    """Speed along it."""
    turn_rate_rad_s: float
    """Rate of the heading, positive to starboard."""
    acceleration_m_s2: float
    """Rate of the speed."""


@dataclass(frozen=True, slots=True)
class TailBeat:
    """What the tail shall do."""

    bias_rad: float
    """Mean angle; positive turns to port."""
    amplitude_rad: float
    frequency_hz: float


class BeatAverage:
    """Averages a robot's motion over whole beats of its tail, and moves the mean to the present.

    A mean over a beat is half a beat old; the mean turn rate says how far the course has turned
    since.

    Args:
        config: Frequency of the beat, and over how many beats to average.
        period_s: Time between two steps.
    """

    def __init__(self, config: InnerLoopConfig, period_s: float) -> None:
        self._window_s = config.beats / config.frequency_hz
        steps = max(round(self._window_s / period_s), 2)
        self._period_s = period_s
        self._velocities: deque[tuple[float, float]] = deque(maxlen=steps)
        self._rates: deque[float] = deque(maxlen=steps)
        self._speeds: deque[float] = deque(maxlen=steps)

    def step(
        self, velocity_ne_m_s: tuple[float, float], heading_rad: float, turn_rate_rad_s: float
    ) -> Swimming:
        """Take in one measurement; one that is not finite repeats the last.

        Args:
            velocity_ne_m_s: Velocity through the water, north and east, m/s.
            heading_rad: Where the nose points; stands for the course of a robot that stands.
            turn_rate_rad_s: Rate of the heading, rad/s.
        """
        if math.isfinite(sum(velocity_ne_m_s)):
            self._velocities.append(velocity_ne_m_s)
        if math.isfinite(turn_rate_rad_s):
            self._rates.append(turn_rate_rad_s)
        count = max(len(self._velocities), 1)
        north = sum(v[0] for v in self._velocities) / count
        east = sum(v[1] for v in self._velocities) / count
        speed = math.hypot(north, east)
        rate = sum(self._rates) / max(len(self._rates), 1)
        self._speeds.append(speed)
        elapsed_s = (len(self._speeds) - 1) * self._period_s
        gained = self._speeds[-1] - self._speeds[0]
        age_s = 0.5 * len(self._rates) * self._period_s
        course = math.atan2(east, north) if speed > 1e-3 else heading_rad
        return Swimming(
            course_rad=math.remainder(course + rate * age_s, math.tau),
            speed_m_s=speed,
            turn_rate_rad_s=rate,
            acceleration_m_s2=gained / elapsed_s if elapsed_s > 0.0 else 0.0,
        )


class InnerLoop:
    """Two PI loops, from turn rate to tail bias and from acceleration to tail amplitude.

    The integral of an acceleration's error is an error of speed; it is kept as a wanted speed
    that stays within reach of the measured one, so that a robot that cannot brake (only drag
    slows it) or cannot go faster does not build up an error that it would have to undo.

    Args:
        config: Gains and limits.
        period_s: Time between two steps.
    """

    def __init__(self, config: InnerLoopConfig, period_s: float) -> None:
        self._config = config
        self._period_s = period_s
        self._turn_integral_rad = 0.0
        self._missing_m_s = 0.0
        self._amplitude_rad = config.amplitude_max_rad

    def turn_hard(self, turn_rate_rad_s: float) -> TailBeat:
        """Return the beat that turns the robot hardest, to starboard for a positive rate.

        What the loop has learned of steering holds for its usual turns only, and is forgotten.
        """
        self._turn_integral_rad = 0.0
        config = self._config
        bias = math.copysign(config.bias_hard_rad, -turn_rate_rad_s)
        return TailBeat(bias, config.amplitude_max_rad, config.frequency_hz)

    def step(self, turn_rate_rad_s: float, acceleration_m_s2: float, now: Swimming) -> TailBeat:
        """Return the beat for the next step.

        Args:
            turn_rate_rad_s: Wanted turn rate, positive to starboard; one that is not finite
                counts as 0.
            acceleration_m_s2: Wanted acceleration, the same.
            now: How the robot moves.
        """
        turn = turn_rate_rad_s if math.isfinite(turn_rate_rad_s) else 0.0
        gain = acceleration_m_s2 if math.isfinite(acceleration_m_s2) else 0.0
        is_slow = now.speed_m_s < self._config.speed_floor_m_s
        bias = self._bias(turn, now, is_slow=is_slow)
        # a bias turns by the thrust that it deflects: the hardest turn needs the hardest beat
        is_hard = is_slow or abs(bias) >= self._config.bias_max_rad
        amplitude = self._amplitude(gain, now, is_hard=is_hard)
        return TailBeat(bias, amplitude, self._config.frequency_hz)

    def _bias(self, wanted: float, now: Swimming, *, is_slow: bool) -> float:
        config = self._config
        error = wanted - now.turn_rate_rad_s
        most = config.bias_max_rad * (_FLOOR_BIAS_SHARE if is_slow else 1.0)
        direct = config.turn_feedforward_s * wanted + config.turn_gain_s * error
        steered = direct + config.turn_integral_gain * self._turn_integral_rad
        # an integral that would push farther into the end stop waits
        if abs(steered) < most or steered * error < 0.0:
            self._turn_integral_rad += error * self._period_s
        # a positive tail angle turns to port
        return -min(max(steered, -most), most)

    def _amplitude(self, wanted: float, now: Swimming, *, is_hard: bool) -> float:
        config = self._config
        error = wanted - now.acceleration_m_s2
        least, most = config.amplitude_min_rad, config.amplitude_max_rad
        if is_hard:
            return most
        change = config.acceleration_integral_gain_s_m * error * self._period_s
        self._amplitude_rad = min(max(self._amplitude_rad + change, least), most)
        return min(max(self._amplitude_rad + config.acceleration_gain_s2_m * error, least), most)
