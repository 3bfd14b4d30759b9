"""Settings of the controller as the compiled control step reads them."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.control import control_kernel as k

ALPHAS = {
    "linear": k.LINEAR,
    "cubic": k.CUBIC,
    "negative": k.NEGATIVE,
    "zero": k.ZERO,
    "root": k.ROOT,
    "constant": k.CONSTANT,
}


def pack_control(config: TrackingConfig) -> FloatArray:
    """Pack for ``control_kernel.control_step``, shape ``(14,)``, SI units and radians.

    The constraint is applied for the controller ``barrier`` alone.
    """
    barrier, motion = config.barrier, config.motion
    p = np.empty(k.SIZE)
    p[k.IS_FILTERED] = barrier.controller == "barrier"
    p[k.IS_SQUARED] = barrier.shape == "squared"
    p[k.ALPHA] = ALPHAS[barrier.alpha]
    p[k.SLOPE] = barrier.slope
    p[k.EPSILON] = barrier.epsilon
    p[k.IS_BEST_EFFORT] = barrier.fallback == "best_effort"
    p[k.HEADING_GAIN] = barrier.heading_gain_per_s
    p[k.DISTANCE_GAIN] = barrier.distance_gain_per_s2
    p[k.LEAD] = barrier.lead_m
    p[k.TURN_MAX] = motion.turn_rate_max_rad_s
    p[k.ACCELERATION_MIN] = motion.acceleration_min_m_s2
    p[k.ACCELERATION_MAX] = motion.acceleration_max_m_s2
    p[k.SPEED_MIN] = motion.speed_min_m_s
    p[k.SPEED_MAX] = motion.speed_max_m_s
    return p
