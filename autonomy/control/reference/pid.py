"""Three PID loops, readable; ``autonomy.control.kernel`` is the fast twin."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.control.config import PidConfig
from autonomy.control.reference.error import tracking_error
from autonomy.control.trajectory import Reference
from autonomy.vehicle.config import ActuatorLimits


def pid_inputs(
    state: FloatArray,
    reference: Reference,
    integrals: FloatArray,
    config: PidConfig,
    limits: ActuatorLimits,
    dt_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Net mass kg, sliding mass m and tail angle rad of three loops, not yet limited.

    The sliding mass moves aft to raise the nose, so its loop has the opposite sign.

    Args:
        state: The 12 states or their estimate.
        reference: Where the vehicle should be.
        integrals: Of the depth, pitch and direction errors so far, shape ``(3,)``.
        config: Gains, and what becomes of an integral at an end stop.
        limits: The end stops.
        dt_s: Time since the last call.

    Returns:
        The inputs and the new integrals, shape ``(3,)`` each; an error that is not a number is
        not integrated.

    Source:
        Thesis section 3.3; the direction error is heading minus direction to the target.
    """
    error = tracking_error(
        state,
        reference,
        pitch_trade_rad=0.0,
        near_m=config.near_m,
        near_offset_m=config.near_offset_m,
    )
    now = np.array([error.depth, error.pitch, error.direction])
    rate = np.array([error.depth_rate, error.pitch_rate, error.direction_rate])
    k = config
    gains = np.array(
        [
            [k.z_proportional, k.z_integral, k.z_derivative],
            [-k.pitch_proportional, -k.pitch_integral, -k.pitch_derivative],
            [k.heading_proportional, k.heading_integral, k.heading_derivative],
        ]
    )
    grown = integrals + now * dt_s
    inputs = np.sum(gains * np.stack([now, grown, rate], axis=1), axis=1)
    cut = inputs - np.array(limits.clip(*inputs.tolist()))
    if config.anti_windup == "hold":
        into_the_stop = cut * gains[:, 1] * now > 0.0
        inputs -= np.where(into_the_stop, gains[:, 1] * now * dt_s, 0.0)
        grown = np.where(into_the_stop, integrals, grown)
    elif config.anti_windup == "back_calculation":
        works = gains[:, 1] != 0.0
        share = min(dt_s / config.windup_recovery_s, 1.0)
        grown -= np.where(works, share * cut / np.where(works, gains[:, 1], 1.0), 0.0)
    return inputs, np.where(np.isnan(grown), integrals, grown)
