"""One hypothesis of the filter bank, and the ways in which one begins."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.filter import hypothesis_kernel as hk
from autonomy.tracking.filter.filter_kernel import (
    R_RANGE,
    START_VELOCITY,
    full_covariance,
    packed_covariance,
)

RING = 12
"""Hypotheses of a ring."""
LEAST_PRIOR = 0.02
"""No place on a ring is taken to be less likely than this against the best, before it is tried."""


@dataclass(slots=True, eq=False)
class Hypothesis:
    """One estimate of the target."""

    h: FloatArray
    """As ``hypothesis_kernel`` lays it out."""
    weight: float
    """Probability; those of a bank add up to 1."""
    bias: float = 0.0
    """Running mean of its normalized innovations; near 0 for a true one."""
    since_s: float = 0.0
    """Time since it took in a range, or began."""

    @property
    def velocity_ne_m_s(self) -> tuple[float, float]:
        """Velocity of the target as its own filter estimates it."""
        return float(self.h[hk.NORTH_RATE]), float(self.h[hk.EAST_RATE])

    @property
    def place_covariance_m2(self) -> tuple[float, float, float]:
        """Of the relative position: north-north, north-east, east-east."""
        return float(self.h[4]), float(self.h[5]), float(self.h[8])

    def copy(self) -> "Hypothesis":
        """Return a copy that shares nothing."""
        return Hypothesis(self.h.copy(), self.weight, self.bias, self.since_s)


def ring(prior: FloatArray, range_m: float, q: FloatArray) -> list[Hypothesis]:
    """Return hypotheses in every direction at one distance.

    Args:
        prior: What was believed before, as ``hypothesis_kernel`` lays it out; places near it start
            likelier, none without a chance.
        range_m: Measured distance.
        q: From ``filter_kernel.pack_filter``.
    """
    variance_m2 = float(q[R_RANGE])
    hypotheses: list[Hypothesis] = []
    for n in range(RING):
        angle = 2.0 * math.pi * n / RING
        h = prior.copy()
        h[0], h[1] = range_m * math.cos(angle), range_m * math.sin(angle)
        spread_place(h, angle, variance_m2, (range_m * math.pi / RING) ** 2 + variance_m2)
        start_velocity(h, q)
        weight = max(math.exp(-0.5 * min(hk.apart(h, prior), 100.0)), LEAST_PRIOR)
        hypotheses.append(Hypothesis(h, weight))
    return hypotheses


def mirrored_across(h: FloatArray, n_n: float, n_e: float, q: FloatArray) -> FloatArray:
    """Reflect the place of a hypothesis across a line through the robot with this unit normal."""
    S = np.eye(4)
    S[:2, :2] -= 2.0 * np.outer([n_n, n_e], [n_n, n_e])
    full = full_covariance(h[hk.COVARIANCE : hk.VELOCITY])
    mirrored = h.copy()
    mirrored[:4] = S @ h[:4]
    mirrored[hk.COVARIANCE : hk.VELOCITY] = packed_covariance(S @ full @ S)
    # The target's velocity was worked out from the other place; start it anew.
    start_velocity(mirrored, q)
    return mirrored


def start_velocity(
    h: FloatArray, q: FloatArray, velocity_ne_m_s: tuple[float, float] = (0.0, 0.0)
) -> None:
    """Begin the velocity filter at the place of a hypothesis."""
    h[hk.VELOCITY : hk.RECKONED] = 0.0
    h[hk.VELOCITY], h[hk.VELOCITY + 1] = h[hk.RECKONED] - h[0], h[hk.RECKONED + 1] - h[1]
    h[hk.NORTH_RATE], h[hk.EAST_RATE] = velocity_ne_m_s
    h[hk.VELOCITY + 4] = 0.5 * (h[4] + h[8])
    h[hk.RATE_VARIANCE], h[hk.VELOCITY + 7] = q[START_VELOCITY], 1.0


def spread_place(h: FloatArray, angle: float, along: float, across: float) -> None:
    """Make a place uncertain by two variances, along a direction and across it."""
    c, s = math.cos(angle), math.sin(angle)
    north_east = c * s * (along - across)
    set_place(h, c * c * along + s * s * across, north_east, s * s * along + c * c * across)


def set_place(h: FloatArray, north_north: float, north_east: float, east_east: float) -> None:
    """Give a place this covariance, and none with heading and speed."""
    h[4], h[5], h[8] = north_north, north_east, east_east
    h[6] = h[7] = h[9] = h[10] = 0.0
