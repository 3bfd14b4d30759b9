r"""Arrays of the information-gain objective, beside those of the graph.

A search maximizes :math:`\frac12 [\log\det(C_{pp|D} + N) - \log\det(N + R)]` for planned points p
with noise N and past samples D (``objective.FieldInformation``); R is what of the field lies
between test points (``resolution.FinePart``). There are none that a search could learn, and as N
and R are counted edge by edge, their determinant is a sum over edges. Points are scaled so that the
covariance depends on their distance alone.
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
from autonomy.planner.objective import samples_covariance
from autonomy.planner.resolution import FinePart
from autonomy.planner.search.staging import GAP_MAX

Float32Array = npt.NDArray[np.float32]
USED, STAMP, CROSSES, REST = range(4)
"""Places in ``Information.tally``."""
BAND = 64
"""Rows of the inverse factor that are multiplied at once."""
_CROSSES_MAX = 512
_GAPS = 2
_REPLACED = _GAPS * GAP_MAX
"""Most edges that proposals may replace at once."""


class Stack(NamedTuple):
    """Points of all staged edges in a row, then those of the edges that they may replace."""

    begin: IntArray
    """First row of each edge, and one behind the last, ``(staged + replaced + 1,)``."""
    place: FloatArray
    """Scaled points, ``(3, rows)``."""
    noise: FloatArray
    """Covariance of the noise of each edge's points, ``(staged + replaced, k, k)``."""
    half_noise: FloatArray
    """Half the logarithm of the determinant of that and of the fine part's covariance, ``(staged +
    replaced,)``."""
    columns: FloatArray
    """Room for covariances of the past samples with the points of the stack, ``n rows``."""
    whitened: FloatArray
    """Room for the same, whitened."""
    white: Float32Array
    """Whitened columns, ``(rows, n)``."""
    own: FloatArray
    """Covariance with noise among the points of each staged edge, ``(staged, k, k)``."""
    gain: FloatArray
    """Gain of each staged edge alone, ``(staged,)``."""
    run: FloatArray
    """Room for the averaged points of one edge: time since the dive began, number of the dive,
    position variance, and what the position's error adds, ``(k, 4)``."""


class Chains(NamedTuple):
    """What the graph's paths are extended with."""

    row_at: IntArray
    """Where the factor rows of each path begin in ``rows``."""
    rows: Float32Array
    """Rows that each path's last edge adds to the Cholesky factor."""
    gain: FloatArray
    """Gain of each path."""
    cross_stamp: IntArray
    """Stamp at which each edge's covariance with the current one was computed."""
    cross_slot: Int32Array
    """Where that covariance is in ``cross``."""
    cross: Float32Array
    """Covariances of earlier edges with the current one, ``(slots, k k)``."""
    work: Float32Array
    """Room for solved covariances of a chain's points with the current edge, and two products."""
    factor: FloatArray
    """Last diagonal block of the Cholesky factor, ``(k, k)``."""
    chain: IntArray
    """Edge, place in ``rows``, and points before it, of each edge of a chain."""


class Rest(NamedTuple):
    """What proposals for the gaps of a trajectory are judged with; r is the rest's points."""

    place: FloatArray
    white: Float32Array
    factor: FloatArray
    """Room for a factor of the rest's covariance and its inverse, ``(2, r r)``."""
    inverse: Float32Array
    cross: Float32Array
    """Covariances of the stack's points with the rest, ``(rows r)``."""
    explained: Float32Array
    solved: Float32Array
    """The same, solved with the factor, ``rows r``."""
    piece_edge: IntArray
    """First edge in the stack of each proposal, then of what it may replace, and one behind the
    last, ``(proposals + 2, 2)``."""
    piece_at: IntArray
    """Where each piece begins in the following two, ``(proposals + 2,)``."""
    piece_given: FloatArray
    """Covariance with noise of each piece's points, given past samples and the rest."""
    piece_inverse: Float32Array
    """Inverse of each one's upper Cholesky factor."""
    piece_half_noise: FloatArray
    """Half the logarithm of the determinant of each piece's noise, ``(proposals + 2,)``."""
    pair_cross: Float32Array
    """Room for the covariance between two pieces, the same whitened by the first, and products."""
    pair_white: Float32Array
    pair_product: Float32Array
    pair_covariance: FloatArray
    """Room for a covariance of a piece and another, ``(2, p p)``."""


