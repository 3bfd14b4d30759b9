r"""A Gaussian process that knows how badly its samples are located: the reference of the live map.

A sample taken :math:`e_i` away from where it is believed differs from the field there by about
:math:`e_i \cdot g_i`, with :math:`g_i` the field's horizontal slope. The errors of one dive are one
random walk, hence alike for neighbours, and so are slopes. To the samples' noise this adds

.. math::
    P_{ij} \, (m_i \cdot m_j + c_i c_j r_{ij}),

where :math:`P_{ij}` is the covariance of the position errors on each axis
(``reckoning.position_error_covariance``), :math:`m_i` and :math:`c_i` are mean and deviation
of the slope given the samples, and :math:`r_{ij}` is the prior correlation of slopes. Being an
entrywise product of covariances it is one itself. The slope is known only after the noise, so both
are found in turn, from the prior slope on. What the field bends over the error is added with the
correlation :math:`r_{ij}` times the squared one of the errors.

Source:
    McHutchon and Rasmussen, Gaussian process training with input noise, 2011, for errors that are
    independent of each other. That they are not within a dive is used here: whole dives are moved
    in the mind, and what they share is not mistaken for agreement.
"""

from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.field.config import FieldConfig, KernelParameters
from autonomy.field.model.adaptation import FEWEST_DIVES, MOST_SAMPLES, adapted
from autonomy.field.model.gaussian_process import Ageing, GaussianProcess
from autonomy.field.model.kernel import (
    covariance,
    gradient_covariance,
    gradient_gradient_covariance,
    gradient_variance,
    noise_variance,
)
from autonomy.field.model.model_prior import Places, fading
from autonomy.field.model.posterior import PosteriorAtPoints
from autonomy.field.reckoning import (
    ErrorScale,
    error_scale,
    located_std_m,
    position_error_covariance,
)
from autonomy.field.samples import FieldSamples

