"""Compiled layered, moving and wavy water; ``autonomy.vehicle.water`` is the readable reference.

Arrays are packed as ``Surroundings.packed`` makes them.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.vehicle import kernel as body

PLAIN = 9
"""Length of packed surroundings with nothing but a uniform current and borders."""
_PROFILE, _COLUMN, _WAVES, _GRID_X, _GRID_Y, _GRID_Z, _BALLAST = range(PLAIN, PLAIN + 7)
_FIRST = PLAIN + 7
_WAVE_NUMBERS = 6

FLOW_NUMBERS = 15
"""Velocity NED m/s, its 3 x 3 gradient by rows 1/s, its rate at a fixed place m/s2."""


@inner_kernel
def _place(s: FloatArray, start: int, n: int, value: float) -> tuple[int, float, float]:
    """Return cell, share of the way through it, and that share's rate by metre (0 beyond)."""
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if s[start + middle] <= value:
            low = middle
        else:
            high = middle
    width = s[start + low + 1] - s[start + low]
    share = (value - s[start + low]) / width
    if 0.0 <= share < 1.0:
        return low, share, 1.0 / width
    return low, min(max(share, 0.0), 1.0), 0.0


@inner_kernel
def _add_profile(s: FloatArray, depth: float, flow: FloatArray) -> None:
    """Add the sheared current to the flow."""
    n = int(s[_PROFILE])
    i, share, per_m = _place(s, _FIRST, n, depth)
    for axis in range(2):
        at = _FIRST + (1 + axis) * n + i
        difference = s[at + 1] - s[at]
        flow[axis] += s[at] + share * difference
        flow[3 + 3 * axis + 2] += per_m * difference


@inner_kernel
def _add_waves(s: FloatArray, x: FloatArray, time_s: float, flow: FloatArray) -> None:
    """Add the waves' orbital motion to the flow."""
    depth = max(x[2], 0.0)
    start = _FIRST + 3 * int(s[_PROFILE]) + 2 * int(s[_COLUMN])
    for wave in range(int(s[_WAVES])):
        at = start + _WAVE_NUMBERS * wave
        number, frequency, north, east = s[at + 1], s[at + 2], s[at + 3], s[at + 4]
        angle = number * (north * x[0] + east * x[1]) - frequency * time_s + s[at + 5]
        speed = s[at] * frequency * math.exp(-number * depth)
        sine, cosine = speed * math.sin(angle), speed * math.cos(angle)
        flow[0] += north * cosine
        flow[1] += east * cosine
        flow[2] -= sine
        flow[3] -= number * north * north * sine
        flow[4] -= number * north * east * sine
        flow[6] -= number * east * north * sine
        flow[7] -= number * east * east * sine
        flow[9] -= number * north * cosine
        flow[10] -= number * east * cosine
        if x[2] > 0.0:
            flow[5] -= number * north * cosine
            flow[8] -= number * east * cosine
            flow[11] += number * sine
        flow[12] += frequency * north * sine
        flow[13] += frequency * east * sine
        flow[14] += frequency * cosine


@inner_kernel
def _add_grid(s: FloatArray, x: FloatArray, flow: FloatArray) -> None:
    """Add the current of the grid to the flow, trilinear between its points."""
    nx, ny, nz = int(s[_GRID_X]), int(s[_GRID_Y]), int(s[_GRID_Z])
    start = _FIRST + 3 * int(s[_PROFILE]) + 2 * int(s[_COLUMN]) + _WAVE_NUMBERS * int(s[_WAVES])
    i, share_x, per_x = _place(s, start, nx, x[0])
    j, share_y, per_y = _place(s, start + nx, ny, x[1])
    k, share_z, per_z = _place(s, start + nx + ny, nz, x[2])
    values = start + nx + ny + nz
    for di in range(2):
        wx, sx = (share_x, per_x) if di == 1 else (1.0 - share_x, -per_x)
        for dj in range(2):
            wy, sy = (share_y, per_y) if dj == 1 else (1.0 - share_y, -per_y)
            for dk in range(2):
                wz, sz = (share_z, per_z) if dk == 1 else (1.0 - share_z, -per_z)
                at = values + 3 * (((i + di) * ny + j + dj) * nz + k + dk)
                for c in range(3):
                    flow[c] += wx * wy * wz * s[at + c]
                    flow[3 + 3 * c] += sx * wy * wz * s[at + c]
                    flow[4 + 3 * c] += wx * sy * wz * s[at + c]
                    flow[5 + 3 * c] += wx * wy * sz * s[at + c]


@kernel
def water_flow(x: FloatArray, time_s: float, s: FloatArray) -> FloatArray:
    """Return how the water moves at a place, shape ``(15,)`` (see ``FLOW_NUMBERS``).

    Args:
        x: State; its first three are the position NED m.
        time_s: Time.
        s: Packed surroundings, longer than ``PLAIN``.
    """
    flow = np.zeros(FLOW_NUMBERS)
    flow[0], flow[1], flow[2] = s[0], s[1], s[2]
    if s[_PROFILE] > 0.0:
        _add_profile(s, x[2], flow)
    if s[_WAVES] > 0.0:
        _add_waves(s, x, time_s, flow)
    if s[_GRID_X] > 0.0:
        _add_grid(s, x, flow)
    return flow


@kernel
def net_mass_and_density(
    m0: float, depth: float, p: FloatArray, s: FloatArray
) -> tuple[float, float]:
    """Return what weighs on the robot at a depth, kg, and the water's density by the model's.

    Args:
        m0: Net mass where the robot was ballasted.
        depth: Depth, m.
        p: Packed vehicle with its hull.
        s: Packed surroundings of any length.
    """
    displaced = 1.0 - p[body.HULL_COMPRESSIBILITY] * max(depth, 0.0)
    ratio = 1.0
    if s.shape[0] > PLAIN and s[_COLUMN] > 0.0:
        n = int(s[_COLUMN])
        start = _FIRST + 3 * int(s[_PROFILE])
        i, share, _ = _place(s, start, n, depth)
        at = start + n + i
        density = s[at] + share * (s[at + 1] - s[at])
        ratio = density / p[body.WATER_DENSITY]
        displaced *= density / s[_BALLAST]
    return m0 - p[body.HULL_MASS] * (displaced - 1.0), ratio


@kernel
def surface(x: FloatArray, rate: FloatArray, time_s: float, s: FloatArray) -> tuple[float, float]:
    """Return the depth of the wavy surface above or below a robot, m, and that depth's rate, m/s.

    Args:
        x: State; its first three are the position NED m.
        rate: Velocity over ground in NED in the first three, m/s.
        time_s: Time.
        s: Packed surroundings, longer than ``PLAIN``.
    """
    level, level_rate = 0.0, 0.0
    start = _FIRST + 3 * int(s[_PROFILE]) + 2 * int(s[_COLUMN])
    for wave in range(int(s[_WAVES])):
        at = start + _WAVE_NUMBERS * wave
        number, frequency, north, east = s[at + 1], s[at + 2], s[at + 3], s[at + 4]
        angle = number * (north * x[0] + east * x[1]) - frequency * time_s + s[at + 5]
        level -= s[at] * math.cos(angle)
        along = north * rate[0] + east * rate[1]
        level_rate -= s[at] * math.sin(angle) * (frequency - number * along)
    return level, level_rate


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    packed, state = np.ones(body.ENERGY_DELTA + 1), np.zeros(15)
    plain = np.zeros(_FIRST)
    water_flow(state, 0.0, plain)
    net_mass_and_density(0.0, 0.0, packed, plain)
    surface(state, state, 0.0, plain)
