"""What is known of a segment's first state before the model is asked."""

import math

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.vehicle.config import Vehicle

_FIRST_S = 3.0
"""Rates and depth rate are read off the beginning of a segment, this long."""
_POSITION_STD_M = 10.0
_DEPTH_STD_M = 1.0
_ATTITUDE_STD_RAD = 0.5
_RATE_STD_RAD_S = 0.2
_STEEP = 0.2
_USUAL_SHARE = 0.4
_LEAST_SHARE = 0.2
"""Forward speeds at the start as parts of the top speed."""


def initial_precision(vehicle: Vehicle) -> FloatArray:
    """Return one over the variances of the initial states' prior, shape ``(12,)``.

    The prior is broad: some ten times what the first rows tell, and for the velocity, of which
    they tell only the vertical part, the speed that the vehicle can reach.
    """
    std = np.array(
        [
            *(_POSITION_STD_M, _POSITION_STD_M, _DEPTH_STD_M),
            *(_ATTITUDE_STD_RAD,) * 3,
            *(top_speed(vehicle),) * 3,
            *(_RATE_STD_RAD_S,) * 3,
        ]
    )
    return 1.0 / std**2


def top_speed(vehicle: Vehicle) -> float:
    """Return the speed at which constant drag balances the heaviest net mass, m/s."""
    p, limits = vehicle.parameters, vehicle.limits
    weight_n = max(limits.m0_max_kg, -limits.m0_min_kg) * p.gravity_m_s2
    drag = 0.5 * p.water_density_kg_m3 * p.area_m2 * max(abs(p.drag_0), 1e-3)
    return math.sqrt(weight_n / drag)


def initial_guess(
    time_s: FloatArray,
    measured: FloatArray,
    weight: FloatArray,
    segment_row: IntArray,
    vehicle: Vehicle,
) -> FloatArray:
    """Return the most likely first state of each segment by its first rows, ``(segments, 12)``.

    Position and attitude are those of a straight line through the first seconds; the velocity is
    straight ahead.

    Args:
        time_s: Shape ``(rows,)``.
        measured: Position NED and attitude, shape ``(rows, 6)``.
        weight: 0 where nothing was measured, shape ``(rows, 6)``.
        segment_row: First row of each segment and one past the last, ``(segments + 1,)``.
        vehicle: Its top speed is the size of an unknown velocity.
    """
    guess = np.zeros((segment_row.size - 1, 12))
    speed = top_speed(vehicle)
    for segment in range(guess.shape[0]):
        rows = slice(segment_row[segment], segment_row[segment + 1])
        at = time_s[rows] - time_s[segment_row[segment]]
        early = np.flatnonzero(at <= max(_FIRST_S, at[1]))
        table = measured[rows].copy()
        table[:, 3:] = np.unwrap(table[:, 3:], axis=0)
        lines = [
            np.polynomial.polynomial.polyfit(at[early], table[early, k], 1) for k in (2, 3, 4, 5)
        ]
        fixed = np.flatnonzero(weight[rows, 0] > 0.0)
        guess[segment, :2] = _horizontal(table, int(fixed[0]) if fixed.size else 0)
        guess[segment, 2:6] = [line[0] for line in lines]
        guess[segment, 6:9] = _velocity(guess[segment, 4], float(lines[0][1]), speed)
        guess[segment, 9:12] = _body_rates(guess[segment, 3:6], np.array([k[1] for k in lines[1:]]))
    return guess


def _horizontal(table: FloatArray, row: int) -> FloatArray:
    place = table[row, :2]
    return np.where(np.isfinite(place), place, 0.0)


def _velocity(pitch: float, depth_rate: float, speed: float) -> FloatArray:
    """Return a velocity straight ahead, as fast as the rate of depth says where the pitch is steep.

    A start that slides sideways, as the rate of depth of a level robot would have it, leads the
    descent into motions that tumble.
    """
    along = -math.sin(pitch)
    ahead = depth_rate / along if abs(along) > _STEEP else _USUAL_SHARE * speed
    return np.array([min(max(ahead, _LEAST_SHARE * speed), speed), 0.0, 0.0])


def _body_rates(attitude: FloatArray, euler_rates: FloatArray) -> FloatArray:
    """Return the angular velocity in body axes that makes the Euler angles change so."""
    roll, pitch, _ = attitude
    sf, cf = math.sin(roll), math.cos(roll)
    st, ct = math.sin(pitch), math.cos(pitch)
    matrix = np.array([[1.0, 0.0, -st], [0.0, cf, sf * ct], [0.0, -sf, cf * ct]])
    return matrix @ euler_rates
