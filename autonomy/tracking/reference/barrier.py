"""The barrier filter: the pursuit law, changed as little as keeps the target observable.

Readable form; ``control_kernel`` is the same, compiled.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

from autonomy.tracking.config import BarrierConfig, MotionConfig, TrackingConfig
from autonomy.tracking.control.control_kernel import LARGEST, SPEED_TIME_S
from autonomy.tracking.reference import box_qp
from autonomy.tracking.reference.observability import Plane, State, determinant, determinant_rates


def pursuit(z: State, config: BarrierConfig) -> tuple[float, float]:
    """Return turn rate rad/s and acceleration m/s2 that bring the robot onto its target.

    The robot steers a point ``lead_m`` ahead of itself, so that the bearing is defined on top of
    the target as well. The result is not limited.

    Source:
        Thesis section 4.4, with the heading's error wrapped into (-pi, pi].
    """
    x_r, y_r, psi, _ = z
    x_l = -x_r - config.lead_m * math.cos(psi)
    y_l = -y_r - config.lead_m * math.sin(psi)
    error = wrapped(psi - math.atan2(y_l, x_l))
    return (
        -config.heading_gain_per_s * error,
        config.distance_gain_per_s2 * math.hypot(x_l, y_l) * math.cos(error),
    )


def wrapped(angle: float) -> float:
    """Return an angle in (-pi, pi]."""
    return angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


class ControlStatus(IntEnum):
    """What the barrier filter did."""

    UNCHANGED = 0
    """The nominal command, within its limits, keeps the target observable."""
    ACTIVE = 1
    """The command is the nearest one that does."""
    INFEASIBLE = 2
    """No command within the limits does; it is the fallback."""
    BAD_INPUT = 3
    """A number is not finite or beyond all sense; nothing is commanded."""


@dataclass(frozen=True, slots=True)
class ControlStep:
    """One command, and why it is as it is."""

    turn_rate_rad_s: float
    """Positive to starboard."""
    acceleration_m_s2: float
    nominal: tuple[float, float]
    """Turn rate and acceleration the pursuit law wants, not limited."""
    determinant_m2_s: float
    barrier: float
    """m4/s2 for the squared shape, m2/s for the absolute one; negative: not observable enough."""
    status: ControlStatus


def control(
    z: State, target_velocity: Plane, target_acceleration: Plane, config: TrackingConfig
) -> ControlStep:
    """Return the command for a relative state.

    Args:
        z: Relative position (tracker minus target) north and east, m; heading, rad; speed, m/s.
        target_velocity: North and east, m/s.
        target_acceleration: North and east, m/s2; zeros where it is not known.
        config: The controllers ``barrier`` and ``nominal`` differ in whether the constraint is
            applied; for the predictive ones the result is that of ``nominal``.

    Source:
        Thesis Eq. 4.13 with section 4.3; limits and gains of section 4.4; Appendix C for the
        fallback.
    """
    if not all(abs(value) < LARGEST for value in (*z, *target_velocity, *target_acceleration)):
        return ControlStep(0.0, 0.0, (0.0, 0.0), 0.0, 0.0, ControlStatus.BAD_INPUT)
    nominal = pursuit(z, config.barrier)
    low, high = limits(z[3], config.motion)
    det = determinant(z, target_velocity)
    b = barrier_value(det, config.barrier)
    clipped = box_qp.solve(nominal, (0.0, 0.0), 0.0, low, high)[:2]
    if config.barrier.controller != "barrier":
        return ControlStep(*clipped, nominal, det, b, ControlStatus.UNCHANGED)
    drift, direction = determinant_rates(z, target_acceleration)
    sign = 1.0 if det >= 0.0 else -1.0
    factor = sign if config.barrier.shape == "absolute" else 2.0 * det
    g = (factor * direction[0], factor * direction[1])
    u1, u2, is_feasible = box_qp.solve(
        nominal, g, -class_k(b, config.barrier) - factor * drift, low, high
    )
    if is_feasible:
        is_same = (u1, u2) == clipped
        status = ControlStatus.UNCHANGED if is_same else ControlStatus.ACTIVE
        return ControlStep(u1, u2, nominal, det, b, status)
    if config.barrier.fallback == "best_effort":
        # By |det| for both shapes: the squared one has no direction where det is 0.
        rising = (sign * direction[0], sign * direction[1])
        u1, u2 = box_qp.best_corner(nominal, rising, low, high)
    return ControlStep(u1, u2, nominal, det, b, ControlStatus.INFEASIBLE)


def barrier_value(det: float, config: BarrierConfig) -> float:
    """Return the barrier function of a determinant: not negative where observable enough."""
    if config.shape == "absolute":
        return abs(det) - math.sqrt(config.epsilon)
    return det * det - config.epsilon


def class_k(b: float, config: BarrierConfig) -> float:
    """Return how fast the barrier may fall at the value ``b`` (thesis Appendix C)."""
    match config.alpha:
        case "linear":
            shape = b
        case "cubic":
            shape = b**3
        case "negative":
            shape = -b
        case "zero":
            shape = 0.0
        case "root":
            shape = math.copysign(math.sqrt(abs(b)), b)
        case "constant":
            shape = -1.0
    return config.slope * shape


def limits(
    speed_m_s: float, config: MotionConfig
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return least and greatest turn rate and acceleration at a speed.

    Near its cap and its floor the speed may only approach them; beyond, it is brought back.
    """
    least, most = config.acceleration_min_m_s2, config.acceleration_max_m_s2
    high = min(most, max(least, (config.speed_max_m_s - speed_m_s) / SPEED_TIME_S))
    low = max(least, min(most, (config.speed_min_m_s - speed_m_s) / SPEED_TIME_S))
    turn = config.turn_rate_max_rad_s
    return (-turn, low), (turn, high)
