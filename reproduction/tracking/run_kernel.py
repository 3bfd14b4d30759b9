"""Compiled closed loop of range-only tracking: estimator, controller and plant of a whole run.

``run`` has the readable form. Nothing is allocated within the loop, and the interpreter's lock is
released, so that several runs go at once in threads.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.tracking.control import control_kernel
from autonomy.tracking.filter import filter_kernel
from reproduction.tracking import metrics, target_path_kernel, unicycle

control_step = control_kernel.control_step
inverse_condition = control_kernel.inverse_condition
update_into = filter_kernel.update_into
predict_into = filter_kernel.predict_into
velocity_into = filter_kernel.velocity_into
place_kernel = target_path_kernel.place_kernel
advance_kernel = unicycle.advance_kernel
"""Names that numba resolves once, when it compiles."""

VELOCITY_SIZE = filter_kernel.VELOCITY_SIZE
R_TARGET = filter_kernel.R_TARGET
TIME, TARGET_NORTH, ESTIMATE_NORTH = metrics.TIME, metrics.TARGET_NORTH, metrics.ESTIMATE_NORTH
TURN_RATE, DETERMINANT, WEIGHT = metrics.TURN_RATE, metrics.DETERMINANT, metrics.WEIGHT


@kernel
def run_into(
    start: FloatArray,
    path: FloatArray,
    believed: FloatArray,
    P: FloatArray,
    noise: FloatArray,
    has_range: FloatArray,
    is_output_feedback: bool,
    is_velocity_estimated: bool,
    p: FloatArray,
    q: FloatArray,
    dt_s: float,
    record: FloatArray,
) -> None:
    """Run one closed loop, with the single filter.

    Args:
        start: North and east (m), heading (rad), speed (m/s) of the robot, shape ``(4,)``.
        path: Of the target, from ``target_path_kernel.pack_path``.
        believed: First estimate, shape ``(4,)``; changed.
        P: Its packed covariance, shape ``(10,)``; changed.
        noise: Added to range, heading and speed, shape ``(n, 3)``.
        has_range: Not 0 where a range comes, shape ``(n,)``.
        is_output_feedback: Whether the controller sees the estimate rather than the true state.
        is_velocity_estimated: Whether the target's velocity is estimated rather than known.
        p: From ``pack_control``.
        q: From ``pack_filter``.
        dt_s: Length of a step, s.
        record: Filled, shape ``(n, metrics.RECORD_SIZE)``.
    """
    north, east, psi, v = start[0], start[1], start[2], start[3]
    motion = np.zeros(VELOCITY_SIZE)
    gone_n, gone_e = 0.0, 0.0
    # The target's first place is as uncertain as the first estimate.
    velocity_into(motion, -believed[0], -believed[1], 0.0, P[0], q)
    for k in range(noise.shape[0]):
        t = k * dt_s
        t_n, t_e, vt_n, vt_e = place_kernel(path, t)
        r_n, r_e = north - t_n, east - t_e
        heard = math.sqrt(r_n * r_n + r_e * r_e) + noise[k, 0]
        update_into(believed, P, psi + noise[k, 1], v + noise[k, 2], heard, has_range[k] != 0.0, q)
        seen_n, seen_e = vt_n, vt_e
        if is_velocity_estimated:
            place_n, place_e = gone_n - believed[0], gone_e - believed[1]
            velocity_into(motion, place_n, place_e, dt_s if k > 0 else 0.0, q[R_TARGET], q)
            seen_n, seen_e = motion[2], motion[3]
        if is_output_feedback:
            u1, u2, n1, n2, det, _, status = control_step(
                believed[0], believed[1], believed[2], believed[3], seen_n, seen_e, 0.0, 0.0, p
            )
        else:
            u1, u2, n1, n2, det, _, status = control_step(r_n, r_e, psi, v, vt_n, vt_e, 0.0, 0.0, p)
        row = record[k]
        row[TIME], row[1], row[2], row[3], row[4] = t, north, east, psi, v
        row[TARGET_NORTH], row[TARGET_NORTH + 1] = t_n, t_e
        row[ESTIMATE_NORTH], row[ESTIMATE_NORTH + 1] = believed[0], believed[1]
        row[TURN_RATE], row[TURN_RATE + 1], row[TURN_RATE + 2], row[TURN_RATE + 3] = u1, u2, n1, n2
        row[DETERMINANT], row[DETERMINANT + 1] = det, status
        row[DETERMINANT + 2] = inverse_condition(r_n, r_e, psi, v, vt_n, vt_e)
        row[WEIGHT] = 1.0
        north, east, psi, v = advance_kernel(north, east, psi, v, u1, u2, dt_s)
        if not is_velocity_estimated:
            _, _, seen_n, seen_e = place_kernel(path, t + 0.5 * dt_s)
        own_n, own_e = predict_into(believed, P, u1, u2, dt_s, seen_n, seen_e, q)
        gone_n += own_n
        gone_e += own_e


def warm_up() -> None:
    """Compile the loop."""
    p, q = np.ones(control_kernel.SIZE), np.ones(filter_kernel.FILTER_SIZE)
    start = np.array([-1.0, 0.0, 0.1, 0.1])
    P = filter_kernel.start_covariance(0.1, q)
    record = np.empty((1, metrics.RECORD_SIZE))
    path, noise = np.ones(target_path_kernel.PATH_SIZE), np.zeros((1, 3))
    run_into(start, path, start.copy(), P, noise, np.ones(1), True, True, p, q, 0.1, record)
