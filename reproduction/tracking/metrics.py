"""What a run of range-only tracking is judged by."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.control.control_kernel import INFEASIBLE

(
    TIME,
    NORTH,
    EAST,
    HEADING,
    SPEED,
    TARGET_NORTH,
    TARGET_EAST,
    ESTIMATE_NORTH,
    ESTIMATE_EAST,
    TURN_RATE,
    ACCELERATION,
    NOMINAL_TURN_RATE,
    NOMINAL_ACCELERATION,
    DETERMINANT,
    STATUS,
    INVERSE_CONDITION,
    WEIGHT,
    RECORD_SIZE,
) = range(18)
"""Columns of a run's record, one row for each control step before its command takes effect.

North and east are the robot's and the target's (m, site frame); the estimate is that of the
relative position, robot less target (m); the determinant (m2/s) and the status are the
controller's, at the estimate; the inverse condition number is that of the true state; the weight
is that of the likeliest hypothesis."""

LOST_RANGE_M = 3.0
"""A run whose mean range is greater has lost its target."""
MIRRORED_SPAN_S = 30.0
"""The end of a run over which its estimate is compared with its mirror image."""
MIRRORED_RATIO = 1.5
"""An estimate is mirrored if its error is so many times the range; for an exact image it is 2."""
MIRRORED_RANGE_SHARE = 0.25
"""... while its own range is right within this share."""


@dataclass(frozen=True, slots=True)
class Score:
    """What is left of a run when its traces are forgotten."""

    estimation_error_m: float
    """Mean distance between estimated and true relative position."""
    tracking_error_m: float
    """Mean range between robot and target."""
    inverse_condition_s: float
    """Inverse condition number of the true observability matrix, summed over time."""
    is_lost: bool
    """Whether the mean range is greater than ``LOST_RANGE_M``."""
    is_mirrored: bool
    """Whether the estimate ends on the wrong side of the robot, at the right range."""
    infeasible_share: float
    """Share of the steps in which the barrier could not be kept."""


def relative(record: FloatArray) -> FloatArray:
    """Return the true relative position, robot less target, shape ``(n, 2)``, m."""
    return record[:, [NORTH, EAST]] - record[:, [TARGET_NORTH, TARGET_EAST]]


def estimate(record: FloatArray) -> FloatArray:
    """Return the estimated relative position, shape ``(n, 2)``, m."""
    return record[:, [ESTIMATE_NORTH, ESTIMATE_EAST]]


def mean_so_far(vectors: FloatArray) -> FloatArray:
    """Return the time-averaged length of an error up to each step, shape ``(n,)``.

    Args:
        vectors: The error at each step, shape ``(n, 2)``, m.
    """
    return np.cumsum(np.hypot(*vectors.T)) / np.arange(1.0, len(vectors) + 1.0)


def score(record: FloatArray, step_s: float) -> Score:
    """Judge a run by its record, shape ``(n, RECORD_SIZE)``.

    Source:
        Coleman, thesis, section 4.4: time-averaged errors and cumulative inverse condition number.
    """
    tau = relative(record)
    kappa = np.hypot(*(tau - estimate(record)).T)
    distance = np.hypot(*tau.T)
    return Score(
        estimation_error_m=float(kappa.mean()),
        tracking_error_m=float(distance.mean()),
        inverse_condition_s=float(record[:, INVERSE_CONDITION].sum() * step_s),
        is_lost=bool(distance.mean() > LOST_RANGE_M),
        is_mirrored=is_mirrored(record, step_s),
        infeasible_share=float((record[:, STATUS] == INFEASIBLE).mean()),
    )


def is_mirrored(record: FloatArray, step_s: float) -> bool:
    """Tell whether a run ends with an estimate on the wrong side of the robot.

    Ranges alone cannot tell a target from its image across the robot's line of motion, nor, once
    the robot runs away from the image, the one ahead from the one astern. The estimate then has
    about the true range and an error of about twice that.
    """
    span = min(len(record), round(MIRRORED_SPAN_S / step_s))
    end = record[-span:]
    tau, tau_hat = relative(end), estimate(end)
    distance = float(np.hypot(*tau.T).mean())
    believed = float(np.hypot(*tau_hat.T).mean())
    error = float(np.hypot(*(tau - tau_hat).T).mean())
    agrees = abs(believed - distance) < MIRRORED_RANGE_SHARE * distance
    return agrees and error > MIRRORED_RATIO * distance
