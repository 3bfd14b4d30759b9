"""Every estimator over a trial flight: its errors, and the covariance that it claimed."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.estimation import model_kernel
from autonomy.estimation.config import (
    EstimatorConfig,
    ModelFilterConfig,
)
from autonomy.estimation.fix_watch import SHORTEST_DIVE_S
from autonomy.estimation.kernel import turn
from autonomy.estimation.model_filter import LONGEST_STEP_S as MODEL_STEP_S
from autonomy.estimation.model_filter import first_belief, process_noise
from autonomy.estimation.position_filter import position_noise
from autonomy.estimation.tag_filter import TagFilterConfig, tag_noise
from autonomy.estimation.telling_stay import telling_stay_s
from autonomy.estimation.velocity_observer import LONGEST_STEP_S, observer_gains
from autonomy.frames import wrap_angle
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.surroundings import Surroundings
from benchmarks.estimation.estimation_trial import trial_flight_kernel
from benchmarks.estimation.estimation_trial.dead_reckoning import (
    DeadReckoningConfig,
    velocity_errors,
)
from benchmarks.estimation.estimation_trial.trial_flight import PERIOD_S, Flight


@dataclass(frozen=True, slots=True)
class Track:
    """Errors of one estimator over one flight."""

    error: FloatArray
    """Truth less estimate, shape ``(n, d)``."""
    covariance: FloatArray
    """What the estimator said of it, shape ``(n, d, d)``."""


@dataclass(frozen=True, slots=True)
class ModelTrack:
    """Errors of the model filter over one flight."""

    position: Track
    """Northing and easting, m."""
    velocity: Track
    """Through the water in body axes, m/s."""
    bias: Track
    """Of the net buoyancy's feedback, kg."""
    current_ne: FloatArray
    """Error of the whole current, shape ``(n, 2)``, m/s."""


def observed_velocity(
    flight: Flight, vehicle: Vehicle, estimator: EstimatorConfig
) -> tuple[FloatArray, FloatArray]:
    """Return what the velocity observer reports, in body axes and in NED, both ``(n, 3)``."""
    start = np.zeros(15)
    start[2] = flight.depth_m[0]
    return trial_flight_kernel.follow_observer(
        start,
        flight.command,
        flight.attitude,
        flight.rates,
        flight.actuators,
        flight.depth_m,
        estimator.surface_depth_m,
        observer_gains(estimator),
        vehicle.packed(),
        Surroundings().packed(),
        PERIOD_S,
        math.ceil(PERIOD_S / LONGEST_STEP_S),
    )


def observer_covariance(
    flight: Flight,
    body: FloatArray,
    vehicle: Vehicle,
    estimator: EstimatorConfig,
    config: ModelFilterConfig,
) -> FloatArray:
    """Return how well the observer knows the velocities ``body``, shape ``(n, 3, 3)``, m2/s2.

    It is propagated from the stated noise of depth, gyro and attitude, the ballast error, and the
    error of the model's coefficients.
    """
    _, S = first_belief(estimator, config, (0.0, 0.0, 0.0), 0.0)
    return trial_flight_kernel.follow_doubt(
        S,
        body,
        flight.command,
        flight.attitude,
        flight.rates,
        flight.actuators,
        flight.depth_m,
        estimator.surface_depth_m,
        estimator.depth_std_m**2,
        observer_gains(estimator),
        vehicle.packed(),
        Surroundings().packed(),
        process_noise(estimator, config),
        PERIOD_S,
        math.ceil(PERIOD_S / MODEL_STEP_S),
    )


def by_position_filter(
    flight: Flight, velocity_ned: FloatArray, estimator: EstimatorConfig
) -> Track:
    """Follow a flight with the position filter of thesis 5.4.2, from the true start.

    ``velocity_ned`` is what its observer says, shape ``(n, 3)``, m/s.
    """
    axes = np.zeros((3, 5))
    axes[:, 2] = estimator.fix_std_m**2
    axes[:, 4] = 0.1**2
    position, variance = trial_flight_kernel.follow_position(
        axes,
        velocity_ned,
        flight.depth_m,
        flight.fix_ne,
        _believable(flight, estimator),
        position_noise(estimator),
        PERIOD_S,
    )
    return _horizontal(flight, position, variance)


