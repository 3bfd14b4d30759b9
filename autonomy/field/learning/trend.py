"""The mean of a field that is learned together with its kernel."""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import FieldConfig


@dataclass(frozen=True, slots=True, eq=False)
class Trend:
    """Functions of position whose weighted sum is the mean: one, and a slope along each axis.

    Positions are taken about their middle and in shares of their extent; an axis without extent
    has no slope.
    """

    kind: Literal["fixed", "constant", "linear"]
    centre: FloatArray
    """Middle of the samples, shape ``(3,)``, m."""
    extent: FloatArray
    """Of the samples along each axis, shape ``(3,)``, m."""

    @classmethod
    def of(cls, kind: Literal["fixed", "constant", "linear"], points: FloatArray) -> Self:
        """Choose the functions for samples at points ``(n, 3)``, m."""
        return cls(kind, points.mean(axis=0), np.ptp(points, axis=0))

    def basis(self, points: FloatArray) -> FloatArray | None:
        """Return the functions at points, shape ``(n, p)``; none for a fixed mean."""
        ones = np.ones((len(points), 1))
        if self.kind == "fixed":
            return None
        if self.kind == "constant":
            return ones
        return np.column_stack([ones, self._slanted(points)])

    def applied(self, config: FieldConfig, weights: tuple[float, ...]) -> FieldConfig:
        """Return settings whose prior mean is the weighted sum of the functions."""
        if not weights:
            return config
        slope = np.zeros(3)
        has_extent = self.extent > 0.0
        slope[has_extent] = np.array(weights[1:] or (0.0,) * int(has_extent.sum()))
        slope[has_extent] /= self.extent[has_extent]
        north, east, depth = slope.tolist()
        return config.model_copy(
            update={
                "prior_mean": weights[0] - float(slope @ self.centre),
                "slope_north_per_m": north,
                "slope_east_per_m": east,
                "slope_depth_per_m": depth,
            }
        )

    def _slanted(self, points: FloatArray) -> FloatArray:
        has_extent = self.extent > 0.0
        return (points - self.centre)[:, has_extent] / self.extent[has_extent]
