"""Arrays of the information-gain objective, beside those of the graph.

Where an array has two parts, part 0 is given the past samples D, part 1 given D and the field f*
at the test points. Points are scaled so that the covariance depends on their distance alone.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray, IntArray
from autonomy.planner.belief import FieldBelief, SampleNoise, averaged_samples, sample_noise
from autonomy.planner.config import PlannerConfig
from autonomy.planner.graph import DEPTH_MAX, Graph, Int32Array
from autonomy.planner.information.cholesky import inverse_factor
from autonomy.planner.information.covariance import Covariance, covariance_of, scale_of
from autonomy.planner.objective import known_covariance
from autonomy.planner.search.staging import GAP_MAX

Float32Array = npt.NDArray[np.float32]
USED, STAMP, CROSSES, REST = range(4)
"""Places in ``Information.tally``."""
BAND = 64
"""Rows of the inverse factor that are multiplied at once."""
_CROSSES_MAX = 512
_OWN_PIECES = 2


class Stack(NamedTuple):
    """Points of all staged edges in a row, then those of the edges that they may replace."""

    begin: IntArray
    """First row of each staged edge, and one behind the last, ``(staged + 1,)``."""
    place: FloatArray
    """Scaled points, ``(3, rows)``."""
    noise: FloatArray
    columns: FloatArray
    """Room for covariances of the known points with those of the stack, ``(n + q) rows``."""
    white: FloatArray
    """Room for the same, whitened."""
    past: Float32Array
    """Whitened columns, past samples, ``(rows, n)``."""
    test: Float32Array
    """Whitened columns, test points, ``(rows, q)``."""
    own: FloatArray
    """Covariance with noise among the points of each staged edge, ``(staged, 2, k, k)``."""
    gain: FloatArray
    """Gain of each staged edge alone, ``(staged,)``."""


class Chains(NamedTuple):
    """What the graph's paths are extended with."""

    row_at: IntArray
    """Where the factor rows of each path begin in ``rows``."""
    rows: Float32Array
    """Rows that each path's last edge adds to the two Cholesky factors."""
    gain: FloatArray
    """Gain of each path."""
    cross_stamp: IntArray
    """Stamp at which each edge's covariance with the current one was computed."""
    cross_slot: Int32Array
    """Where that covariance is in ``cross``."""
    cross: Float32Array
    """Covariances of earlier edges with the current one, ``(slots, 2, k k)``."""
    work: Float32Array
    """Room for solved covariances of a chain's points with the current edge, and a product."""
    factor: FloatArray
    """Last diagonal block of both Cholesky factors, ``(2, k, k)``."""
    chain: IntArray
    """Edge, place in ``rows``, and points before it, of each edge of a chain."""


class Rest(NamedTuple):
    """What proposals for the gaps of a trajectory are judged with; r is the rest's points."""

    place: FloatArray
    noise: FloatArray
    past: Float32Array
    test: Float32Array
    factor: FloatArray
    """Room for a factor of the rest's covariance and its inverse, ``(2, r r)``."""
    inverse: Float32Array
    cross: Float32Array
    """Covariances of the stack's points with the rest, ``(rows r)``."""
    explained: Float32Array
    solved: Float32Array
    """The same, solved with either factor, ``(2, rows r)``."""
    piece_row: IntArray
    """First row in the stack of each proposal, then of what it may replace, and one behind the
    last, ``(proposals + 2, 2)``."""
    pair_place: FloatArray
    """The points of one or two pieces together, and their columns."""
    pair_noise: FloatArray
    pair_past: Float32Array
    pair_test: Float32Array
    pair_solved: Float32Array
    pair_product: Float32Array
    pair_covariance: FloatArray


class Information(NamedTuple):
    """What the gain of trajectories is computed from; k is the most points of an edge."""

    covariance: Covariance
    sample_noise: SampleNoise
    scale: FloatArray
    """What the coordinates are multiplied with, ``(3,)``."""
    origin: FloatArray
    """What is subtracted from them before, ``(3,)``."""
    known: FloatArray
    """Past samples, then test points, scaled, ``(3, n + q)``."""
    inverse: FloatArray
    """Inverse of the lower factor of the known points' covariance: for every ``BAND`` rows of it
    the part up to the diagonal, one behind another."""
    tally: IntArray
    """Numbers of ``Chains.rows`` in use, stamp of the current edge, cross covariances in use,
    points of the rest."""
    samples: Int32Array
    """Number of points that stand for each edge, ``(edges,)``."""
    place: FloatArray
    """Scaled points of each edge, ``(edges, 3, k)``."""
    noise: FloatArray
    """Noise variance of each point of an edge, ``(edges, k)``."""
    white_past: Float32Array
    """Whitened columns of each edge, past samples, ``(edges, k, n)``."""
    white_test: Float32Array
    """Whitened columns of each edge, test points, ``(edges, k, q)``."""
    distance: FloatArray
    """Room for a row of distances."""
    stack: Stack
    chains: Chains
    rest: Rest


