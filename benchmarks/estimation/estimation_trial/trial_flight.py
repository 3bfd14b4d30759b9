"""Trial flights: true dynamics, a drifting current and noisy sensors to judge estimators by.

A flight is a series of dives with fixes at the surface, at the onboard program's ten steps a
second. The same generator gives the same flight.
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.estimation.attitude import CORRECTION_S, RATE_SMOOTHING_S
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.surroundings import Surroundings
from benchmarks.estimation.estimation_trial.trial_flight_kernel import drift, fly, follow_attitude

PERIOD_S = 0.1
"""Time between two readings."""
PHYSICS_STEPS = 5
"""Runge-Kutta steps of the true motion in one period."""


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """Standard deviations of white errors, and of the constant error of the net buoyancy."""

    depth_m: float
    tilt_rad: float
    heading_rad: float
    gyro_rad_s: float
    buoyancy_bias_kg: float
    buoyancy_kg: float
    mass_position_m: float
    tail_rad: float
    fix_m: float
    fix_depth_m: float
    """True depth below which no fix is possible."""
    fix_period_s: float
    compass_rad: float = 0.0
    """By how much the compass turns every heading."""


@dataclass(frozen=True, slots=True)
class WaterMotion:
    """Eddies that add up to a random walk, and a current that stays for the whole flight."""

    drift_m_sqrt_s: float
    """Growth of the eddies' displacement, m per root second and axis."""
    correlation_s: float
    steady_std_m_s: float = 0.0
    """Standard deviation of the steady current, per axis, from flight to flight."""

    @property
    def eddy_std_m_s(self) -> float:
        """Standard deviation of the eddies' velocity, m/s."""
        return self.drift_m_sqrt_s / math.sqrt(2.0 * self.correlation_s)


@dataclass(frozen=True, slots=True)
class TagErrors:
    """How well, and how long, overhead cameras see the robot's tags."""

    position_m: float = 0.03
    """Standard deviation of one tag's position, per axis."""
    heading_rad: float = 0.05
    """Standard deviation of the heading that one tag shows."""
    tags: int = 2
    """Tags on the robot, one on each wing."""
    outlier_share: float = 0.01
    """Part of the detections that are grossly wrong."""
    outlier_m: float = 1.0
    """Standard deviation of a grossly wrong position."""
    visible_s: float = 10.0
    """Mean time for which the tags are seen without a break."""
    hidden_s: float = 5.0
    """Mean time for which none is seen."""


@dataclass(frozen=True, slots=True)
class Flight:
    """One trial flight: the truth and what the robot's sensors said of it, row by row."""

    command: FloatArray
    """In force during the period that ends with the row, shape ``(n, 5)``."""
    truth: FloatArray
    """States of ``extended_kernel.advance``, shape ``(n, 15)``."""
    current_ne: FloatArray
    """Of the water, shape ``(n, 2)``, m/s."""
    attitude: FloatArray
    """Roll, pitch and heading by the attitude filter, shape ``(n, 3)``."""
    rates: FloatArray
    """Smoothed body rates, shape ``(n, 3)``."""
    gyro: FloatArray
    """Body rates as the gyro says, shape ``(n, 3)``."""
    measured_attitude: FloatArray
    """Roll, pitch and heading as tilt sensors and compass say, shape ``(n, 3)``."""
    actuators: FloatArray
    """Net mass kg, sliding mass m and tail rad as fed back, shape ``(n, 3)``."""
    depth_m: FloatArray
    """From the pressure sensor, shape ``(n,)``."""
    fix_ne: FloatArray
    """Horizontal fixes, shape ``(n, 2)``; zeros where there is none."""
    has_fix: BoolArray
    """Where there is one, shape ``(n,)``."""
    buoyancy_bias_kg: float
    """What the feedback of the net buoyancy says too much."""


def dives(
    vehicle: Vehicle, duration_s: float, dive_s: float, rng: np.random.Generator
) -> FloatArray:
    """Return commands of dive after dive, each with a rudder of its own, shape ``(n, 5)``.

    Two fifths of each dive sink, the rest rises and waits at the surface.
    """
    limits = vehicle.limits
    n = round(duration_s / PERIOD_S)
    into = np.arange(n) * PERIOD_S
    sinks = into % dive_s < 0.4 * dive_s
    tails = rng.uniform(-0.4, 0.4, math.ceil(duration_s / dive_s))
    command = np.zeros((n, 5))
    command[:, 0] = np.where(sinks, 0.5 * limits.m0_max_kg, 0.5 * limits.m0_min_kg)
    command[:, 1] = np.where(sinks, 0.6 * limits.rp1_max_m, 0.5 * limits.rp1_min_m)
    command[:, 2] = tails[(into / dive_s).astype(np.int64)]
    return command


