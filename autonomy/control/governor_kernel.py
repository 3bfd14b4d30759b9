"""Compiled robust controller, for wrong masses and a slow, late actuator.

``governor`` is the readable form.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.control import actuator_kernel, integral_kernel
from autonomy.control import kernel as thesis
from autonomy.control.governor_config import MOST_DELAY_CALLS
from autonomy.vehicle import kernel as vehicle_kernel

MASS_RATE_SHARE, MASS_DELAY, RATE_USE, ERROR_FLOOR, DELAY_MARGIN = range(20, 25)
"""Index of each number in packed gains, after those of integral backstepping."""
GAINS = 25
HISTORY = MOST_DELAY_CALLS + 1
"""Set points of the sliding mass that are remembered, the newest included."""
SENT = 3
"""Index in the memory of the three actuators; before them stands what integral backstepping
learns."""
HEAD = 6
"""Index in the memory of where the next set point goes."""
FIRST = 7
FED = FIRST + HISTORY
"""Index in the memory of what the actuators feed back: whether they do (``SILENT``, ``LEARNING`` or
``KNOWN``), net mass, sliding mass and tail."""
SILENT, LEARNING, KNOWN = 0.0, 1.0, 2.0
"""Without feedback the commands alone say where the actuators are; with it they are where they say,
and the sliding mass's rate and delay are learned, or known from elsewhere."""
COUNTED_SHARE, COUNTED_DELAY = FED + 4, FED + 5
"""Index in the memory of the rate and the delay that the last command counted on."""
BANK = FED + 6
"""Index in the memory of the guesses at the sliding mass's rate and delay."""
MEMORY_SIZE = BANK + actuator_kernel.BANK_SIZE

backstepping_into = thesis.backstepping_into
learn_offset = integral_kernel.learn_offset
learn_distance = integral_kernel.learn_distance
end_stops = thesis.end_stops
rk4_into = vehicle_kernel.rk4_into
K_XI, K_3 = thesis.K_XI, thesis.K_3
ERROR_HYBRID, ERROR_HYBRID_RATE = thesis.ERROR_HYBRID, thesis.ERROR_HYBRID_RATE
SLIDE_EFFECT = thesis.SLIDE_EFFECT
M0_RATE, RP1_RATE = vehicle_kernel.M0_RATE, vehicle_kernel.RP1_RATE
DELTA_RATE = vehicle_kernel.DELTA_RATE
RP1_MIN, RP1_MAX = vehicle_kernel.RP1_MIN, vehicle_kernel.RP1_MAX
look = actuator_kernel.look
known_rate, known_delay = actuator_kernel.known_rate, actuator_kernel.known_delay
"""Names that numba resolves once, when it compiles."""


