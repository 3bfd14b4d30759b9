"""A tail-beating robot in a tank follows a virtual target, as in the thesis's experiment (4.5).

Cameras see the robot; range, course, speed and turn rate come from its positions and headings.
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.site import Box
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.control import control_kernel
from autonomy.tracking.control.inner_loop import BeatAverage, InnerLoop, Swimming
from autonomy.tracking.control.inner_loop_config import InnerLoopConfig
from autonomy.tracking.control.pack_control import pack_control
from autonomy.tracking.filter import filter_kernel
from autonomy.tracking.predictive.predictive import PredictiveController
from autonomy.tracking.target_path import place
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.extended_kernel import advance

PERIOD_S = 0.1
PHYSICS_STEP_S = 0.02
_DEEP_M = 10.0
_AFLOAT_SHARE = 0.15
_LEVEL_PITCH_RAD = math.radians(4.0)
"""The robot lies at the surface, nose a little up, and its sliding mass keeps it so."""


@dataclass(frozen=True, slots=True)
class TailBeatTrial:
    """One trial's settings."""

    config: TrackingConfig
    """Path of the target, filter, controller, limits and duration; its first guess is not used."""
    vehicle: Vehicle
    loops: InnerLoopConfig
    view: Box
    """What the cameras see; the trial ends where the robot leaves it."""
    start_ne_m: tuple[float, float]
    heading_rad: float
    guess_variance_m2: float = 0.125
    """Variance per axis of the first estimate (thesis 4.5: 0.125)."""
    range_noise_m2: float = 0.0
    """Variance added to the ranges that the cameras give."""
    camera_std_m: float = 0.005
    camera_std_rad: float = math.radians(1.0)


@dataclass(frozen=True, slots=True, eq=False)
class TailBeatOutcome:
    """One trial as it went; a row a step."""

    time_s: FloatArray
    own_ne_m: FloatArray
    """True, shape ``(n, 2)``."""
    target_ne_m: FloatArray
    """True, shape ``(n, 2)``."""
    estimate_ne_m: FloatArray
    """True own position minus the estimated relative one, shape ``(n, 2)``."""
    inverse_condition: FloatArray
    """At the true state, shape ``(n,)``."""
    has_left: bool
    """Whether the robot left the cameras' view."""

    @property
    def estimation_error_m(self) -> float:
        """Time-averaged distance of estimated and true relative position."""
        return float(np.linalg.norm(self.estimate_ne_m - self.target_ne_m, axis=1).mean())

    @property
    def tracking_error_m(self) -> float:
        """Time-averaged distance of robot and target."""
        return float(np.linalg.norm(self.own_ne_m - self.target_ne_m, axis=1).mean())

    @property
    def condition_sum_s(self) -> float:
        """Time integral of the inverse condition number."""
        return float(self.inverse_condition.sum() * PERIOD_S)


class _Cameras:
    """What the station knows of the robot's motion."""

    def __init__(self, trial: TailBeatTrial, generator: np.random.Generator) -> None:
        self._trial = trial
        self._generator = generator
        self._average = BeatAverage(trial.loops, PERIOD_S)
        self._before: FloatArray | None = None

    def see(self, state: FloatArray) -> tuple[FloatArray, Swimming]:
        """Return the measured pose (north, east, heading) and the mean motion."""
        std = [self._trial.camera_std_m] * 2 + [self._trial.camera_std_rad]
        pose = state[[0, 1, 5]] + std * self._generator.standard_normal(3)
        before = pose if self._before is None else self._before
        self._before = pose
        north, east = ((pose[:2] - before[:2]) / PERIOD_S).tolist()
        rate = math.remainder(float(pose[2] - before[2]), math.tau) / PERIOD_S
        return pose, self._average.step((north, east), float(pose[2]), rate)


