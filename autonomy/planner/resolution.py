r"""Points that no search learns, and how much of the field lies between them.

A search that is judged at test points learns where they are and samples right there. So it is not:
it is told how the field varies between points as close as those that its result will be judged on,
and counts that part of what a sample tells, which no map would show, as noise. The result is judged
on points that nobody knew before.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from autonomy.arrays import FloatArray
from autonomy.field.mask import water_mask
from autonomy.field.model.kernel import covariance
from autonomy.planner.belief import FieldBelief
from autonomy.site import Area, Box, Site

POINTS = 1000
"""Points that a trajectory is judged on."""
_TRIES = 64
"""Points drawn for each that is wanted in the water."""
_PROBES = 256
_REACH = 1.8
"""Length over which the field between the points varies, in mean distances to the nearest; fits
tank and lake, Matern-3/2 and rougher."""
_RELATIVE_JITTER = 1e-9


class FinePart(NamedTuple):
    """What of the field lies between test points, as a field of its own."""

    variance: float
    nearness: float
    """How many times shorter it varies than the field; its correlation has the same shape."""


def drawn_points(
    domain: Box,
    site: Site | None,
    rng: np.random.Generator,
    count: int = POINTS,
    area: Area | None = None,
) -> FloatArray:
    """Return points drawn evenly from the water of a domain, or of an area in it, ``(n, 3)``.

    A sequence of low discrepancy leaves smaller gaps than chance does, and a trajectory is worth up
    to a tenth more on it than on as many random points. Where there is hardly any water they are
    fewer than asked for.
    """
    low = np.array([domain.x_min_m, domain.y_min_m, 0.0])
    high = np.array([domain.x_max_m, domain.y_max_m, domain.depth_max_m])
    found = np.empty((0, 3))
    tried = 0
    while len(found) < count and tried < _TRIES * count:
        tried += count
        points = rng.uniform(low, high, size=(count, 3))
        if site is not None:
            points = points[water_mask(site, points)]
        if area is not None:
            points = points[area.contains(points[:, 0], points[:, 1])]
        found = np.concatenate([found, points])
    return found[:count]


def fine_part(
    belief: FieldBelief,
    domain: Box,
    site: Site | None,
    rng: np.random.Generator,
    area: Area | None = None,
) -> FinePart:
    """Return how a field varies between points as close as those that are judged on.

    Args:
        belief: The kernel.
        domain: Where.
        site: Shore and floor; None for water without end.
        rng: Chooses points, others than those that are judged on.
        area: Part of the domain that is surveyed; None for all.
    """
    points = drawn_points(domain, site, rng, area=area)
    probes = drawn_points(domain, site, rng, _PROBES, area)
    if not len(probes):
        return FinePart(0.0, 1.0)
    kernel, whole = belief.kernel(), belief.signal_variance
    gram = covariance(points, points, kernel)
    gram[np.diag_indices_from(gram)] += _RELATIVE_JITTER * whole
    white = solve_triangular(
        np.linalg.cholesky(gram), covariance(points, probes, kernel), lower=True
    )
    left = whole - np.square(white).sum(axis=0)  # (probes,)
    scaled = np.asarray(belief.length_scales_m)
    apart = (probes[:, None] - points[None]) / scaled  # (probes, n, 3)
    nearest = np.sqrt(np.square(apart).sum(axis=2).min(axis=1))
    reach = _REACH * float(nearest.mean())
    return FinePart(max(float(left.mean()), 0.0), 1.0 / max(reach, _RELATIVE_JITTER))
