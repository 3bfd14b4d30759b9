"""Every control law behind one compiled call: an estimate and a reference in, a command out."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, kernel
from autonomy.control import governor_kernel, integral_kernel, swimming_kernel
from autonomy.control import kernel as thesis
from autonomy.control.governor_kernel import Rows
from autonomy.control.law_number import GOVERNOR, INTEGRAL, PID, SWIMMING
from autonomy.vehicle import kernel as vehicle_kernel

MEMORY_SIZE = governor_kernel.MEMORY_SIZE
"""Numbers that a law may remember between calls; all of them 0 is a fresh start."""
COMMAND_SIZE = 5
"""Net mass kg, sliding mass m, tail angle (or bias) rad, tail amplitude rad, frequency Hz."""

backstepping_into = thesis.backstepping_into
pid_into = thesis.pid_into
integral_into = integral_kernel.integral_into
governor_into = governor_kernel.governor_into
swimming_into = swimming_kernel.swimming_into
rows = governor_kernel.rows
M0_MIN, M0_MAX = vehicle_kernel.M0_MIN, vehicle_kernel.M0_MAX
RP1_MIN, RP1_MAX = vehicle_kernel.RP1_MIN, vehicle_kernel.RP1_MAX
DELTA_MAX = vehicle_kernel.DELTA_MAX
"""Names that numba resolves once, when it compiles."""


@inlined_kernel
def _clipped(value: float, low: float, high: float) -> float:
    return 0.0 if math.isnan(value) else min(max(value, low), high)


@inlined_kernel
def clip_into(p: FloatArray, out: FloatArray) -> None:
    """Cut the first three set points at the end stops; what is not a number becomes neutral."""
    stop = p[DELTA_MAX]
    out[0] = _clipped(out[0], p[M0_MIN], p[M0_MAX])
    out[1] = _clipped(out[1], p[RP1_MIN], p[RP1_MAX])
    out[2] = _clipped(out[2], -stop, stop)


@inlined_kernel
def command_into(
    law: int,
    x: FloatArray,
    r: FloatArray,
    gains: FloatArray,
    p: FloatArray,
    dt_s: float,
    memory: FloatArray,
    scratch: Rows,
    out: FloatArray,
) -> None:
    """Write the command of a law, cut at the end stops, into ``out``, shape ``(5,)``.

    What is not a number becomes neutral, so that an actuator never gets nonsense.

    Args:
        law: Which law, of ``autonomy.control.law_number``.
        x: The 12 states or their estimate.
        r: ``Reference.packed()``.
        gains: The packed configuration of that law.
        p: ``Vehicle.packed()``.
        dt_s: Time since the last call, s.
        memory: What the law remembers, shape ``(MEMORY_SIZE,)``; changed in place.
        scratch: From ``rows``.
        out: The command.
    """
    out[3] = 0.0
    out[4] = 0.0
    if law == PID:
        pid_into(x, r, gains, p, dt_s, memory, scratch[0], out)
    elif law == INTEGRAL:
        integral_into(x, r, gains, p, dt_s, memory, scratch[0], scratch[1], scratch[2], out)
    elif law == GOVERNOR:
        governor_into(x, r, gains, p, dt_s, memory, scratch, out)
    elif law == SWIMMING:
        swimming_into(x, r, gains, p, dt_s, memory, scratch, out)
    else:
        backstepping_into(x, r, gains, p, 0.0, scratch[0], scratch[1], scratch[2], out)
    clip_into(p, out)
    if math.isnan(out[3]):
        out[3] = 0.0


@kernel
def command(
    law: int,
    state: FloatArray,
    reference: FloatArray,
    gains: FloatArray,
    packed: FloatArray,
    dt_s: float,
    memory: FloatArray,
) -> FloatArray:
    """Return the command of a law, shape ``(5,)``; arguments as of ``command_into``."""
    out = np.empty(COMMAND_SIZE)
    command_into(law, state, reference, gains, packed, dt_s, memory, rows(), out)
    return out


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    packed = np.ones(vehicle_kernel.DELTA_RATE + 1)
    gains, memory = np.ones(32), np.zeros(MEMORY_SIZE)
    command(INTEGRAL, np.zeros(12), np.zeros(12), gains, packed, 0.1, memory)
