"""Backstepping that learns its offsets, readable; ``integral_kernel`` is the fast twin."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.control.integral_config import IntegralConfig
from autonomy.control.reference.backstepping import Solution, solve
from autonomy.control.trajectory import Reference
from autonomy.vehicle.config import Vehicle


def integral_inputs(
    state: FloatArray,
    reference: Reference,
    learned: FloatArray,
    config: IntegralConfig,
    vehicle: Vehicle,
    dt_s: float,
) -> tuple[FloatArray, FloatArray]:
    r"""Net mass kg, sliding mass m and tail angle rad, not yet limited, and what was learned.

    To the target dynamics of thesis Eq. 3.18 the depth and the hybrid error each add an integral,
    :math:`\ddot e + k_1 \dot e + k_0 e + k_i \int e = 0`. The integrals are kept in the units of
    the actuators, so that they say by how much the model has net buoyancy and mass position
    wrong: the actuator's effect times the learned error is the integral term. They integrate the
    error alone and not its rate, because a wrong net buoyancy biases the observed velocity too.
    A third integral adds to the distance that the hybrid error wins back, which a steady current
    would leave otherwise; it is bounded, and so is the pitch that is given up for it.

    Args:
        state: The 12 states or their estimate; roll is taken as 0.
        reference: Where the vehicle should be.
        learned: Net mass kg and mass position m that the model has too little of, and added
            distance m, shape ``(3,)``.
        config: Gains.
        vehicle: The model and the end stops.
        dt_s: Time since the last call.

    Returns:
        The inputs and what is learned now, shape ``(3,)`` each.
    """
    law = solve(state, reference, config, vehicle, added_along_m=float(learned[2]))
    inputs, learned = apply_learned(law.inputs, law, learned, config, vehicle, dt_s)
    return inputs, learned


def apply_learned(
    wanted: FloatArray,
    law: Solution,
    learned: FloatArray,
    config: IntegralConfig,
    vehicle: Vehicle,
    dt_s: float,
    pitch_share: float = 1.0,
) -> tuple[FloatArray, FloatArray]:
    """Go on learning, and take what is learned off the inputs.

    Args:
        wanted: Inputs of a model without offsets, shape ``(3,)``.
        law: Errors and effects at the present state.
        learned: As of ``integral_inputs``.
        config: Gains.
        vehicle: The end stops.
        dt_s: Time since the last call.
        pitch_share: Share of the pitch integral gain that is in use.

    Returns:
        The inputs and what is learned now, shape ``(3,)`` each.
    """
    k = config
    errors = (law.error.depth, law.error.hybrid)
    gains = (k.k_depth_integral / law.mass_effect, k.k_pitch_integral / law.slide_effect)
    shares = (1.0, pitch_share)
    windows = (k.depth_window_m, k.pitch_window_rad)
    most = (k.net_buoyancy_most_kg, k.mass_position_most_m)
    inputs, learned = wanted.copy(), learned.copy()
    for i in range(2):
        asked = wanted - learned
        cut = asked - np.array(vehicle.limits.clip(*asked.tolist()))
        step = shares[i] * gains[i] * errors[i] * dt_s
        # more of what is learned means less of the input
        if abs(errors[i]) <= windows[i] and cut[i] * step >= 0.0:
            learned[i] = min(max(learned[i] + step, -most[i]), most[i])
        inputs[i] -= learned[i]
    if law.error.distance <= k.along_window_m:
        step = k.k_along_integral * law.error.along * dt_s
        learned[2] = min(max(learned[2] + step, -k.along_most_m), k.along_most_m)
    return inputs, learned
