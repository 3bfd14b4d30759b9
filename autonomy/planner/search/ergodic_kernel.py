"""The ergodic measure of many trajectories, compiled.

Every edge and every path keeps the sum of its points' Gaussians over the test points, its *visit*,
so a path's measure is one pass over the test points (``objective.ErgodicMeasure``). The measure is
a concave function of the normalized visit, so the tangent plane at the visit of a trajectory in
hand bounds that of any other from above, by two numbers for each piece of it.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import xlogy

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel
from autonomy.planner.belief import FieldBelief
from autonomy.planner.config import PlannerConfig
from autonomy.planner.graph import (
    ELITE,
    FIRST_A,
    FIRST_B,
    PROPOSALS,
    STAGED,
    TAKEN_A,
    TAKEN_B,
    Graph,
    first_staged,
)
from autonomy.planner.objective import TINY_DENSITY, TINY_PROBABILITY, target_distribution
from autonomy.planner.search.elite import elite_edge, in_gap

Float32Array = npt.NDArray[np.float32]
_NEGLIGIBLE = 40.0
_ROOT_2 = math.sqrt(2.0)
_LOG_2 = math.log(2.0)
_EXPONENT_BITS = 23
_EXPONENT_OF_1 = 127
_MANTISSA = (1 << _EXPONENT_BITS) - 1
_ONE = _EXPONENT_OF_1 << _EXPONENT_BITS


class Ergodic(NamedTuple):
    """Arrays of the ergodic objective, beside those of the graph."""

    scale: FloatArray
    """One over the reach along each axis, ``(3,)``."""
    test: FloatArray
    """Scaled test points, ``(3, q)``."""
    target: Float32Array
    """Where time should be spent, ``(q,)``."""
    ones: Float32Array
    negative_entropy: float
    """Sum of ``p log p`` of the target."""
    edge_visit: Float32Array
    """Sum of Gaussians of each edge, ``(edges, q)``."""
    path_visit: Float32Array
    """Sum of Gaussians of each path, ``(paths, q)``."""
    visit: Float32Array
    """That of the trajectory in question, ``(q,)``."""
    rest: Float32Array
    """That of the edges outside the gaps, ``(q,)``."""
    piece_visit: Float32Array
    """That of each proposal, then of what they may replace, ``(proposals + 2, q)``."""
    slope: Float32Array
    """Derivative of the measure by the normalized visit, at that of the refined one, ``(q,)``."""
    rise: FloatArray
    """Product of each piece's visit with the slope, and its sum; last the rest's,
    ``(proposals + 3, 2)``."""
    logarithm: Float32Array
    """Room, ``(q,)``."""
    bits: npt.NDArray[np.int32]
    """The bits of ``logarithm``."""
    work: FloatArray


def ergodic_of(config: PlannerConfig, belief: FieldBelief, graph: Graph) -> Ergodic:
    """Lay out the arrays for a graph."""
    ergodic = config.ergodic
    scale = 1.0 / np.array([ergodic.reach_north_m, ergodic.reach_east_m, ergodic.reach_depth_m])
    target = target_distribution(belief, ergodic.exploitation)
    q, pieces = len(target), len(graph.staged_point_count) + 2
    path_visit = np.empty((len(graph.path_worth), q), dtype=np.float32)
    path_visit[0] = 0.0
    logarithm = np.empty(q, dtype=np.float32)
    return Ergodic(
        scale=scale,
        test=np.ascontiguousarray((belief.test_points * scale).T),
        target=target.astype(np.float32),
        ones=np.ones(q, dtype=np.float32),
        negative_entropy=float(xlogy(target, target).sum()),
        edge_visit=np.empty((len(graph.edge_leg_count), q), dtype=np.float32),
        path_visit=path_visit,
        visit=np.empty(q, dtype=np.float32),
        rest=np.empty(q, dtype=np.float32),
        piece_visit=np.empty((pieces, q), dtype=np.float32),
        slope=np.empty(q, dtype=np.float32),
        rise=np.empty((pieces + 1, 2)),
        logarithm=logarithm,
        bits=logarithm.view(np.int32),
        work=np.empty(q),
    )


@inner_kernel
def spread(graph: Graph, ergodic: Ergodic) -> None:
    """Sum the Gaussians of every staged edge over the test points."""
    test, work = ergodic.test, ergodic.work
    for staged in range(graph.tally[STAGED]):
        visit = ergodic.edge_visit[first_staged(graph) + staged]
        visit[:] = np.float32(0.0)
        for i in range(graph.staged_point_count[staged]):
            x, y, z = graph.staged_points[staged, i, 1:4] * ergodic.scale
            for j in range(len(visit)):
                dx, dy, dz = test[0, j] - x, test[1, j] - y, test[2, j] - z
                work[j] = min(0.5 * (dx * dx + dy * dy + dz * dz), _NEGLIGIBLE)
            for j in range(len(visit)):
                t = work[j] * (-1.0 / 256.0)
                power = 1.0 + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t / 120.0))))
                for _ in range(8):
                    power *= power
                visit[j] += np.float32(power)


@inner_kernel
def measure(ergodic: Ergodic, visit: Float32Array) -> float:
    """Return the negative divergence of the target from the normalized visit.

    The logarithm is a series in the mantissa, which the compiler can vectorize; its error is that
    of single precision.
    """
    scale = np.float32(1.0 / max(np.dot(visit, ergodic.ones), TINY_DENSITY))
    logarithm, bits = ergodic.logarithm, ergodic.bits
    for j in range(len(visit)):
        logarithm[j] = visit[j] * scale + np.float32(TINY_PROBABILITY)
    cross = 0.0
    for j in range(len(visit)):
        exponent = (bits[j] >> _EXPONENT_BITS) - _EXPONENT_OF_1
        ergodic.work[j] = _LOG_2 * exponent
        bits[j] = (bits[j] & _MANTISSA) | _ONE
    for j in range(len(visit)):
        t = (logarithm[j] - _ROOT_2) / (logarithm[j] + _ROOT_2)
        s = t * t
        series = 1.0 + s * (1.0 / 3.0 + s * (0.2 + s * (1.0 / 7.0 + s / 9.0)))
        logarithm[j] = np.float32(ergodic.work[j] + 0.5 * _LOG_2 + 2.0 * t * series)
    cross = float(np.dot(ergodic.target, logarithm))
    return cross - ergodic.negative_entropy


@inner_kernel
def visit_after(graph: Graph, ergodic: Ergodic, path: int, edge: int) -> float:
    """Set ``visit`` to that of a path and one more edge; return its measure."""
    visit = ergodic.visit
    before, added = ergodic.path_visit[path], ergodic.edge_visit[edge]
    for j in range(len(visit)):
        visit[j] = before[j] + added[j]
    return measure(ergodic, visit)


@inner_kernel
def prepare_pieces(graph: Graph, ergodic: Ergodic) -> float:
    """Sum the visits of every piece and of the rest, and lay the tangent plane.

    Returns:
        What a bound has beside its quotient of two sums (``bound_of``).
    """
    elite, pieces = graph.gap[ELITE], graph.tally[PROPOSALS]
    rest = ergodic.rest
    rest[:] = np.float32(0.0)
    for i in range(graph.elite_length[elite]):
        if not in_gap(graph, i):
            rest += ergodic.edge_visit[elite_edge(graph, elite, i)]
    for piece in range(pieces):
        visit = ergodic.piece_visit[piece]
        visit[:] = np.float32(0.0)
        for staged in range(graph.proposal[piece], graph.proposal[piece + 1]):
            visit += ergodic.edge_visit[first_staged(graph) + staged]
    ergodic.visit[:] = ergodic.rest
    for gap in range(2):
        first = graph.gap[FIRST_A] if gap == 0 else graph.gap[FIRST_B]
        taken = graph.gap[TAKEN_A] if gap == 0 else graph.gap[TAKEN_B]
        visit = ergodic.piece_visit[pieces + gap]
        visit[:] = np.float32(0.0)
        for i in range(first, first + taken):
            visit += ergodic.edge_visit[elite_edge(graph, elite, i)]
        ergodic.visit[:] += visit
    whole, slope = ergodic.visit, ergodic.slope
    total = max(float(np.dot(whole, ergodic.ones)), TINY_DENSITY)
    for j in range(len(whole)):
        slope[j] = ergodic.target[j] / (whole[j] / total + TINY_PROBABILITY)
    for piece in range(pieces + 2):
        _note_rise(ergodic, ergodic.piece_visit[piece], piece)
    _note_rise(ergodic, ergodic.rest, pieces + 2)
    return measure(ergodic, whole) - float(np.dot(slope, whole)) / total


@inner_kernel
def _note_rise(ergodic: Ergodic, visit: Float32Array, piece: int) -> None:
    ergodic.rise[piece, 0] = np.dot(ergodic.slope, visit)
    ergodic.rise[piece, 1] = np.dot(ergodic.ones, visit)


@inner_kernel
def bound_of(ergodic: Ergodic, constant: float, rest: int, one: int, other: int) -> float:
    """Return an upper bound on the measure of the rest (its number) and two pieces."""
    rise = ergodic.rise
    above = rise[rest, 0] + rise[one, 0] + rise[other, 0]
    below = rise[rest, 1] + rise[one, 1] + rise[other, 1]
    return constant + above / max(below, TINY_DENSITY)


@inner_kernel
def measure_with(ergodic: Ergodic, one: int, other: int) -> float:
    """Return the measure of the rest and two pieces."""
    visit = ergodic.visit
    for j in range(len(visit)):
        visit[j] = ergodic.rest[j] + ergodic.piece_visit[one, j] + ergodic.piece_visit[other, j]
    return measure(ergodic, visit)
