"""What a field model believes before it has samples: covariances between places."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.field.config import KernelParameters
from autonomy.field.level_scale import scale_factors, shares
from autonomy.field.model.kernel import covariance, noise_variance


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where, in which fidelity level and when a field is looked at, ``n`` times."""

    points: FloatArray
    """NED, shape ``(n, 3)``, m."""
    level: IntArray
    """Fidelity level, shape ``(n,)``; 0 in models that have none."""
    time_s: FloatArray
    """Shape ``(n,)``."""

    @classmethod
    def of(
        cls, points: FloatArray, *, level: int | IntArray = 0, time_s: float | FloatArray = 0.0
    ) -> "Places":
        """Make places of points ``(n, 3)``, all of one level or time where a scalar is given."""
        n = len(points)
        return cls(
            points,
            np.broadcast_to(np.asarray(level, dtype=np.int64), (n,)),
            np.broadcast_to(np.asarray(time_s, dtype=np.float64), (n,)),
        )

    def __len__(self) -> int:
        """Number of places."""
        return len(self.points)

    def __getitem__(self, chosen: slice | IntArray | BoolArray) -> "Places":
        """Return some of the places, by slice, indices or mask."""
        return Places(self.points[chosen], self.level[chosen], self.time_s[chosen])

    def blocks(self, size: int) -> Iterator[slice]:
        """Yield slices of at most so many places each, which together are all, in order."""
        return (slice(start, start + size) for start in range(0, len(self), size))


class Prior(Protocol):
    """Covariance of a zero-mean field between places that stand still in time."""

    @property
    def variance(self) -> float:
        """Prior variance of the field that is mapped."""
        ...

    @property
    def top_level(self) -> int:
        """Level of the field that is mapped."""
        ...

    def covariance(self, a: Places, b: Places) -> FloatArray:
        """Return covariances between ``n`` and ``m`` places, shape ``(n, m)``."""
        ...

    def noise(self, places: Places) -> FloatArray:
        """Return the noise variance of measurements at places, shape ``(n,)``."""
        ...


@dataclass(frozen=True, slots=True)
class SinglePrior:
    """One kernel for every sample."""

    kernel: KernelParameters

    @property
    def variance(self) -> float:
        """Prior variance of the field."""
        return self.kernel.signal_variance

    @property
    def top_level(self) -> int:
        """There is one level."""
        return 0

    def covariance(self, a: Places, b: Places) -> FloatArray:
        """Return covariances, shape ``(n, m)``."""
        return covariance(a.points, b.points, self.kernel)

    def noise(self, places: Places) -> FloatArray:
        """Return the kernel's noise variance for every place, shape ``(n,)``."""
        return np.full(len(places), noise_variance(self.kernel))


@dataclass(frozen=True, slots=True)
class JointPrior:
    r"""A field of every level, each the one below times a factor and something of its own.

    With :math:`f_i = \rho_i f_{i-1} + g_i` and :math:`s_{ji} = \rho_{j+1} \dots \rho_i`,
    :math:`Cov(f_i(x), f_k(x')) = \sum_{j \le \min(i,k)} s_{ji} s_{jk} k_j(x, x')`.

    Source:
        Kennedy and O'Hagan, Biometrika 87 (2000); what Emukit calls a linear multi-fidelity
        model.
    """

    levels: tuple[KernelParameters, ...]
    rho: tuple[float, ...] = ()
    """Factor of each step between levels; none for 1."""

    @property
    def variance(self) -> float:
        """Prior variance of the field of the best located level."""
        signals = np.array([kernel.signal_variance for kernel in self.levels])
        return float(np.square(self._shares()[:, -1]) @ signals)

    @property
    def top_level(self) -> int:
        """The best located level."""
        return len(self.levels) - 1

    def covariance(self, a: Places, b: Places) -> FloatArray:
        """Return covariances, shape ``(n, m)``."""
        share = self._shares()
        total = covariance(a.points, b.points, self.levels[0])
        self._weight(total, share[0, a.level], share[0, b.level])
        for j, kernel in enumerate(self.levels[1:], start=1):
            rows, columns = np.flatnonzero(a.level >= j), np.flatnonzero(b.level >= j)
            if not len(rows) or not len(columns):
                continue
            part = covariance(a.points[rows], b.points[columns], kernel)
            self._weight(part, share[j, a.level[rows]], share[j, b.level[columns]])
            if len(rows) == len(a) and len(columns) == len(b):
                total += part
            elif len(columns) == len(b):
                total[rows] += part
            else:
                total[np.ix_(rows, columns)] += part
        return total

    def noise(self, places: Places) -> FloatArray:
        """Return the noise variance of each place's level, shape ``(n,)``."""
        return np.array([noise_variance(kernel) for kernel in self.levels])[places.level]

    def _shares(self) -> FloatArray:
        return shares(scale_factors(self.rho, len(self.levels)))

    def _weight(self, part: FloatArray, share_a: FloatArray, share_b: FloatArray) -> None:
        if any(factor != 1.0 for factor in self.rho):
            part *= np.multiply.outer(share_a, share_b)


@dataclass(frozen=True, slots=True)
class AgeingPrior:
    r"""Another prior whose field changes: covariances fade by :math:`e^{-|\Delta t| / \tau}`."""

    still: Prior
    memory_s: float
    """Time constant; 0 for a field that stays."""

    @property
    def variance(self) -> float:
        """Prior variance of the field that is mapped."""
        return self.still.variance

    @property
    def top_level(self) -> int:
        """Level of the field that is mapped."""
        return self.still.top_level

    def covariance(self, a: Places, b: Places) -> FloatArray:
        """Return covariances, shape ``(n, m)``."""
        result = self.still.covariance(a, b)
        if self.memory_s > 0.0:
            result *= fading(a.time_s, b.time_s, self.memory_s)
        return result

    def noise(self, places: Places) -> FloatArray:
        """Return the noise variance of measurements at places, shape ``(n,)``."""
        return self.still.noise(places)


def fading(a_s: FloatArray, b_s: FloatArray, memory_s: float) -> FloatArray:
    """Return what time leaves of covariances between moments ``(n,)`` and ``(m,)``, ``(n, m)``."""
    return np.exp(-np.abs(np.subtract.outer(a_s, b_s)) / memory_s)


def joined_places(a: Places, b: Places) -> Places:
    """Return the places of ``a``, then those of ``b``."""
    return Places(
        np.concatenate([a.points, b.points]),
        np.concatenate([a.level, b.level]),
        np.concatenate([a.time_s, b.time_s]),
    )
