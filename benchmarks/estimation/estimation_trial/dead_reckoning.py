"""Dead reckoning: where the robot should be when tags or GPS are gone.

The model's velocity through the water and the attitude carry the position on (thesis section
3.4.3). Three errors of the velocity are *considered* (Schmidt's filter): eddies, the steady current
and the model's own error. They widen the covariance and are never estimated, so the covariance is
honest and the position is what the model's velocity alone can give. No robot flies by it: it is
what the filter on the vehicle's model is measured against.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.configuration import Configuration, quantity
from autonomy.estimation.config import EstimatorConfig, WaterMotionConfig


class DeadReckoningConfig(Configuration):
    """What dead reckoning does not see: moving water, and errors of the model's velocity."""

    current: WaterMotionConfig = quantity(WaterMotionConfig(), title="Current")
    """Motion of the water."""
    speed_error_m_s: float = quantity(
        0.001, "m/s", title="Error of the model's speed", ge=0.0, le=1.0, display_unit="mm/s"
    )
    """Standard deviation per axis of the velocity that the model gives, beyond the current."""
    speed_error_correlation_s: float = quantity(
        40.0, "s", title="Correlation of that error", gt=0.0, le=1e7, advanced=True
    )
    """Time over which it stays: about half a dive, since wrong ballast errs down and up alike."""


DEAD_RECKONING_PRESETS: dict[str, DeadReckoningConfig] = {
    "miniglider": DeadReckoningConfig(),
    "grace3": DeadReckoningConfig(
        current=WaterMotionConfig(eddy_correlation_s=20.0),
        speed_error_m_s=0.003,
        speed_error_correlation_s=80.0,
    ),
}
"""Settings by vehicle: a tank that the robots stir, and a lake."""


@kernel
def reckon(
    axis: FloatArray, dt_s: float, velocity: float, noise: FloatArray, silence_variance: float
) -> None:
    """Carry one axis of dead reckoning on by a velocity through the water.

    Errors of the velocity are considered and never estimated, each an Ornstein-Uhlenbeck process:
    their covariance with the position grows exactly as theirs does.

    Args:
        axis: Position, its variance, and its covariance with each of ``noise``'s processes.
        dt_s: Time since the last step, s.
        velocity: Through the water along this axis, m/s.
        noise: A row of variance and correlation time per process, shape ``(n, 2)``.
        silence_variance: Further variance of a step that was too long, m2.
    """
    axis[0] += dt_s * velocity
    axis[1] += silence_variance
    for i in range(noise.shape[0]):
        variance, correlation = noise[i, 0], noise[i, 1]
        x = dt_s / correlation
        kept = math.exp(-x)
        reach = correlation * (1.0 - kept)
        fresh = 2.0 / 3.0 * x**3  # what is left below where the difference would cancel
        if x > 1e-3:
            fresh = 2.0 * x - 3.0 + 4.0 * kept - kept * kept
        axis[1] += 2.0 * reach * axis[2 + i]
        axis[1] += variance * (reach * reach + correlation * correlation * fresh)
        axis[2 + i] = kept * axis[2 + i] + variance * reach


@kernel
def fix_reckoning(axis: FloatArray, fix: float, variance: float) -> None:
    """Take a fix into one axis of dead reckoning; what is only considered is not corrected."""
    lasting = variance / (axis[1] + variance)
    axis[0] += (1.0 - lasting) * (fix - axis[0])
    axis[1] *= lasting
    for i in range(2, axis.shape[0]):
        axis[i] *= lasting


def velocity_errors(estimator: EstimatorConfig, config: DeadReckoningConfig) -> FloatArray:
    """Return variance and correlation time of each error of the velocity, shape ``(3, 2)``.

    The rows are eddies, steady current and the model's own error.
    """
    current = config.current
    return np.array(
        [
            (current.eddy_std_m_s(estimator.drift_m_sqrt_s) ** 2, current.eddy_correlation_s),
            (current.steady_std_m_s**2, current.steady_correlation_s),
            (config.speed_error_m_s**2, config.speed_error_correlation_s),
        ]
    )
