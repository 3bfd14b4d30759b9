r"""Where a tag that rests may be, by where it was heard and by where it was not.

A tag transmits at random times, one in ``delay`` on the average, and of those at the distance d the
share

.. math:: p(d) = top / (1 + \exp((d - d_{50}) / w))

is heard. Of n detections at :math:`r_i` beside a receiver at :math:`r(t)`, a tag of the rate
:math:`\lambda` at x says

.. math:: \log P(x) = \sum_i \log p(|x - r_i|) + n \log \lambda - \lambda E(x), \quad
    E(x) = \int p(|x - r(t)|) dt.

The rate is not known exactly: of a gamma distribution around 1 / delay with the shape
:math:`a = 1 / doubt^2` its part is integrated to :math:`-(a + n) \log(a \, delay + E(x))`. Neither
is the range: :math:`d_{50}` and w are scaled alike by a log-normal factor, which is summed over.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.tag.config import TagConfig

CELLS = 100
"""Cells of the grid along each side."""
_NODES = 5
"""Ranges that are tried where the range is in doubt."""
_WIDTHS_A_STEP = 0.25
"""The track is joined into steps of so many widths."""
_FAR = 500.0
"""Widths beyond the half range from where on all is alike silent."""
_CHUNK = 200
"""Points of the track that are held against the whole grid at a time."""


def heard_share(distance_m: FloatArray, config: TagConfig, scale: float = 1.0) -> FloatArray:
    """Return which part of a tag's transmissions is heard at a distance.

    Args:
        distance_m: Between tag and receiver, m.
        config: How tags are heard.
        scale: Factor of the range.
    """
    beyond = (distance_m / scale - config.half_range_m) / config.width_m
    return config.top / (1.0 + np.exp(np.minimum(beyond, _FAR)))


@dataclass(frozen=True, slots=True)
class Extent:
    """The rectangle that a grid covers, m."""

    north_min_m: float
    north_max_m: float
    east_min_m: float
    east_max_m: float

    def __post_init__(self) -> None:
        """Refuse a rectangle without area."""
        if not (self.north_max_m > self.north_min_m and self.east_max_m > self.east_min_m):
            raise ValueError("the extent of a grid has no area")

    @classmethod
    def around(cls, places_ne_m: FloatArray, config: TagConfig) -> "Extent":
        """Return the square that holds every place from which these could have been heard."""
        reach_m = config.half_range_m * (1.0 + config.range_doubt) + 4.0 * config.width_m
        low, high = places_ne_m.min(axis=0) - reach_m, places_ne_m.max(axis=0) + reach_m
        middle, half = (low + high) / 2.0, float(np.max(high - low)) / 2.0
        north, east = middle.tolist()
        return cls(north - half, north + half, east - half, east + half)

    @property
    def north_m(self) -> FloatArray:
        """Middles of the rows, ascending."""
        return _middles(self.north_min_m, self.north_max_m)

    @property
    def east_m(self) -> FloatArray:
        """Middles of the columns, ascending."""
        return _middles(self.east_min_m, self.east_max_m)


@dataclass(frozen=True, slots=True)
class RestingPlace:
    """Where a tag is if it stays where it is."""

    extent: Extent
    probability: FloatArray
    """Of each cell, rows north and columns east; they add up to 1."""

    @property
    def mean_ne_m(self) -> tuple[float, float]:
        """The place that is least wrong, in the mean of squares."""
        rows, columns = self.probability.sum(axis=1), self.probability.sum(axis=0)
        return float(rows @ self.extent.north_m), float(columns @ self.extent.east_m)

    def region(self, share: float) -> BoolArray:
        """Return the smallest set of cells that holds the tag with this probability."""
        flat = self.probability.ravel()
        order = np.argsort(-flat, kind="stable")
        before = np.concatenate(([0.0], np.cumsum(flat[order])[:-1]))
        inside = np.empty(flat.size, dtype=np.bool_)
        inside[order] = before < share
        return inside.reshape(self.probability.shape)


def resting_place(
    detected_ne_m: FloatArray,
    track_ne_m: FloatArray,
    listened_s: FloatArray,
    config: TagConfig,
    extent: Extent,
    inside: BoolArray | None = None,
) -> RestingPlace:
    """Return where a tag is that stays where it is.

    Args:
        detected_ne_m: Where the receiver was at each detection, shape ``(n, 2)``, m.
        track_ne_m: Where it was while it listened, shape ``(m, 2)``, m.
        listened_s: How long it listened at each of these, shape ``(m,)``, s.
        config: How tags are heard.
        extent: What the grid covers.
        inside: Cells in which a tag can be; by default all.

    Raises:
        ValueError: If there is no detection, or no cell in which a tag can be.
    """
    if not len(detected_ne_m):
        raise ValueError("a tag that was never heard may be anywhere")
    if inside is not None and not inside.any():
        raise ValueError("no cell of the grid is water")
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    if config.range_doubt == 0.0:
        nodes, weights = np.zeros(1), np.ones(1)
    scales = np.exp(config.range_doubt * nodes)
    count = len(detected_ne_m)
    log_heard = np.zeros((len(scales), CELLS * CELLS))
    for distance_m in _distances(detected_ne_m, extent):
        for index, scale in enumerate(scales):
            log_heard[index] += _log_heard_share(distance_m, config, scale).sum(axis=0)
    expected_s = np.zeros_like(log_heard)
    places, seconds = _joined(track_ne_m, listened_s, _WIDTHS_A_STEP * config.width_m)
    for first, distance_m in enumerate(_distances(places, extent)):
        part = seconds[first * _CHUNK : (first + 1) * _CHUNK]
        for index, scale in enumerate(scales):
            expected_s[index] += part @ heard_share(distance_m, config, scale)
    log_each = log_heard + _log_of_rate(expected_s, count, config) + np.log(weights)[:, None]
    log_cells = np.logaddexp.reduce(log_each, axis=0)
    if inside is not None:
        log_cells = np.where(inside.ravel(), log_cells, -np.inf)
    cells = np.exp(log_cells - log_cells.max())
    return RestingPlace(extent, (cells / cells.sum()).reshape(CELLS, CELLS))


def _log_of_rate(expected_s: FloatArray, count: int, config: TagConfig) -> FloatArray:
    """Return what the number of detections says, the rate of the tag integrated out."""
    if config.delay_doubt == 0.0:
        return -expected_s / config.delay_s
    shape = config.delay_doubt**-2
    return -(shape + count) * np.log(shape * config.delay_s + expected_s)


def _log_heard_share(distance_m: FloatArray, config: TagConfig, scale: float) -> FloatArray:
    beyond = (distance_m / scale - config.half_range_m) / config.width_m
    return np.log(config.top) - np.logaddexp(0.0, beyond)


def _distances(places_ne_m: FloatArray, extent: Extent) -> Iterator[FloatArray]:
    """Yield the distances of ``_CHUNK`` places at a time from every cell, m."""
    north, east = np.meshgrid(extent.north_m, extent.east_m, indexing="ij")
    for first in range(0, len(places_ne_m), _CHUNK):
        part = places_ne_m[first : first + _CHUNK]
        yield np.hypot(north.ravel() - part[:, :1], east.ravel() - part[:, 1:])


def _joined(
    track_ne_m: FloatArray, listened_s: FloatArray, step_m: float
) -> tuple[FloatArray, FloatArray]:
    """Return the track with all that lies in one square of ``step_m`` made one point."""
    squares = np.floor(track_ne_m / step_m)
    _, which = np.unique(squares, axis=0, return_inverse=True)
    which = which.ravel()
    seconds = np.bincount(which, listened_s).astype(np.float64)
    weight = np.bincount(which, listened_s + 1e-9)
    places = [np.bincount(which, (listened_s + 1e-9) * axis) / weight for axis in track_ne_m.T]
    return np.column_stack(places), seconds


def _middles(low: float, high: float) -> FloatArray:
    edges = np.linspace(low, high, CELLS + 1)
    return (edges[:-1] + edges[1:]) / 2.0
