"""Arrays of the information-gain objective, beside those of the graph.

Where an array has two parts, part 0 is given the past samples D, part 1 given D and the field f*
at the test points.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray, IntArray
from autonomy.planner.belief import FieldBelief, averaged_samples
from autonomy.planner.cholesky import inverse_factor
from autonomy.planner.config import PlannerConfig
from autonomy.planner.graph import DEPTH_MAX, Graph, Int32Array
from autonomy.planner.objective import known_covariance

Float32Array = npt.NDArray[np.float32]
USED, STAMP, CROSSES = range(3)
"""Places in ``Information.tally``."""
TILE = 64
"""Points whose columns are whitened together."""
_CROSSES_MAX = 512


class Information(NamedTuple):
    """What the gain of trajectories is computed from; k is the most points of an edge."""

    signal_variance: float
    threshold: FloatArray
    """Boundaries of the fidelity levels in position std, ascending."""
    level_noise: FloatArray
    """Noise variance of each level, best level first."""
    scale: FloatArray
    """Root 3 over the length scales, ``(3,)``."""
    known: FloatArray
    """Past samples, then test points, scaled, ``(n + q, 3)``."""
    past: int
    """Number of past samples, n."""
    inverse: FloatArray
    """Inverse Cholesky factor of the known points' covariance, padded with zeros so that its size
    is a multiple of 4."""
    samples: Int32Array
    """Number of points that stand for each edge, ``(edges,)``."""
    place: FloatArray
    """Scaled points of each edge, ``(edges, k, 3)``."""
    noise: FloatArray
    """Noise variance of each point of an edge, ``(edges, k)``."""
    white_past: Float32Array
    """Whitened columns of each edge, rows of past samples, ``(edges, k, n)``."""
    white_test: Float32Array
    """Whitened columns of each edge, rows of test points, ``(edges, k, q)``."""
    own: FloatArray
    """Covariance with noise among the points of each edge, ``(edges, 2, k, k)``."""
    row_at: IntArray
    """Where the factor rows of each path begin in ``rows``."""
    rows: Float32Array
    """Rows that each path's last edge adds to the Cholesky factors; the end is spare."""
    spare: int
    """Where the part of ``rows`` begins that refinement uses."""
    tally: IntArray
    """Numbers of ``rows`` in use, stamp of the current edge, cross covariances in use."""
    cross_stamp: IntArray
    """Stamp at which each edge's covariance with the current one was computed."""
    cross_slot: Int32Array
    """Where that covariance is in ``cross``."""
    cross: Float32Array
    """Covariances of earlier edges with the current one, ``(slots, 2, k k)``."""
    tile_place: FloatArray
    """Scaled points of all staged edges, ``(tiles, 3, TILE)``."""
    tile_columns: FloatArray
    """Covariances of one tile's points with the known points, ``(n + q, TILE)``."""
    tile_white: FloatArray
    """Whitened columns of each tile, ``(tiles, n + q, TILE)``."""
    work: Float32Array
    """Room for solved covariances of a chain's points with the current edge, and a product."""
    factor: FloatArray
    """Last diagonal block of both Cholesky factors, ``(2, k, k)``."""
    edges: Int32Array
    """Room for the edges of one trajectory."""
    chain: IntArray
    """Edge, place in ``rows``, and points before it, of each edge of a chain."""


def information_of(
    config: PlannerConfig, belief: FieldBelief, graph: Graph, rows: int
) -> Information:
    """Lay out the arrays for a graph, with room for ``rows`` numbers of Cholesky factors."""
    thresholds = config.counted_thresholds_m()
    points, noise = averaged_samples(
        belief.sample_points, belief.sample_noise(thresholds), config.search.past_samples_max
    )
    covariance = known_covariance(belief, points, noise)
    size, past = len(covariance), len(points)
    scale = math.sqrt(3.0) / np.asarray(belief.length_scales_m)
    edges, k = len(graph.edge_energy), config.search.points_per_edge_max
    padded = -(-size // 4) * 4
    tiles = -(-len(graph.staged_point_count) * k // TILE)
    return Information(
        signal_variance=belief.signal_variance,
        threshold=np.array(thresholds, dtype=np.float64),
        level_noise=belief.level_noise(thresholds),
        scale=scale,
        known=np.concatenate([points, belief.test_points]) * scale,
        past=past,
        inverse=np.pad(inverse_factor(covariance), (0, padded - size)),
        samples=np.empty(edges, dtype=np.int32),
        place=np.empty((edges, k, 3)),
        noise=np.empty((edges, k)),
        white_past=np.empty((edges, k, past), dtype=np.float32),
        white_test=np.empty((edges, k, size - past), dtype=np.float32),
        own=np.empty((edges, 2, k, k)),
        row_at=np.empty(len(graph.path_energy), dtype=np.int64),
        rows=np.empty(rows + (DEPTH_MAX + 1) ** 2 * k**2, dtype=np.float32),
        spare=rows,
        tally=np.zeros(3, dtype=np.int64),
        cross_stamp=np.full(edges, -1, dtype=np.int64),
        cross_slot=np.empty(edges, dtype=np.int32),
        cross=np.empty((_CROSSES_MAX, 2, k * k), dtype=np.float32),
        tile_place=np.zeros((tiles, 3, TILE)),
        tile_columns=np.zeros((padded, TILE)),
        tile_white=np.empty((tiles, padded, TILE)),
        work=np.empty((3, DEPTH_MAX * k * k), dtype=np.float32),
        factor=np.empty((2, k, k)),
        edges=np.empty(DEPTH_MAX + 1, dtype=np.int32),
        chain=np.empty((DEPTH_MAX + 1, 3), dtype=np.int64),
    )