class _Station:
    """Filter and controller; the target's velocity is known, as under output feedback."""

    def __init__(self, trial: TailBeatTrial, relative: FloatArray) -> None:
        config = trial.config
        self._q = filter_kernel.pack_filter(config)
        self._p = pack_control(config)
        is_predictive = config.barrier.controller.startswith("mpc_")
        self._predictive = PredictiveController(config) if is_predictive else None
        self.x = np.array([*relative, trial.heading_rad, 0.0])
        self._P = filter_kernel.start_covariance(trial.guess_variance_m2, self._q)

    def step(
        self, now: Swimming, range_m: float, velocity: tuple[float, float]
    ) -> tuple[float, float]:
        """Take in one measurement and return turn rate and acceleration."""
        q = self._q
        turn, gain = now.turn_rate_rad_s, now.acceleration_m_s2
        filter_kernel.predict(self.x, self._P, turn, gain, PERIOD_S, *velocity, q)
        filter_kernel.update(
            self.x, self._P, now.course_rad, now.speed_m_s, range_m, range_m > 0.0, q
        )
        if self._predictive is not None:
            P = filter_kernel.full_covariance(self._P)
            return self._predictive.command(self.x.copy(), velocity, P)
        x_r, y_r, psi, v = self.x.tolist()
        u1, u2, *_ = control_kernel.control_step(x_r, y_r, psi, v, *velocity, 0.0, 0.0, self._p)
        return u1, u2


def run_trial(trial: TailBeatTrial, seed: int) -> TailBeatOutcome:
    """Let the robot swim with its full dynamics until the time is over or it leaves the view.

    Source:
        Coleman, thesis, section 4.5; the tail by section 5.3, with the corrections of
        ``autonomy.vehicle.reference.dynamics``.
    """
    generator = np.random.default_rng(seed)
    spread = math.sqrt(trial.guess_variance_m2)
    offset = spread * generator.standard_normal(2)
    target = place(trial.config.target, 0.0)
    relative = np.array(trial.start_ne_m) - (target.north_m, target.east_m) + offset
    station, cameras = _Station(trial, relative), _Cameras(trial, generator)
    loop = InnerLoop(trial.loops, PERIOD_S)
    state, packed, water = _afloat(trial), trial.vehicle.packed(), _water()
    rows: list[tuple[float, ...]] = []
    steps = round(trial.config.motion.duration_s / PERIOD_S)
    for n in range(steps):
        t = n * PERIOD_S
        pose, now = cameras.see(state)
        target = place(trial.config.target, t)
        velocity = (target.north_m_s, target.east_m_s)
        noise = math.sqrt(trial.range_noise_m2) * float(generator.standard_normal())
        range_m = abs(math.hypot(pose[0] - target.north_m, pose[1] - target.east_m) + noise)
        beat = loop.step(*station.step(now, range_m, velocity), now)
        rows.append(_row(t, state, target[:2], velocity, station.x))
        if not trial.view.contains(float(state[0]), float(state[1]), 0.0):
            break
        command = np.array(
            [
                _AFLOAT_SHARE * trial.vehicle.limits.m0_min_kg,
                _trim_m(trial.vehicle, float(state[4])),
                beat.bias_rad,
                beat.amplitude_rad,
                beat.frequency_hz,
            ]
        )
        parts = round(PERIOD_S / PHYSICS_STEP_S)
        state = advance(state, command, packed, water, t, PHYSICS_STEP_S, parts)
    return _outcome(np.array(rows), has_left=len(rows) < steps)


def _afloat(trial: TailBeatTrial) -> FloatArray:
    state = np.zeros(15)
    state[0:2], state[5] = trial.start_ne_m, trial.heading_rad
    state[12] = _AFLOAT_SHARE * trial.vehicle.limits.m0_min_kg
    state[13] = trial.vehicle.swim.rp1_m
    return state


def _water() -> FloatArray:
    """Return still, deep water without walls, as ``advance`` takes it."""
    water = np.zeros(9)
    water[7] = _DEEP_M
    return water


def _trim_m(vehicle: Vehicle, pitch_rad: float) -> float:
    return vehicle.swim.rp1_m + abs(vehicle.limits.rp1_min_m) * (pitch_rad - _LEVEL_PITCH_RAD)


def _row(
    t: float,
    state: FloatArray,
    target: tuple[float, float],
    velocity: tuple[float, float],
    x: FloatArray,
) -> tuple[float, ...]:
    north, east, psi = (float(state[i]) for i in (0, 1, 5))
    forward = math.cos(state[4]) * float(state[6]) + math.sin(state[4]) * float(state[8])
    condition = control_kernel.inverse_condition(
        north - target[0], east - target[1], psi, forward, *velocity
    )
    return t, north, east, *target, north - float(x[0]), east - float(x[1]), condition


def _outcome(rows: FloatArray, *, has_left: bool) -> TailBeatOutcome:
    return TailBeatOutcome(
        time_s=rows[:, 0],
        own_ne_m=rows[:, 1:3],
        target_ne_m=rows[:, 3:5],
        estimate_ne_m=rows[:, 5:7],
        inverse_condition=rows[:, 7],
        has_left=has_left,
    )
