"""Compiled simulation of recorded segments under many candidate parameters, and their cost.

``autonomy.identification.problem`` lays out the arrays; the equations of motion are those of
``autonomy.vehicle.kernel``.
"""

import math

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.compiled import inlined_kernel, kernel
from autonomy.vehicle import kernel as body

hydrodynamic_wrench = body.hydrodynamic_wrench
rigid_body = body.rigid_body
"""Names that numba resolves once, when it compiles."""

DIVERGED = 1e12
"""Cost of a candidate whose simulation leaves all bounds; finite, so that it can be stored."""
_FASTEST_M_S = 10.0
_MOST_PARTS = 40


@inlined_kernel
def _rates(
    x: FloatArray,
    m0: float,
    rp1: float,
    delta: float,
    p: FloatArray,
    extended: bool,
    out: FloatArray,
) -> None:
    f1, f2, f3, t1, t2, t3 = hydrodynamic_wrench(
        x[6], x[7], x[8], x[9], x[10], x[11], delta, p, extended
    )
    if extended:
        t1 -= p[body.CROSSFLOW_1] * abs(x[9]) * x[9]
        t2 -= p[body.CROSSFLOW_2] * abs(x[10]) * x[10]
        t3 -= p[body.CROSSFLOW_3] * abs(x[11]) * x[11]
    rigid_body(x, m0, rp1, (f1, f2, f3, t1, t2, t3), p, out)


@inlined_kernel
def _runge_kutta(
    x: FloatArray,
    start: FloatArray,
    change: FloatArray,
    share: float,
    width: float,
    offset: FloatArray,
    p: FloatArray,
    extended: bool,
    dt_s: float,
    slope: FloatArray,
    total: FloatArray,
    probe: FloatArray,
) -> None:
    """Advance ``x`` by one step whose inputs are ``start + change * (share .. share + width)``."""
    m0 = start[0] + change[0] * share - offset[0]
    rp1 = start[1] + change[1] * share - offset[1]
    delta = start[2] + change[2] * share
    half_m0 = m0 + 0.5 * width * change[0]
    half_rp1 = rp1 + 0.5 * width * change[1]
    half_delta = delta + 0.5 * width * change[2]
    _rates(x, m0, rp1, delta, p, extended, total)
    for i in range(12):
        probe[i] = x[i] + 0.5 * dt_s * total[i]
    _rates(probe, half_m0, half_rp1, half_delta, p, extended, slope)
    for i in range(12):
        total[i] += 2.0 * slope[i]
        probe[i] = x[i] + 0.5 * dt_s * slope[i]
    _rates(probe, half_m0, half_rp1, half_delta, p, extended, slope)
    for i in range(12):
        total[i] += 2.0 * slope[i]
        probe[i] = x[i] + dt_s * slope[i]
    _rates(
        probe,
        m0 + width * change[0],
        rp1 + width * change[1],
        delta + width * change[2],
        p,
        extended,
        slope,
    )
    for i in range(12):
        x[i] += dt_s / 6.0 * (total[i] + slope[i])


@inlined_kernel
def _parts(x: FloatArray, p: FloatArray, dt_s: float) -> int:
    """Into how many parts a step is cut so that pitch damping stays stable; 0 when it is lost."""
    squared = x[6] * x[6] + x[7] * x[7] + x[8] * x[8]
    if not squared < _FASTEST_M_S * _FASTEST_M_S:
        return 0
    damping = (
        0.5 * p[body.WATER_DENSITY] * p[body.AREA] * squared * abs(p[body.PITCH_DAMPING])
    ) / p[body.INERTIA_2]
    wanted = damping * dt_s / 1.5
    return 0 if wanted >= _MOST_PARTS else 1 + int(wanted)


@kernel
def roll_out(
    x: FloatArray,
    segment: int,
    nodes: tuple[IntArray, FloatArray, FloatArray, IntArray],
    offset: FloatArray,
    p: FloatArray,
    extended: bool,
    scratch: FloatArray,
    predicted: FloatArray,
) -> bool:
    """Simulate one segment and note position and attitude at its recorded rows.

    Args:
        x: State at the first node, shape ``(12,)``; changed in place.
        segment: Number of the segment.
        nodes: First node of each segment and one past the last, ``(segments + 1,)``; net mass,
            sliding mass and tail at each node, ``(nodes, 3)``, interpolated between two; time from
            each node to the next, ``(nodes,)``; row of ``predicted`` that belongs to each, or -1.
        offset: What is subtracted from the feedback of net mass and sliding mass, shape ``(2,)``.
        p: Packed vehicle.
        extended: Whether the water's forces are those of Eq. 5.18.
        scratch: Shape ``(4, 12)``.
        predicted: Position NED and attitude, shape ``(rows, 6)``; written.

    Returns:
        Whether the motion stayed within all bounds.
    """
    segment_node, node_inputs, node_step_s, node_row = nodes
    first, last = segment_node[segment], segment_node[segment + 1] - 1
    change = scratch[3]
    for node in range(first, last + 1):
        row = node_row[node]
        if row >= 0:
            for i in range(6):
                predicted[row, i] = x[i]
        if node == last:
            break
        dt_s = node_step_s[node]
        parts = _parts(x, p, dt_s)
        if parts == 0:
            return False
        for i in range(3):
            change[i] = node_inputs[node + 1, i] - node_inputs[node, i]
        width = 1.0 / parts
        for part in range(parts):
            _runge_kutta(
                x,
                node_inputs[node],
                change,
                part * width,
                width,
                offset,
                p,
                extended,
                dt_s * width,
                scratch[0],
                scratch[1],
                scratch[2],
            )
    return True


