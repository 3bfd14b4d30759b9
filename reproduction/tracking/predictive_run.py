"""Runs of range-only tracking under any controller that sees the estimate and its covariance."""

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.control import control_kernel
from autonomy.tracking.filter import filter_kernel
from reproduction.tracking import metrics
from reproduction.tracking.run import Outcome, first_estimate
from reproduction.tracking.scenario import Scenario, draws
from reproduction.tracking.target_path_kernel import pack_path, place_kernel
from reproduction.tracking.unicycle import advance_kernel

Steer: TypeAlias = Callable[[FloatArray, tuple[float, float], FloatArray], tuple[float, float]]
"""Takes the estimate ``(4,)``, the target's velocity (m/s) and the covariance ``(4, 4)``; returns
turn rate (rad/s) and acceleration (m/s2). ``PredictiveController.command`` is one."""


def run_steered(scenario: Scenario, steer: Steer, seed: int) -> Outcome:
    """Run a scenario under output feedback, the target's velocity known.

    Measure, correct the estimate, control, note, let the plant move, predict the estimate: as
    ``reproduction.tracking.run.run`` does under OF, with the same random numbers.

    Args:
        scenario: Start, target, noise and filter.
        steer: The controller, fresh for this run.
        seed: Of the noise and the first estimate's error.

    Returns:
        Score and record; the record's columns of the pursuit law and of the status stay 0.
    """
    random, dt_s = draws(scenario, seed), scenario.step_s
    path, q = pack_path(scenario.config.target), filter_kernel.pack_filter(scenario.config)
    believed = first_estimate(scenario, random)
    P = filter_kernel.start_covariance(scenario.believed_variance_m2, q)
    north, east, psi, v = map(float, scenario.start)
    record = np.zeros((scenario.steps, metrics.RECORD_SIZE))
    record[:, metrics.WEIGHT] = 1.0
    for step, (row, noise) in enumerate(zip(record, random.noise.tolist(), strict=True)):
        time_s = step * dt_s
        t_n, t_e, vt_n, vt_e = place_kernel(path, time_s)
        r_n, r_e = north - t_n, east - t_e
        heard = math.hypot(r_n, r_e) + noise[0]
        has_range = bool(random.has_range[step])
        filter_kernel.update(believed, P, psi + noise[1], v + noise[2], heard, has_range, q)
        u1, u2 = steer(believed, (vt_n, vt_e), filter_kernel.full_covariance(P))
        row[: metrics.NOMINAL_TURN_RATE] = (
            *(time_s, north, east, psi, v, t_n, t_e),
            *(believed[0], believed[1], u1, u2),
        )
        c, s = math.cos(believed[2]), math.sin(believed[2])
        moved_n, moved_e = believed[3] * c - vt_n, believed[3] * s - vt_e
        row[metrics.DETERMINANT] = believed[0] * moved_e - believed[1] * moved_n
        row[metrics.INVERSE_CONDITION] = control_kernel.inverse_condition(
            r_n, r_e, psi, v, vt_n, vt_e
        )
        north, east, psi, v = advance_kernel(north, east, psi, v, u1, u2, dt_s)
        _, _, vt_n, vt_e = place_kernel(path, time_s + 0.5 * dt_s)
        filter_kernel.predict(believed, P, u1, u2, dt_s, vt_n, vt_e, q)
    return Outcome(metrics.score(record, dt_s), record)