def fly_trial(
    vehicle: Vehicle,
    errors: SensorErrors,
    water: WaterMotion,
    command: FloatArray,
    rng: np.random.Generator,
    steady_ne_m_s: FloatArray | None = None,
) -> Flight:
    """Fly commands from the origin's surface, in a random heading, current and ballast error.

    Args:
        vehicle: True model.
        errors: Of the sensors.
        water: How the water moves.
        command: Of each period, shape ``(n, 5)``.
        rng: Source of randomness.
        steady_ne_m_s: Current beside the eddies, shape ``(2,)``, or ``(n, 2)`` where it changes;
            without it one is drawn as ``water`` says.
    """
    n = command.shape[0]
    noise = rng.standard_normal
    start = np.zeros(15)
    start[5] = rng.uniform(-math.pi, math.pi)
    start[12] = 0.3 * vehicle.limits.m0_min_kg
    bias = errors.buoyancy_bias_kg * noise()
    drawn = water.steady_std_m_s * noise(2)
    steady = drawn if steady_ne_m_s is None else steady_ne_m_s
    current = steady + drift(noise((n, 2)), water.eddy_std_m_s, water.correlation_s, PERIOD_S)
    truth = fly(
        start, command, current, vehicle.packed(), Surroundings().packed(), PERIOD_S, PHYSICS_STEPS
    )
    tilt_heading = np.array([errors.tilt_rad, errors.tilt_rad, errors.heading_rad])
    measured = truth[:, 3:6] + tilt_heading * noise((n, 3))
    measured[:, 2] += errors.compass_rad
    gyro = truth[:, 9:12] + errors.gyro_rad_s * noise((n, 3))
    attitude, rates = follow_attitude(
        measured, gyro, PERIOD_S, PERIOD_S / CORRECTION_S, PERIOD_S / RATE_SMOOTHING_S
    )
    feedback = np.array([errors.buoyancy_kg, errors.mass_position_m, errors.tail_rad])
    every = round(errors.fix_period_s / PERIOD_S)
    has_fix = (truth[:, 2] <= errors.fix_depth_m) & (np.arange(n) % every == 0)
    return Flight(
        command=command,
        truth=truth,
        current_ne=current,
        attitude=attitude,
        rates=rates,
        gyro=gyro,
        measured_attitude=measured,
        actuators=truth[:, 12:15] + feedback * noise((n, 3)) + [bias, 0.0, 0.0],
        depth_m=truth[:, 2] + errors.depth_m * noise(n),
        fix_ne=has_fix[:, None] * (truth[:, :2] + errors.fix_m * noise((n, 2))),
        has_fix=has_fix,
        buoyancy_bias_kg=float(bias),
    )


def sightings(
    flight: Flight, errors: TagErrors, rng: np.random.Generator
) -> tuple[FloatArray, BoolArray]:
    """Return the poses that tags show, shape ``(n, tags, 4)``, and where they are seen.

    Tags come in and out of sight together, as a Markov chain; a reflection hides them from all
    cameras.

    Args:
        flight: What is looked at.
        errors: Of the detections.
        rng: Source of randomness.
    """
    n = len(flight.truth)
    appears, hides = PERIOD_S / errors.hidden_s, PERIOD_S / errors.visible_s
    draws = rng.random(n)
    visible = np.ones(n, dtype=np.bool_)
    for k in range(1, n):
        visible[k] = draws[k] >= hides if visible[k - 1] else draws[k] < appears
    shape = (n, errors.tags)
    is_outlier = rng.random(shape) < errors.outlier_share
    is_outlier[0] = False  # whoever sets the robot in looks at the first pose
    noise = rng.standard_normal((*shape, 4))
    std = np.array([errors.position_m] * 3 + [errors.heading_rad])
    wild = np.array([errors.outlier_m] * 3 + [1.0])
    poses = flight.truth[:, None, [0, 1, 2, 5]] + np.where(is_outlier[..., None], wild, std) * noise
    return poses, np.repeat(visible[:, None], errors.tags, axis=1)
