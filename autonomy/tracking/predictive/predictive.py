"""Predictive controllers that weigh tracking against observability: the barrier's rivals."""

import math
from collections.abc import Iterator

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.predictive.config import ObjectiveName, PredictiveConfig
from autonomy.tracking.predictive.kernel import (
    CONDITION,
    DETERMINANT,
    NONE,
    SMOOTHING,
    TRACE,
)
from autonomy.tracking.predictive.search import Search, SearchOutcome
from autonomy.tracking.reference.filter import Estimate, predict, update

NUMBERS: dict[ObjectiveName, int] = {
    "mpc_none": NONE,
    "mpc_trace": TRACE,
    "mpc_determinant": DETERMINANT,
    "mpc_condition": CONDITION,
}
SOLVER = "projected BFGS, compiled, exact gradient, warm start by shift"
"""Names the solver in results: at ten iterations it changes them as much as the objective does."""


class PredictiveController:
    """Plans a second ahead at every call and does the first step of the plan.

    It keeps its plan from call to call, shifted by one step, so one object steers one robot.
    """

    def __init__(self, config: TrackingConfig, prediction: PredictiveConfig | None = None) -> None:
        """Begin with a plan that turns nowhere.

        Args:
            config: Filter, ranging and limits; ``barrier.controller`` names the objective, and one
                that is none of a predictive controller counts as O0.
            prediction: Horizon, weights and iterations; the thesis's by default.
        """
        self._search = Search(pack_predictive(config, prediction or PredictiveConfig()))

    def command(
        self, z: FloatArray, target_velocity: tuple[float, float], P: FloatArray
    ) -> tuple[float, float]:
        """Return turn rate (rad/s) and acceleration (m/s2) for now, always finite and in the box.

        Args:
            z: Estimate x_r, y_r (m), psi (rad), v (m/s), shape ``(4,)``.
            target_velocity: North and east, m/s.
            P: Covariance of the estimate, shape ``(4, 4)``; it counts in O1 only.
        """
        found = self.plan(z, target_velocity, P)
        return found.turn_rate_rad_s, found.acceleration_m_s2

    def plan(
        self, z: FloatArray, target_velocity: tuple[float, float], P: FloatArray
    ) -> SearchOutcome:
        """Search once, as ``command`` does, and tell how the search went."""
        return self._search.step(z, target_velocity, P)


def pack_predictive(config: TrackingConfig, prediction: PredictiveConfig) -> FloatArray:
    """Return the settings as the kernels read them, shape ``(SETTINGS_SIZE,)``."""
    objective = _objective(config)
    motion, filter_, ranging = config.motion, config.filter, config.ranging
    low, high = motion.acceleration_min_m_s2, motion.acceleration_max_m_s2
    return np.array(
        [
            NUMBERS[objective],
            prediction.weight(objective),
            prediction.step_s,
            prediction.steps,
            prediction.iterations,
            0.0,
            motion.turn_rate_max_rad_s,
            0.5 * (high + low),
            0.5 * (high - low),
            filter_.position_density_m2_s,
            filter_.heading_density_rad2_s,
            filter_.speed_density_m2_s3,
            ranging.variance_m2,
            filter_.heading_variance_rad2,
            filter_.speed_variance_m2_s2,
            motion.speed_min_m_s,
            motion.speed_max_m_s,
        ]
    )


def cost(
    z: FloatArray,
    target_velocity: tuple[float, float],
    P: FloatArray,
    inputs: FloatArray,
    config: TrackingConfig,
    prediction: PredictiveConfig,
) -> float:
    r"""Return what a plan costs, written as the thesis states it.

    .. math:: J = \sum_k \left(a |\tau_k|^2 + (1 - a) O_k\right) \Delta t

    Args:
        z: Estimate x_r, y_r (m), psi (rad), v (m/s), shape ``(4,)``.
        target_velocity: North and east, m/s; the target stays in the prediction of tau, and its
            velocity counts in the observability matrix.
        P: Covariance of the estimate, shape ``(4, 4)``.
        inputs: Turn rate (rad/s) and acceleration (m/s2) of each step, shape ``(steps, 2)``.
        config: Objective and filter.
        prediction: Weights and step.

    Source:
        Coleman, thesis, section 4.4.2.1, Eq. (4.23).
    """
    objective = _objective(config)
    a, total = prediction.weight(objective), 0.0
    for estimate in _predictions(z, P, inputs, config, prediction.step_s):
        state = estimate.x
        distance_squared = float(state[:2] @ state[:2])
        match objective:
            case "mpc_none":
                surrogate = 0.0
            case "mpc_trace":
                surrogate = float(np.trace(estimate.P))
            case "mpc_determinant":
                surrogate = -(float(np.linalg.det(_rows(state, target_velocity))) ** 2)
            case "mpc_condition":
                surrogate = _smoothed_condition(_rows(state, target_velocity))
        total += (a * distance_squared + (1.0 - a) * surrogate) * prediction.step_s
    return total


def _objective(config: TrackingConfig) -> ObjectiveName:
    name = config.barrier.controller
    return "mpc_none" if name == "barrier" or name == "nominal" else name


def _rows(state: FloatArray, target_velocity: tuple[float, float]) -> FloatArray:
    """Return position and relative velocity, whose matrix has the determinant of O_p."""
    x, y, psi, v = state
    moved = (v * math.cos(psi) - target_velocity[0], v * math.sin(psi) - target_velocity[1])
    return np.array([[x, y], moved])


def _smoothed_condition(rows: FloatArray) -> float:
    """Return the condition number with sqrt(det^2 + 1e-6) for |det|."""
    largest = float(np.linalg.norm(rows, 2))
    determinant = float(np.linalg.det(rows))
    return largest**2 / math.sqrt(determinant**2 + SMOOTHING)


def _predictions(
    z: FloatArray, P: FloatArray, inputs: FloatArray, config: TrackingConfig, dt_s: float
) -> Iterator[Estimate]:
    """Yield what the filter will believe after each step if it hears what it expects.

    The target stays: its velocity is not part of this prediction.
    """
    estimate = Estimate(np.array(z), np.array(P))
    for turn_rate, acceleration in inputs:
        estimate = predict(estimate, (turn_rate, acceleration), dt_s, (0.0, 0.0), config)
        x, y, psi, v = estimate.x
        estimate, _ = update(estimate, psi, v, math.hypot(x, y), config)
        yield estimate
