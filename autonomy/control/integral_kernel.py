"""Compiled backstepping that learns its offsets; ``integral`` is the readable reference."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.control import kernel as thesis
from autonomy.vehicle import kernel as vehicle_kernel

(
    K_DEPTH,
    K_PITCH,
    K_ALONG,
    DEPTH_WINDOW,
    PITCH_WINDOW,
    ALONG_WINDOW,
    NET_BUOYANCY_MOST,
    MASS_POSITION_MOST,
    ALONG_MOST,
) = range(11, 20)
"""Index of each number in packed gains, after those of backstepping."""
GAINS = 20

backstepping_into = thesis.backstepping_into
end_stops = thesis.end_stops
ERROR_DEPTH, ERROR_HYBRID = thesis.ERROR_DEPTH, thesis.ERROR_HYBRID
ERROR_DISTANCE, ERROR_ALONG = thesis.ERROR_DISTANCE, thesis.ERROR_ALONG
MASS_EFFECT, SLIDE_EFFECT = thesis.MASS_EFFECT, thesis.SLIDE_EFFECT
"""Names that numba resolves once, when it compiles."""


@kernel
def integral_into(
    x: FloatArray,
    r: FloatArray,
    gains: FloatArray,
    p: FloatArray,
    dt_s: float,
    learned: FloatArray,
    e: FloatArray,
    level: FloatArray,
    drift: FloatArray,
    out: FloatArray,
) -> None:
    """Write the inputs, not yet limited, into ``out``, and go on learning in ``learned``.

    ``e``, shape ``(16,)``, ``level`` and ``drift``, ``(12,)``, are scratch.
    """
    backstepping_into(x, r, gains, p, learned[2], e, level, drift, out)
    errors = (e[ERROR_DEPTH], e[ERROR_HYBRID])
    effects = (e[MASS_EFFECT], e[SLIDE_EFFECT])
    for i in range(2):
        low, high = end_stops(i, p)
        wanted = out[i] - learned[i]
        cut = wanted - min(max(wanted, low), high)
        step = gains[K_DEPTH + i] / effects[i] * errors[i] * dt_s
        if abs(errors[i]) <= gains[DEPTH_WINDOW + i] and cut * step >= 0.0:
            most = gains[NET_BUOYANCY_MOST + i]
            learned[i] = min(max(learned[i] + step, -most), most)
        out[i] -= learned[i]
    if e[ERROR_DISTANCE] <= gains[ALONG_WINDOW]:
        grown = learned[2] + gains[K_ALONG] * e[ERROR_ALONG] * dt_s
        learned[2] = min(max(grown, -gains[ALONG_MOST]), gains[ALONG_MOST])


@kernel
def integral(
    state: FloatArray,
    reference: FloatArray,
    gains: FloatArray,
    packed: FloatArray,
    learned: FloatArray,
    dt_s: float,
) -> FloatArray:
    """Return net mass kg, sliding mass m, tail angle rad, and learn in ``learned`` in place."""
    out = np.empty(3)
    e, level, drift = np.empty(16), np.empty(12), np.empty(12)
    integral_into(state, reference, gains, packed, dt_s, learned, e, level, drift, out)
    return out


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    state, packed = np.zeros(12), np.ones(vehicle_kernel.DELTA_RATE + 1)
    state[6] = 0.1
    integral(state, np.zeros(12), np.ones(GAINS), packed, np.zeros(3), 0.1)