def by_dead_reckoning(
    flight: Flight,
    velocity_ned: FloatArray,
    estimator: EstimatorConfig,
    config: DeadReckoningConfig,
) -> Track:
    """Follow a flight by dead reckoning between fixes, from a fix at the true start.

    ``velocity_ned`` is what its observer says, shape ``(n, 3)``, m/s.
    """
    errors = velocity_errors(estimator, config)
    axes = np.zeros((2, 2 + len(errors)))
    axes[:, 1] = estimator.fix_std_m**2
    position, variance = trial_flight_kernel.follow_reckoning(
        axes,
        velocity_ned,
        flight.fix_ne,
        _believable(flight, estimator),
        estimator.fix_std_m**2,
        errors,
        PERIOD_S,
    )
    return _horizontal(flight, position, variance)


def by_model_filter(
    flight: Flight, vehicle: Vehicle, estimator: EstimatorConfig, config: ModelFilterConfig
) -> ModelTrack:
    """Follow a flight with the model filter, from a fix at the true start."""
    x, S = first_belief(estimator, config, (0.0, 0.0, 0.0), estimator.fix_std_m)
    states, covariances = trial_flight_kernel.follow_model(
        x,
        S,
        flight.command,
        flight.attitude,
        flight.gyro,
        flight.actuators,
        flight.depth_m,
        flight.fix_ne,
        _believable(flight, estimator),
        np.array([estimator.depth_std_m, estimator.fix_std_m]) ** 2,
        config.outlier.limit,
        config.outlier.patience,
        vehicle.packed(),
        Surroundings().packed(),
        process_noise(estimator, config),
        PERIOD_S,
        math.ceil(PERIOD_S / MODEL_STEP_S),
        SHORTEST_DIVE_S,
        telling_stay_s(estimator, config.current.steady_std_m_s),
    )
    place = slice(model_kernel.NORTH, model_kernel.EAST + 1)
    motion = slice(model_kernel.FORWARD, model_kernel.BIAS)
    ballast = slice(model_kernel.BIAS, model_kernel.DRAG)
    steady = states[:, model_kernel.STEADY_NORTH : model_kernel.EDDY_NORTH]
    return ModelTrack(
        Track(flight.truth[:, :2] - states[:, place], covariances[:, place, place]),
        Track(flight.truth[:, 6:9] - states[:, motion], covariances[:, motion, motion]),
        Track(flight.buoyancy_bias_kg - states[:, ballast], covariances[:, ballast, ballast]),
        flight.current_ne - steady - states[:, model_kernel.EDDY_NORTH :],
    )


def by_tag_filter(
    flight: Flight, poses: FloatArray, seen: BoolArray, config: TagFilterConfig
) -> Track:
    """Follow a flight with the tag filter; errors are north, east, down and heading.

    Args:
        flight: The flight.
        poses: What tags show, shape ``(n, tags, 4)``.
        seen: Whether they are seen, shape ``(n,)``.
        config: Noise that the filter assumes.
    """
    density, variance, tag_variance = tag_noise(config)
    seen = seen.copy()
    seen[0] = False  # the first pose is where the filter begins
    axes = np.zeros((4, 5))
    axes[:, 0] = poses[0, 0]
    axes[3, 0] = turn(axes[3, 0])
    axes[:, 2] = tag_variance
    axes[:, 4] = 0.1**2
    estimate, spread = trial_flight_kernel.follow_tags(
        axes,
        flight.depth_m,
        flight.measured_attitude,
        flight.gyro,
        poses,
        seen,
        density,
        variance,
        tag_variance,
        config.outlier.limit,
        config.outlier.patience,
        PERIOD_S,
    )
    error = flight.truth[:, [0, 1, 2, 5]] - estimate
    error[:, 3] = wrap_angle(error[:, 3])
    return Track(error, spread[..., None] * np.eye(4))


def _believable(flight: Flight, estimator: EstimatorConfig) -> BoolArray:
    return flight.has_fix & (flight.depth_m <= estimator.surface_depth_m)


def _horizontal(flight: Flight, position: FloatArray, variance: FloatArray) -> Track:
    return Track(flight.truth[:, :2] - position, variance[..., None] * np.eye(2))