def information_of(
    config: PlannerConfig, belief: FieldBelief, graph: Graph, rows: int
) -> Information:
    """Lay out the arrays for a graph, with room for ``rows`` numbers of Cholesky factors.

    They are large but untouched: the system gives memory to the part in use only.
    """
    noise = sample_noise(config, belief)
    points, past_noise = averaged_samples(
        *belief.known_samples(noise), config.search.past_samples_max
    )
    inverse = inverse_factor(known_covariance(belief, points, past_noise))
    size, past = len(inverse), len(points)
    scale, origin = scale_of(belief), belief.test_points.mean(axis=0)
    known = (np.concatenate([points, belief.test_points]) - origin) * scale
    edges, k = len(graph.edge_leg_count), config.search.points_per_edge_max
    staged = len(graph.staged_point_count)
    stacked = (staged + _OWN_PIECES * GAP_MAX) * k
    return Information(
        covariance=covariance_of(belief),
        sample_noise=noise,
        scale=scale,
        origin=origin,
        known=np.ascontiguousarray(known.T),
        inverse=_bands(inverse),
        tally=np.zeros(4, dtype=np.int64),
        samples=np.empty(edges, dtype=np.int32),
        place=np.empty((edges, 3, k)),
        noise=np.empty((edges, k)),
        white_past=_room(edges, k, past),
        white_test=_room(edges, k, size - past),
        distance=np.empty(max(size, stacked, DEPTH_MAX * k)),
        stack=_stack(staged, stacked, k, past, size),
        chains=_chains(graph, k, rows),
        rest=_rest(staged, stacked, k, past, size),
    )


def _stack(staged: int, rows: int, k: int, past: int, size: int) -> Stack:
    return Stack(
        begin=np.zeros(staged + 1, dtype=np.int64),
        place=np.empty((3, rows)),
        noise=np.empty(rows),
        columns=np.empty(size * rows),
        white=np.empty(size * rows),
        past=_room(rows, past),
        test=_room(rows, size - past),
        own=np.empty((staged, 2, k, k)),
        gain=np.empty(staged),
    )


def _chains(graph: Graph, k: int, rows: int) -> Chains:
    edges, paths = len(graph.edge_leg_count), len(graph.path_worth)
    gain = np.empty(paths)
    gain[0] = 0.0
    return Chains(
        row_at=np.empty(paths, dtype=np.int64),
        rows=_room(rows),
        gain=gain,
        cross_stamp=np.full(edges, -1, dtype=np.int64),
        cross_slot=np.empty(edges, dtype=np.int32),
        cross=_room(_CROSSES_MAX, 2, k * k),
        work=_room(4, DEPTH_MAX * k * k),
        factor=np.empty((2, k, k)),
        chain=np.empty((DEPTH_MAX + 1, 3), dtype=np.int64),
    )


def _rest(staged: int, rows: int, k: int, past: int, size: int) -> Rest:
    r, pair = DEPTH_MAX * k, _OWN_PIECES * GAP_MAX * k
    return Rest(
        place=np.empty((3, r)),
        noise=np.empty(r),
        past=_room(r, past),
        test=_room(r, size - past),
        factor=np.empty((2, r * r)),
        inverse=_room(r * r),
        cross=_room(rows * r),
        explained=_room(max(rows, r) * r),
        solved=_room(2, rows * r),
        piece_row=np.zeros((staged + _OWN_PIECES, 2), dtype=np.int64),
        pair_place=np.empty((3, pair)),
        pair_noise=np.empty(pair),
        pair_past=_room(pair, past),
        pair_test=_room(pair, size - past),
        pair_solved=_room(2, pair * r),
        pair_product=_room(pair * pair),
        pair_covariance=np.empty((2, pair * pair)),
    )


def _room(*shape: int) -> Float32Array:
    return np.empty(shape, dtype=np.float32)


def _bands(inverse: FloatArray) -> FloatArray:
    """Return the lower triangle in bands of rows, each without what lies behind its diagonal."""
    starts = range(0, len(inverse), BAND)
    return np.concatenate([inverse[i : i + BAND, : i + BAND].ravel() for i in starts])


def bytes_per_edge(known: int, k: int) -> int:
    """Return about how many bytes an edge of k points takes here, beside so many known points."""
    return k * (4 * known + 32) + 16
