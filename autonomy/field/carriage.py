"""Samples of a field that moves with the water: brought to where their water is now.

Each dive is carried by the current map from the moment of its middle to that of the map, along the
mean way; its samples share the way and the doubt of it, which counts as an error of position that
they have in common. Depth stays. It pays where the water moves by between a quarter and four
fifths of a length scale during a survey, and harms in still water: a person says which it is.
"""

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.samples import FieldSamples
from autonomy.site import Box

WARNED_SHARE = 0.3
"""Part of a horizontal length scale by which the oldest samples have to be misplaced to be told."""
_OLDEST = 0.25
_BEYOND = 0.5
"""Samples carried so many domain widths outside of it tell nothing of it."""


class Way(Protocol):
    """How far water is carried, and how sure that is."""

    @property
    def mean_ne_m(self) -> FloatArray:
        """North and east, shape ``(2,)``, m."""
        ...

    @property
    def cov_m2(self) -> FloatArray:
        """Covariance of both, shape ``(2, 2)``, m^2."""
        ...


class Carrier(Protocol):
    """A current map, as far as samples are carried by it."""

    def carriage(self, place_ned: tuple[float, float, float], from_s: float, to_s: float) -> Way:
        """Return how far the water at a place goes from one moment to another."""
        ...


@dataclass(frozen=True, slots=True)
class Drifted:
    """How far the water of the oldest quarter of samples has moved since they were taken."""

    way_m: float
    std_m: float


def carried(samples: FieldSamples, carrier: Carrier, now_s: float, domain: Box) -> FieldSamples:
    """Return samples where their water is at a moment; those carried far outside are left out.

    Args:
        samples: Where they were taken.
        carrier: Map of the current.
        now_s: Time of the map, on the clock of the samples.
        domain: What is mapped.
    """
    points = samples.points.copy()
    doubt_m = np.zeros(len(samples))
    for mine, way in _ways(samples, carrier, now_s):
        points[mine, :2] += way.mean_ne_m
        doubt_m[mine] = _largest_std(way)
    moved = replace(
        samples, points=points, reckoning=replace(samples.reckoning, carriage_std_m=doubt_m)
    )
    width_m = np.array([domain.x_max_m - domain.x_min_m, domain.y_max_m - domain.y_min_m])
    low = np.array([domain.x_min_m, domain.y_min_m]) - _BEYOND * width_m
    high = np.array([domain.x_max_m, domain.y_max_m]) + _BEYOND * width_m
    is_near = np.all((points[:, :2] >= low) & (points[:, :2] <= high), axis=1)
    return moved[np.flatnonzero(is_near)]


def drifted(samples: FieldSamples, carrier: Carrier, now_s: float) -> Drifted | None:
    """Return how far the water of the oldest quarter of samples has moved; None without samples."""
    if not len(samples):
        return None
    oldest = samples[np.argsort(samples.time_s, kind="stable")[: math.ceil(_OLDEST * len(samples))]]
    way_m = variance = 0.0
    for mine, way in _ways(oldest, carrier, now_s):
        share = len(mine) / len(oldest)
        way_m += share * float(np.linalg.norm(way.mean_ne_m))
        variance += share * _largest_std(way) ** 2
    return Drifted(way_m, math.sqrt(variance))


def _ways(samples: FieldSamples, carrier: Carrier, now_s: float) -> list[tuple[IntArray, Way]]:
    found: list[tuple[IntArray, Way]] = []
    for number in np.unique(samples.dive):
        mine = np.flatnonzero(samples.dive == number)
        north, east, down = samples.points[mine].mean(axis=0).tolist()
        taken_s = float(0.5 * (samples.time_s[mine].min() + samples.time_s[mine].max()))
        found.append((mine, carrier.carriage((north, east, down), taken_s, now_s)))
    return found


def _largest_std(way: Way) -> float:
    return math.sqrt(max(float(np.linalg.eigvalsh(way.cov_m2)[-1]), 0.0))