class Information(NamedTuple):
    """What the gain of trajectories is computed from; k is the most points of an edge."""

    covariance: Covariance
    sample_noise: SampleNoise
    fine: FinePart
    scale: FloatArray
    """What the coordinates are multiplied with, ``(3,)``."""
    origin: FloatArray
    """What is subtracted from them before, ``(3,)``."""
    past: FloatArray
    """Past samples, scaled, ``(3, n)``."""
    inverse: FloatArray
    """Inverse of the lower factor of their covariance: for every ``BAND`` rows of it the part up
    to the diagonal, one behind another."""
    tally: IntArray
    """Numbers of ``Chains.rows`` in use, stamp of the current edge, cross covariances in use,
    points of the rest."""
    samples: Int32Array
    """Number of points that stand for each edge, ``(edges,)``."""
    place: FloatArray
    """Scaled points of each edge, ``(edges, 3, k)``."""
    noise: FloatArray
    """Covariance of the noise of each edge's points, ``(edges, k, k)``."""
    half_noise: FloatArray
    """Half the logarithm of the determinant of that and of the fine part's, ``(edges,)``."""
    white: Float32Array
    """Whitened columns of each edge, ``(edges, k, n)``."""
    distance: FloatArray
    """Room for a row of distances."""
    stack: Stack
    chains: Chains
    rest: Rest


def information_of(
    config: PlannerConfig, belief: FieldBelief, fine: FinePart, graph: Graph, rows: int
) -> Information:
    """Lay out the arrays for a graph, with room for ``rows`` numbers of Cholesky factors.

    They are large but untouched: the system gives memory to the part in use only.
    """
    noise = sample_noise(config, belief)
    points, past_noise = averaged_samples(
        *belief.known_samples(noise), config.search.past_samples_max
    )
    inverse = inverse_factor(samples_covariance(belief, points, past_noise))
    past, scale = len(points), scale_of(belief)
    domain = config.domain
    origin = 0.5 * np.array(
        [
            domain.x_min_m + domain.x_max_m,
            domain.y_min_m + domain.y_max_m,
            domain.depth_max_m,
        ]
    )
    edges, k = len(graph.edge_leg_count), config.search.points_per_edge_max
    staged = len(graph.staged_point_count)
    rows_max = (staged + _REPLACED) * k
    return Information(
        covariance=covariance_of(belief),
        sample_noise=noise,
        fine=fine,
        scale=scale,
        origin=origin,
        past=np.ascontiguousarray(((points - origin) * scale).T),
        inverse=_bands(inverse),
        tally=np.zeros(4, dtype=np.int64),
        samples=np.empty(edges, dtype=np.int32),
        place=np.empty((edges, 3, k)),
        noise=np.empty((edges, k, k)),
        half_noise=np.empty(edges),
        white=_room(edges, k, past),
        distance=np.empty(max(past, rows_max, DEPTH_MAX * k)),
        stack=_stack(staged, k, past),
        chains=_chains(graph, k, rows),
        rest=_rest(staged, rows_max, k, past),
    )


def _stack(staged: int, k: int, past: int) -> Stack:
    stacked = staged + _REPLACED
    return Stack(
        begin=np.zeros(stacked + 1, dtype=np.int64),
        place=np.empty((3, stacked * k)),
        noise=np.empty((stacked, k, k)),
        half_noise=np.empty(stacked),
        columns=np.empty(past * stacked * k),
        whitened=np.empty(past * stacked * k),
        white=_room(stacked * k, past),
        own=np.empty((staged, k, k)),
        gain=np.empty(staged),
        run=np.empty((k, 4)),
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
        cross=_room(_CROSSES_MAX, k * k),
        work=_room(3, DEPTH_MAX * k * k),
        factor=np.empty((k, k)),
        chain=np.empty((DEPTH_MAX + 1, 3), dtype=np.int64),
    )


def _rest(staged: int, rows: int, k: int, past: int) -> Rest:
    r, piece = DEPTH_MAX * k, GAP_MAX * k
    return Rest(
        place=np.empty((3, r)),
        white=_room(r, past),
        factor=np.empty((2, r * r)),
        inverse=_room(r * r),
        cross=_room(rows * r),
        explained=_room(max(rows, r) * r),
        solved=_room(rows * r),
        piece_edge=np.zeros((staged + _GAPS, 2), dtype=np.int64),
        piece_at=np.zeros(staged + _GAPS, dtype=np.int64),
        piece_given=np.empty(rows * piece),
        piece_inverse=_room(rows * piece),
        piece_half_noise=np.zeros(staged + _GAPS),
        pair_cross=_room(piece * piece),
        pair_white=_room(piece * piece),
        pair_product=_room(piece * piece),
        pair_covariance=np.empty((2, piece * piece)),
    )


def _room(*shape: int) -> Float32Array:
    return np.empty(shape, dtype=np.float32)


def _bands(inverse: FloatArray) -> FloatArray:
    """Return the lower triangle in bands of rows, each without what lies behind its diagonal."""
    starts = range(0, len(inverse), BAND)
    bands = [inverse[i : i + BAND, : i + BAND].ravel() for i in starts]
    return np.concatenate([np.empty(0), *bands])


def bytes_per_edge(past: int, k: int) -> int:
    """Return about how many bytes an edge of k points takes here, beside so many past samples."""
    return k * (4 * past + 8 * k + 24) + 24