Rows = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""Room to work in: five arrays of shape ``(16,)``; a tuple costs nothing to take apart."""


@inner_kernel
def rows() -> Rows:
    """Return room to work in."""
    return np.empty(16), np.empty(16), np.empty(16), np.empty(16), np.empty(16)


@inner_kernel
def _towards(value: float, target: float, most: float) -> float:
    return value + min(max(target - value, -most), most)


@inner_kernel
def _predict(
    x: FloatArray,
    r: FloatArray,
    calls: int,
    rate: float,
    p: FloatArray,
    dt_s: float,
    memory: FloatArray,
    scratch: Rows,
) -> None:
    """Write state and reference after ``calls`` calls into rows 3 and 4 of ``scratch``."""
    predicted, ahead = scratch[3], scratch[4]
    predicted[:12] = x[:12]
    m0, tail = memory[SENT] + memory[0], memory[SENT + 2]
    sliding, head = memory[SENT + 1], int(memory[HEAD])
    for late in range(calls, 0, -1):
        target = memory[FIRST + (head - late) % HISTORY]
        moved = _towards(sliding, target, rate * dt_s)
        rp1 = 0.5 * (sliding + moved) + memory[1]
        rk4_into(predicted, m0, rp1, tail, p, dt_s, scratch[0], scratch[1], scratch[2])
        sliding = moved
    t = calls * dt_s
    for i in range(4):
        ahead[i] = r[i] + t * r[4 + i] + 0.5 * t * t * r[8 + i]
        ahead[4 + i] = r[4 + i] + t * r[8 + i]
        ahead[8 + i] = r[8 + i]


@inner_kernel
def _hear(gains: FloatArray, p: FloatArray, dt_s: float, memory: FloatArray) -> None:
    """Take in what the actuators feed back, and note which rate and delay to count on."""
    share, delay_s = gains[MASS_RATE_SHARE], gains[MASS_DELAY]
    if memory[FED] != SILENT:
        for i in range(3):
            if math.isfinite(memory[FED + 1 + i]):
                memory[SENT + i] = memory[FED + 1 + i]
    if memory[FED] == LEARNING:
        command = memory[FIRST + (int(memory[HEAD]) - 1) % HISTORY]
        sliding, travel = memory[FED + 2], p[RP1_MAX] - p[RP1_MIN]
        look(memory, BANK, command, sliding, p[RP1_RATE], travel, share, delay_s, dt_s)
        share, delay_s = known_rate(memory, BANK, share), known_delay(memory, BANK, delay_s)
    memory[COUNTED_SHARE], memory[COUNTED_DELAY] = share, delay_s


@inner_kernel
def governor_into(
    x: FloatArray,
    r: FloatArray,
    gains: FloatArray,
    p: FloatArray,
    dt_s: float,
    memory: FloatArray,
    scratch: Rows,
    out: FloatArray,
) -> None:
    """Write the inputs, not yet limited, into ``out`` and remember them in ``memory``.

    ``memory`` has shape ``(MEMORY_SIZE,)``; ``scratch`` is from ``rows``.
    """
    _hear(gains, p, dt_s, memory)
    calls = min(round(memory[COUNTED_DELAY] / dt_s), HISTORY - 1) if dt_s > 0.0 else 0
    rate = memory[COUNTED_SHARE] * p[RP1_RATE]
    _predict(x, r, calls, rate, p, dt_s, memory, scratch)
    e, distance = scratch[0], memory[2]
    backstepping_into(scratch[3], scratch[4], gains, p, distance, e, scratch[1], scratch[2], out)
    greatest = math.sqrt(gains[K_XI])
    error = abs(e[ERROR_HYBRID]) + abs(e[ERROR_HYBRID_RATE]) / greatest
    jerk = gains[RATE_USE] * abs(e[SLIDE_EFFECT]) * rate
    bandwidth = min(greatest, (jerk / max(error, gains[ERROR_FLOOR])) ** (1.0 / 3.0))
    bandwidth = min(bandwidth, gains[DELAY_MARGIN] / max(calls * dt_s, 1e-9))
    share = bandwidth / greatest
    given_up = (1.0 - share) * gains[K_3] * e[ERROR_HYBRID_RATE]
    given_up += (1.0 - share * share) * gains[K_XI] * e[ERROR_HYBRID]
    sliding = out[1] + given_up / e[SLIDE_EFFECT]
    backstepping_into(x, r, gains, p, distance, e, scratch[1], scratch[2], out)
    out[1] = sliding
    for i in range(2):
        learn_offset(i, out[i], e, gains, p, dt_s, share * share * share if i else 1.0, memory)
        out[i] -= memory[i]
    learn_distance(e, gains, dt_s, memory)
    _remember(calls, rate, p, dt_s, memory, out)


@inner_kernel
def _remember(
    calls: int, rate: float, p: FloatArray, dt_s: float, memory: FloatArray, out: FloatArray
) -> None:
    """Note the new set points and move the actuators as they will until the next call."""
    head = int(memory[HEAD])
    low, high = end_stops(1, p)
    memory[FIRST + head] = _clipped(out[1], low, high)
    arriving = memory[FIRST + (head - calls) % HISTORY]
    memory[HEAD] = (head + 1) % HISTORY
    memory[SENT + 1] = _towards(memory[SENT + 1], arriving, rate * dt_s)
    low, high = end_stops(0, p)
    memory[SENT] = _towards(memory[SENT], _clipped(out[0], low, high), p[M0_RATE] * dt_s)
    low, high = end_stops(2, p)
    memory[SENT + 2] = _towards(memory[SENT + 2], _clipped(out[2], low, high), p[DELTA_RATE] * dt_s)


@inner_kernel
def _clipped(value: float, low: float, high: float) -> float:
    """Cut at the end stops; what is not a number becomes neutral and is not remembered."""
    return 0.0 if math.isnan(value) else min(max(value, low), high)


@kernel
def governor(
    state: FloatArray,
    reference: FloatArray,
    gains: FloatArray,
    packed: FloatArray,
    memory: FloatArray,
    dt_s: float,
) -> FloatArray:
    """Return net mass kg, sliding mass m, tail angle rad, and remember them in ``memory``."""
    out = np.empty(3)
    governor_into(state, reference, gains, packed, dt_s, memory, rows(), out)
    return out


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    state, packed = np.zeros(12), np.ones(vehicle_kernel.DELTA_RATE + 1)
    state[6] = 0.1
    governor(state, np.zeros(12), np.ones(GAINS), packed, np.zeros(MEMORY_SIZE), 0.1)