@kernel
def predict(
    packed: FloatArray,
    offsets: FloatArray,
    initial: FloatArray,
    extended: bool,
    segment_node: IntArray,
    node_inputs: FloatArray,
    node_step_s: FloatArray,
    node_row: IntArray,
    predicted: FloatArray,
    sound: BoolArray,
) -> None:
    """Simulate all segments for several candidates.

    Args:
        packed: Packed vehicle of each candidate, shape ``(m, k)``.
        offsets: As in ``roll_out``, shape ``(m, 2)``.
        initial: Initial state of each segment, shape ``(m, segments, 12)``.
        extended: As in ``roll_out``.
        segment_node: First node of each segment, and one past the last, ``(segments + 1,)``.
        node_inputs: As ``nodes`` of ``roll_out``.
        node_step_s: Likewise.
        node_row: Likewise.
        predicted: Shape ``(m, rows, 6)``; written.
        sound: Whether the candidate stayed within all bounds, shape ``(m,)``; written.
    """
    scratch = np.empty((4, 12))
    nodes = (segment_node, node_inputs, node_step_s, node_row)
    for candidate in range(packed.shape[0]):
        sound[candidate] = True
        for segment in range(segment_node.size - 1):
            x = initial[candidate, segment].copy()
            stayed = roll_out(
                x,
                segment,
                nodes,
                offsets[candidate],
                packed[candidate],
                extended,
                scratch,
                predicted[candidate],
            )
            sound[candidate] = sound[candidate] and stayed


@kernel
def costs_into(
    packed: FloatArray,
    offsets: FloatArray,
    initial: FloatArray,
    extended: bool,
    segment_node: IntArray,
    node_inputs: FloatArray,
    node_step_s: FloatArray,
    node_row: IntArray,
    segment_row: IntArray,
    measured: FloatArray,
    weight: FloatArray,
    basis: FloatArray,
    lean: FloatArray,
    constant: float,
    costs: FloatArray,
) -> None:
    """Write the sum of squared weighted residuals of each candidate into ``costs``.

    What a change of the initial states could remove is removed, to first order: the residual is
    projected onto what lies across ``basis``.

    Args:
        packed: As in ``predict``.
        offsets: As in ``predict``.
        initial: Shape ``(segments, 12)``, for all candidates.
        extended: As in ``roll_out``.
        segment_node: As in ``predict``.
        node_inputs: As ``nodes`` of ``roll_out``.
        node_step_s: Likewise.
        node_row: Likewise.
        segment_row: First row of each segment, and one past the last, ``(segments + 1,)``.
        measured: Position NED and attitude, shape ``(rows, 6)``.
        weight: One over the standard deviation, 0 where nothing was measured, ``(rows, 6)``.
        basis: Orthonormal directions of each segment's initial state, shape ``(rows, 6, 12)``.
        lean: Part of the initial states' prior in each direction, shape ``(segments, 12)``.
        constant: The prior's own sum of squares.
        costs: Shape ``(m,)``; written.
    """
    scratch = np.empty((4, 12))
    nodes = (segment_node, node_inputs, node_step_s, node_row)
    predicted = np.empty((measured.shape[0], 6))
    x = np.empty(12)
    shadow = np.empty(12)
    for candidate in range(packed.shape[0]):
        total = constant
        for segment in range(segment_node.size - 1):
            for i in range(12):
                x[i] = initial[segment, i]
                shadow[i] = lean[segment, i]
            offset, p = offsets[candidate], packed[candidate]
            if not roll_out(x, segment, nodes, offset, p, extended, scratch, predicted):
                total = DIVERGED
                break
            for row in range(segment_row[segment], segment_row[segment + 1]):
                for channel in range(6):
                    if weight[row, channel] == 0.0:
                        continue
                    error = predicted[row, channel] - measured[row, channel]
                    if channel >= 3:
                        error -= 2.0 * math.pi * math.floor(error / (2.0 * math.pi) + 0.5)
                    error *= weight[row, channel]
                    total += error * error
                    for i in range(12):
                        shadow[i] += error * basis[row, channel, i]
            for i in range(12):
                total -= shadow[i] * shadow[i]
        costs[candidate] = min(total, DIVERGED) if total == total else DIVERGED


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    packed = np.ones((1, body.DELTA_RATE + 1))
    offsets, initial = np.zeros((1, 2)), np.zeros((1, 1, 12))
    ends = np.array([0, 2])
    nodes = (ends, np.zeros((2, 3)), np.full(2, 0.1), np.array([0, 1]))
    predict(
        packed, offsets, initial, False, *nodes, np.empty((1, 2, 6)), np.empty(1, dtype=np.bool_)
    )
    costs_into(
        packed,
        offsets,
        initial[0],
        False,
        *nodes,
        ends,
        np.zeros((2, 6)),
        np.ones((2, 6)),
        np.zeros((2, 6, 12)),
        np.zeros((1, 12)),
        0.0,
        np.empty(1),
    )
