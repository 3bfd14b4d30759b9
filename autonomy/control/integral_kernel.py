"""Compiled backstepping that learns its offsets; ``integral`` is the readable reference."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, inner_kernel, kernel
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


@inlined_kernel
def learn_offset(
    i: int,
    wanted: float,
    e: FloatArray,
    gains: FloatArray,
    p: FloatArray,
    dt_s: float,
    share: float,
    learned: FloatArray,
) -> None:
    """Learn net mass (0) or mass position (1), unless that leads further into its end stop.

    ``wanted`` is the input without what was learned, ``share`` that of the integral gain in use;
    ``e`` has the errors and effects of ``backstepping_into``.
    """
    error = e[ERROR_DEPTH] if i == 0 else e[ERROR_HYBRID]
    effect = e[MASS_EFFECT] if i == 0 else e[SLIDE_EFFECT]
    low, high = end_stops(i, p)
    wanted -= learned[i]
    cut = wanted - min(max(wanted, low), high)
    step = share * gains[K_DEPTH + i] / effect * error * dt_s
    if abs(error) <= gains[DEPTH_WINDOW + i] and cut * step >= 0.0:
        most = gains[NET_BUOYANCY_MOST + i]
        learned[i] = min(max(learned[i] + step, -most), most)


@inlined_kernel
def learn_distance(e: FloatArray, gains: FloatArray, dt_s: float, learned: FloatArray) -> None:
    """Learn the added distance from the errors ``e`` of ``backstepping_into``."""
    if e[ERROR_DISTANCE] <= gains[ALONG_WINDOW]:
        grown = learned[2] + gains[K_ALONG] * e[ERROR_ALONG] * dt_s
        learned[2] = min(max(grown, -gains[ALONG_MOST]), gains[ALONG_MOST])


@inner_kernel
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
    for i in range(2):
        learn_offset(i, out[i], e, gains, p, dt_s, 1.0, learned)
        out[i] -= learned[i]
    learn_distance(e, gains, dt_s, learned)


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
