"""A Gaussian process that takes in samples one by one and keeps its targets up to date."""

from typing import Protocol

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.live.growing_factor import GrowingFactor, Growth, WhitenedColumns
from autonomy.field.model.factorization import cholesky, solve_lower
from autonomy.field.model.model_prior import Places, Prior, joined_places

_LARGEST_EXPONENT = 30.0


class Targets(Protocol):
    """Something that follows every sample that a growing process takes in."""

    @property
    def memory_bytes(self) -> int:
        """What is kept of them."""
        ...

    def append(self, growth: Growth, places: Places) -> None:
        """Take in what the factor gained by samples at ``places``."""
        ...

    def replace_values(self, z: FloatArray) -> None:
        """Change the whitened values of all samples, shape ``(n,)``."""
        ...


class GrowingGaussianProcess:
    """A posterior that is updated in place, in ``O(n^2 + n q)`` a sample.

    Kept between samples: the factor ``L`` of their covariance, ``z = L^-1 y``, and for every set
    of targets ``V = L^-1 K(X, targets)``. Appending a sample appends one row to each; nothing is
    solved again, so the result equals conditioning anew. ``Posterior`` is the readable reference.
    """

    def __init__(self, prior: Prior) -> None:
        """Begin without samples and targets."""
        self.prior = prior
        self.places = Places.of(np.empty((0, 3)))
        self.z = np.empty(0)
        self._factor = GrowingFactor()
        self._targets: list[Targets] = []

    @property
    def memory_bytes(self) -> int:
        """What the factor and its targets take."""
        targets = sum(one.memory_bytes for one in self._targets)
        return self._factor.memory_bytes + targets

    def follow(self, targets: Targets) -> None:
        """Keep targets up to date that have been added to already where there are samples."""
        self._targets.append(targets)

    def whitened(self, cross: FloatArray) -> FloatArray:
        """Return ``L^-1`` times covariances with the samples, shape ``(n, k)``."""
        return self._factor.solve(cross)

    def append(
        self,
        places: Places,
        values: FloatArray,
        noise: FloatArray | None = None,
        cross_noise: FloatArray | None = None,
    ) -> None:
        """Take in samples.

        Args:
            places: Where they were taken, ``m`` of them.
            values: Measurements less the prior mean, shape ``(m,)``.
            noise: Covariance of their noise, shape ``(m, m)``; the prior's if not given.
            cross_noise: Covariance of their noise with that of earlier samples, shape
                ``(n, m)``; 0 if not given.

        Raises:
            ValueError: If what is given is not a covariance.
        """
        if noise is None:
            noise = np.diag(self.prior.noise(places))
        before = len(self._factor)
        if cross_noise is None:
            cross_noise = np.zeros((before, len(places)))
        done = 0
        while done < len(places):
            piece = slice(done, done + self._factor.room)
            earlier = np.concatenate([cross_noise[:, piece], noise[:done, piece]])
            self._append(places[piece], values[piece], noise[piece, piece], earlier)
            done = len(self._factor) - before

    def replace_values(self, values: FloatArray) -> None:
        """Change the values of all samples, shape ``(n,)``; variances do not depend on them."""
        self.z = self._factor.solve(values[:, None])[:, 0]
        for targets in self._targets:
            targets.replace_values(self.z)

    def _append(
        self, places: Places, values: FloatArray, noise: FloatArray, cross_noise: FloatArray
    ) -> None:
        prior = self.prior
        cross = prior.covariance(self.places, places)
        cross += cross_noise
        B = self._factor.solve(cross)  # (n, m)
        schur = prior.covariance(places, places) + noise - B.T @ B
        L = cholesky(schur, prior.variance)
        z = solve_lower(L, values - B.T @ self.z)
        growth = Growth(B, L, z)
        for targets in self._targets:
            targets.append(growth, places)
        self._factor.append(B, L)
        self.places = joined_places(self.places, places)
        self.z = np.concatenate([self.z, z])


class MapTargets:
    r"""The points of a map: best level, at the time of the newest sample.

    In a field that changes, all that is known fades by :math:`e^{-\Delta t / \tau}` when time goes
    on. No target is then touched: ``V`` is kept as it would be at a time of reference, and the
    fading is applied to what is read.
    """

    def __init__(self, still: Prior, points: FloatArray, memory_s: float = 0.0) -> None:
        """Begin with the prior.

        Args:
            still: Covariances of the field at one time.
            points: Where the map is kept, shape ``(q, 3)``, m.
            memory_s: Time constant of the field; 0 if it stays.
        """
        self._still = still
        self._places = Places.of(points, level=still.top_level)
        self._memory_s = memory_s
        self._columns = WhitenedColumns(len(points))
        self._reference_s: float | None = None
        self._now_s = 0.0

    @property
    def mean(self) -> FloatArray:
        """Posterior mean, shape ``(q,)``."""
        return self._fading() * self._columns.mean

    @property
    def variance(self) -> FloatArray:
        """Posterior variance of the field, shape ``(q,)``."""
        variance = self._still.variance - self._fading() ** 2 * self._columns.reduction
        return np.maximum(variance, 0.0)

    @property
    def memory_bytes(self) -> int:
        """What is kept of the points."""
        return self._columns.memory_bytes

    def append(self, growth: Growth, places: Places) -> None:
        """Take in what the factor gained by samples at ``places``."""
        cross = self._still.covariance(places, self._places)
        self.go_on(float(np.max(places.time_s)))
        if self._memory_s > 0.0:
            ages_s = places.time_s - (self._reference_s or 0.0)
            cross *= np.exp(ages_s / self._memory_s)[:, None]
        self._columns.append(growth, cross)

    def replace_values(self, z: FloatArray) -> None:
        """Change the whitened values of all samples, shape ``(n,)``."""
        self._columns.replace_values(z)

    def go_on(self, newest_s: float) -> None:
        """Let time go on to that of a sample, wherever it was taken in; never back."""
        if self._memory_s == 0.0:
            return
        if self._reference_s is None:
            self._reference_s = self._now_s = newest_s
        self._now_s = max(self._now_s, newest_s)
        if self._now_s - self._reference_s > _LARGEST_EXPONENT * self._memory_s:
            self._columns.scale(self._fading())
            self._reference_s = self._now_s

    def _fading(self) -> float:
        if self._memory_s == 0.0 or self._reference_s is None:
            return 1.0
        return float(np.exp((self._reference_s - self._now_s) / self._memory_s))


class SampleTargets:
    """Places that stay as they are, and to which more may be added."""

    def __init__(self, process: GrowingGaussianProcess) -> None:
        """Begin without places."""
        self._process = process
        self._places = Places.of(np.empty((0, 3)))
        self._columns = WhitenedColumns()
        process.follow(self)

    @property
    def mean(self) -> FloatArray:
        """Posterior mean at every place, shape ``(q,)``; changes in place."""
        return self._columns.mean

    @property
    def memory_bytes(self) -> int:
        """What is kept of the places."""
        return self._columns.memory_bytes

    def add(self, places: Places) -> None:
        """Keep the posterior up to date at more places."""
        process = self._process
        cross = process.prior.covariance(process.places, places)
        self._columns.add(process.whitened(cross), process.z)
        self._places = joined_places(self._places, places)

    def append(self, growth: Growth, places: Places) -> None:
        """Take in what the factor gained by samples at ``places``."""
        cross = self._process.prior.covariance(places, self._places)
        self._columns.append(growth, cross)

    def replace_values(self, z: FloatArray) -> None:
        """Change the whitened values of all samples, shape ``(n,)``."""
        self._columns.replace_values(z)
