"""Compiled swimming controller; ``swimming`` is the readable reference."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.control import governor_kernel, integral_kernel, swimming_config
from autonomy.control import kernel as thesis
from autonomy.control.governor_kernel import Rows
from autonomy.vehicle import kernel as v

(
    POSITION_GAIN,
    SPEED_GAIN,
    HEADING_GAIN,
    HEADING_RATE_GAIN,
    BIAS_MOST,
    AMPLITUDE_MOST,
    FREQUENCY,
    DEPTH_GAIN,
    PITCH_MOST,
) = range(20, 29)
"""Index of each number in packed gains, after those of integral backstepping."""
GAINS = 29

SLOWEST_M_S, TURNING_SHARE = swimming_config.SLOWEST_M_S, swimming_config.TURNING_SHARE
integral_into = integral_kernel.integral_into
rows = governor_kernel.rows
end_stops = thesis.end_stops
"""Names that numba resolves once, when it compiles."""


@inner_kernel
def _amplitude(speed: float, bias: float, gains: FloatArray, p: FloatArray) -> float:
    """Amplitude at which mean thrust and drag of a straight swim are in balance."""
    w = 2.0 * math.pi * gains[FREQUENCY]
    k = p[v.TAIL_RESPONSE]
    follows = k / math.sqrt(k * k + w * w)
    water_kg = p[v.WATER_DENSITY] * p[v.TAIL_AREA] * p[v.TAIL_WATER_LENGTH]
    thrust = 0.5 * water_kg * p[v.TAIL_CENTRE] * (w * follows) ** 2 * math.cos(bias)
    pressure = 0.5 * p[v.WATER_DENSITY] * p[v.AREA] * max(speed, 0.0) ** 2
    steady = pressure * (p[v.DRAG_0] + p[v.DRAG_DELTA] * bias * bias)
    flapping = 0.5 * pressure * p[v.DRAG_DELTA] * follows * follows
    most = min(gains[AMPLITUDE_MOST], p[v.DELTA_RATE] / w, max(p[v.DELTA_MAX] - abs(bias), 0.0))
    if thrust <= flapping:
        return most if speed > 0.0 else 0.0
    return min(math.sqrt(steady / (thrust - flapping)), most)


@inner_kernel
def swimming_into(
    x: FloatArray,
    r: FloatArray,
    gains: FloatArray,
    p: FloatArray,
    dt_s: float,
    learned: FloatArray,
    scratch: Rows,
    out: FloatArray,
) -> None:
    """Write the command, masses not yet limited, into ``out``, shape ``(5,)``.

    ``learned`` is as of ``integral_into``; ``scratch`` is from ``rows``.
    """
    st, ct = math.sin(x[4]), math.cos(x[4])
    sp, cp = math.sin(x[5]), math.cos(x[5])
    forward = ct * x[6] + st * x[8]
    north = r[4] + gains[POSITION_GAIN] * (r[0] - x[0])
    east = r[5] + gains[POSITION_GAIN] * (r[1] - x[1])
    along, cross = north * cp + east * sp, -north * sp + east * cp
    sink = r[6] + gains[DEPTH_GAIN] * (r[2] - x[2])
    level, most = scratch[4], gains[PITCH_MOST]
    level[:12] = r[:12]
    level[3] = min(max(-math.atan2(sink, max(forward, SLOWEST_M_S)), -most), most)
    level[7] = 0.0
    level[11] = 0.0
    integral_into(x, level, gains, p, dt_s, learned, scratch[0], scratch[1], scratch[2], out)
    bias = gains[HEADING_RATE_GAIN] * x[11] / ct - gains[HEADING_GAIN] * math.atan2(cross, along)
    bias = min(max(bias, -gains[BIAS_MOST]), gains[BIAS_MOST])
    speed = max(along, TURNING_SHARE * math.sqrt(along * along + cross * cross))
    speed += gains[SPEED_GAIN] * (speed - forward)
    out[2] = bias
    out[3] = _amplitude(speed, bias, gains, p)
    out[4] = gains[FREQUENCY]


@kernel
def swimming(
    state: FloatArray,
    reference: FloatArray,
    gains: FloatArray,
    packed: FloatArray,
    learned: FloatArray,
    dt_s: float,
) -> FloatArray:
    """Return the command, masses not yet limited, shape ``(5,)``, and learn in ``learned``."""
    out = np.empty(5)
    swimming_into(state, reference, gains, packed, dt_s, learned, rows(), out)
    return out


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    state, packed = np.zeros(12), np.ones(v.DELTA_RATE + 1)
    state[6] = 0.1
    swimming(state, np.zeros(12), np.ones(GAINS), packed, np.zeros(3), 0.1)
