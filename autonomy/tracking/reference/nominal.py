"""The pursuit law that knows nothing of observability (thesis section 4.4)."""

import math

from autonomy.tracking.config import BarrierConfig
from autonomy.tracking.reference.observability import State


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