ITERATIONS = 3
"""Times that slope and noise follow from each other; more change the scores by under 1 %."""
_NODES, _CHANCES = np.polynomial.hermite_e.hermegauss(5)
"""Gauss-Hermite quadrature on each axis of an error in units of its standard deviation."""
_UNIT_ERRORS = np.stack(np.meshgrid(_NODES, _NODES, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
_CHANCE = np.multiply.outer(_CHANCES, _CHANCES).reshape(-1) / _CHANCES.sum() ** 2


_LEAST_M2 = 1e-24
_MOST_SHARE = 2.0
"""However far a sample lies off, field here and field there differ by no more than two independent
fields: this times the signal variance."""


@dataclass(frozen=True, slots=True, eq=False)
class Slope:
    """The field's horizontal slope at ``n`` samples, in the model's scale per m."""

    mean: FloatArray
    """North and east, shape ``(n, 2)``."""
    std: FloatArray
    """Root of the variance of both axes together, shape ``(n,)``."""

    @classmethod
    def of_prior(cls, count: int, parameters: KernelParameters) -> Self:
        """Return the slope at ``count`` places of which nothing is known."""
        std = np.sqrt(sum(gradient_variance(parameters)))
        return cls(np.zeros((count, 2)), np.full(count, std))

    def __getitem__(self, chosen: slice | IntArray | BoolArray) -> "Slope":
        """Return the slope at some of the samples, by slice, indices or mask."""
        return Slope(self.mean[chosen], self.std[chosen])


class Conditioned(Protocol):
    """A Gaussian process given samples: ``Posterior``, or one that grows."""

    @property
    def places(self) -> Places:
        """Where and when the samples were taken, ``n`` of them."""
        ...

    @property
    def z(self) -> FloatArray:
        """``L^-1`` times the values, for the factor ``L`` of the samples' covariance, ``(n,)``."""
        ...

    def whitened(self, right: FloatArray, /) -> FloatArray:
        """Return ``L^-1 right`` for ``right`` of shape ``(n, k)``."""
        ...


def slope_given(
    process: Conditioned, places: Places, parameters: KernelParameters, memory_s: float = 0.0
) -> Slope:
    """Return the slope at ``m`` places, given samples.

    Args:
        process: Given the samples, with one kernel.
        places: Where and when to look.
        parameters: The kernel.
        memory_s: Time constant of the field; 0 if it stays.

    Raises:
        ValueError: If the kernel is Matern-1/2, whose field has no slope.
    """
    slope = Slope.of_prior(len(places), parameters)
    known = process.places
    if not len(known):
        return slope
    both = np.concatenate(gradient_covariance(places.points, known.points, parameters))  # (2m, n)
    if memory_s > 0.0:
        both *= np.tile(fading(places.time_s, known.time_s, memory_s), (2, 1))
    whitened = process.whitened(both.T)  # (n, 2m)
    slope.mean[:] = (process.z @ whitened).reshape(2, -1).T
    explained = np.einsum("nm,nm->m", whitened, whitened).reshape(2, -1).sum(axis=0)
    return Slope(slope.mean, np.sqrt(np.maximum(np.square(slope.std) - explained, 0.0)))


def slope_correlation(a: FloatArray, b: FloatArray, parameters: KernelParameters) -> FloatArray:
    """Return the prior correlation of horizontal slopes between points, shape ``(n, m)``.

    Args:
        a: Points, shape ``(n, 3)``, m.
        b: Points, shape ``(m, 3)``, m.
        parameters: The kernel.
    """
    north, east, _ = gradient_gradient_covariance(a, b, parameters)
    return (north + east) / sum(gradient_variance(parameters))


class _LocationErrors:
    """What the noise of samples has from where they were taken, whatever the slope.

    It is worked out once, and told as often as the slope is found anew.
    """

    def __init__(
        self, a: FieldSamples, b: FieldSamples, parameters: KernelParameters, scale: ErrorScale
    ) -> None:
        """Compare samples.

        Args:
            a: ``n`` samples.
            b: ``m`` samples.
            parameters: The kernel.
            scale: By how much position errors differ from what was stated.
        """
        self._shared = position_error_covariance(a, b, scale)  # (n, m)
        alike = slope_correlation(a.points, b.points, parameters)
        self._alike = alike * self._shared
        self._most = _MOST_SHARE * parameters.signal_variance
        self._a = _Erring.of(a, parameters, scale)
        self._b = self._a if b is a else _Erring.of(b, parameters, scale)
        self._bend = alike * np.square(self._shared)
        self._bend *= np.multiply.outer(self._a.bend_size, self._b.bend_size)

    def noise(self, slope_a: Slope, slope_b: Slope) -> FloatArray:
        """Return the covariance of what the errors add to measurements, shape ``(n, m)``.

        Args:
            slope_a: Slope at the samples ``a``.
            slope_b: Slope at the samples ``b``.
        """
        noise = slope_a.mean @ slope_b.mean.T
        noise *= self._shared
        noise += self._alike * np.multiply.outer(slope_a.std, slope_b.std)
        noise += self._bend
        noise *= np.multiply.outer(
            self._a.bounded(slope_a, self._most), self._b.bounded(slope_b, self._most)
        )
        return noise


@dataclass(frozen=True, slots=True, eq=False)
class _Erring:
    """How far samples may lie off, and what the field bends over that."""

    std_m: FloatArray
    bend: FloatArray
    """Variance of what a straight slope leaves out, shape ``(n,)``."""
    bend_size: FloatArray
    """Its root by the square of the error: bends go with that square, whose correlation is the
    square of that of the errors."""

    @classmethod
    def of(cls, samples: FieldSamples, parameters: KernelParameters, scale: ErrorScale) -> Self:
        std_m = located_std_m(samples, scale)
        bend = curvature_noise(std_m, parameters)
        return cls(std_m, bend, np.sqrt(bend) / np.maximum(np.square(std_m), _LEAST_M2))

    def bounded(self, slope: Slope, most: float) -> FloatArray:
        """Return by what to multiply what errors add, so that its variance is no more than that."""
        steepness = np.square(slope.mean).sum(axis=1) + np.square(slope.std)
        total = np.square(self.std_m) * steepness + self.bend
        return np.sqrt(most / np.maximum(total, most))


def position_noise(
    a: FieldSamples,
    b: FieldSamples,
    slope_a: Slope,
    slope_b: Slope,
    parameters: KernelParameters,
    scale: ErrorScale | None = None,
) -> FloatArray:
    """Return the covariance of what position errors add to measurements, shape ``(n, m)``.

    Args:
        a: ``n`` samples.
        b: ``m`` samples; 0 stands between samples of different dives.
        slope_a: Slope at the samples ``a``.
        slope_b: Slope at the samples ``b``.
        parameters: The kernel.
        scale: By how much position errors differ from what was stated; not at all if not given.
    """
    return _LocationErrors(a, b, parameters, scale or ErrorScale()).noise(slope_a, slope_b)


def curvature_noise(position_std_m: FloatArray, parameters: KernelParameters) -> FloatArray:
    r"""Return the variance of what a straight slope leaves out of a field, at uncertain places.

    It is the prior expectation of :math:`(f(x + e) - f(x) - e \cdot g(x))^2` over fields with slope
    :math:`g` and errors :math:`e`. With a Matern-3/2 kernel it grows with the error's third power:
    at a tenth of the length scale it is about a fifth of the prior slope's share.

    Args:
        position_std_m: Standard deviation of each position on each horizontal axis, ``(n,)``, m.
        parameters: The kernel.

    Returns:
        Shape ``(n,)``.
    """
    errors = (position_std_m[:, None, None] * _UNIT_ERRORS).reshape(-1, 3)
    here = np.zeros((1, 3))
    fallen = parameters.signal_variance - covariance(here, errors, parameters)[0]
    slopes = gradient_covariance(here, errors, parameters)
    left = 2.0 * fallen
    for axis, variance in enumerate(gradient_variance(parameters)):
        error = errors[:, axis]
        left += error * (error * variance - 2.0 * slopes[axis][0])
    return np.maximum(left.reshape(-1, len(_CHANCE)) @ _CHANCE, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class PositionNoise:
    """What the position errors of ``n`` samples do to their measurements."""

    slope: Slope
    """Slope at the samples that the noise follows from."""
    covariance: FloatArray
    """What is added to the samples' covariance, that of the measurement left out, ``(n, n)``."""

    @classmethod
    def of(
        cls,
        parameters: KernelParameters,
        samples: FieldSamples,
        values: FloatArray,
        *,
        scale: ErrorScale | None = None,
        ageing: Ageing | None = None,
        iterations: int = ITERATIONS,
    ) -> Self:
        """Find slope and noise in turn.

        Args:
            parameters: Kernel, and the noise of a measurement at an exactly known place.
            samples: Where and how well located, and in which dive.
            values: Measurements in the model's scale, less the prior mean, shape ``(n,)``.
            scale: By how much position errors differ from what was stated.
            ageing: Times, if the field changes.
            iterations: Times that the slope is found anew; 0 for the prior slope.

        Raises:
            ValueError: If the kernel is Matern-1/2, whose field has no slope.
        """
        memory_s = 0.0 if ageing is None else ageing.memory_s
        scale = scale or ErrorScale()
        errors = _LocationErrors(samples, samples, parameters, scale)
        slope = Slope.of_prior(len(samples), parameters)
        noise = errors.noise(slope, slope)
        for _ in range(iterations):
            posterior = _process(parameters, samples, values, noise, ageing).posterior
            slope = slope_given(posterior, posterior.places, parameters, memory_s)
            noise = errors.noise(slope, slope)
        return cls(slope, noise)


class PositionNoiseGaussianProcess(PosteriorAtPoints):
    """One Gaussian process whose samples' noise follows from position errors and the slope."""

    def __init__(
        self,
        parameters: KernelParameters,
        samples: FieldSamples,
        values: FloatArray,
        *,
        scale: ErrorScale | None = None,
        ageing: Ageing | None = None,
        iterations: int = ITERATIONS,
    ) -> None:
        """Condition on samples; arguments and errors as those of ``PositionNoise.of``."""
        self.noise = PositionNoise.of(
            parameters, samples, values, scale=scale, ageing=ageing, iterations=iterations
        )
        """What position errors do to the measurements."""
        process = _process(parameters, samples, values, self.noise.covariance, ageing)
        super().__init__(process.posterior, 0, 0.0 if ageing is None else ageing.now_s)


@dataclass(frozen=True, slots=True)
class Told:
    """What a survey itself tells of its kernel and of its position errors."""

    kernel: KernelParameters
    scale: ErrorScale

    @classmethod
    def by(
        cls,
        config: FieldConfig,
        samples: FieldSamples,
        values: FloatArray,
        ageing: Ageing | None = None,
    ) -> Self:
        """Learn from the jumps at fixes, and from how well dives predict each other.

        Args:
            config: Kernel and current as known beforehand, and whether to adapt the kernel.
            samples: Where and how well located, and in which dive.
            values: Measurements in the model's scale, less the prior mean, shape ``(n,)``.
            ageing: Times, if the field changes.
        """
        scale = error_scale(samples.reckoning, samples.dive, config.steady_current_m_s)
        kernel = config.single
        if not config.adapts or len(np.unique(samples.dive)) < FEWEST_DIVES:
            return cls(kernel, scale)
        used = samples[:: -(-len(samples) // MOST_SAMPLES)]
        seen = values[:: -(-len(samples) // MOST_SAMPLES)]
        then = None if ageing is None else replace(ageing, time_s=used.time_s)
        noise = PositionNoise.of(kernel, used, seen, scale=scale, ageing=then).covariance
        faded = None if then is None else fading(then.time_s, then.time_s, then.memory_s)
        return cls(adapted(kernel, used.points, seen, used.dive, noise, faded), scale)


def _process(
    parameters: KernelParameters,
    samples: FieldSamples,
    values: FloatArray,
    position_noise_covariance: FloatArray,
    ageing: Ageing | None,
) -> GaussianProcess:
    """Return the process that follows from what position errors add to the noise."""
    own = np.full(len(samples), noise_variance(parameters))
    noise = _on_diagonal(position_noise_covariance.copy(), own)
    return GaussianProcess(parameters, samples.points, values, noise=noise, ageing=ageing)


def _on_diagonal(matrix: FloatArray, added: FloatArray) -> FloatArray:
    """Return a matrix ``(n, n)`` after ``added`` of shape ``(n,)`` went onto its diagonal."""
    matrix[np.diag_indices(len(added))] += added
    return matrix
