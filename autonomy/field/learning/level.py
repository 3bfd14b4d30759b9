"""Hyperparameters from data, by the marginal likelihood."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.field.config import LARGEST_FACTOR, KernelParameters
from autonomy.field.learning.likelihood import PER_LEVEL, MarginalLikelihood
from autonomy.field.learning.prior import LogNormalPrior
from autonomy.field.learning.search import Found, IsCancelled, Limits, Report, search
from autonomy.field.level_scale import scale_factors

_LOG_RANGE = math.log(1e3)
"""How far from its start, as a factor, a hyperparameter may go."""
_LOG_LARGEST = math.log(1e6)
"""Largest hyperparameter that a configuration takes."""
_LOG_SMALLEST = math.log(1e-12)


@dataclass(frozen=True, slots=True)
class Learned:
    """Outcome of learning the kernel of a plain Gaussian process."""

    parameters: KernelParameters
    log_likelihood: float
    """Log marginal likelihood of the values with these parameters."""
    trend: tuple[float, ...]
    """Coefficients of the mean's basis, by generalized least squares."""
    converged: bool
    message: str
    """How the search ended, for a person."""


@dataclass(frozen=True, slots=True)
class LearnedLevels:
    """Outcome of learning the kernels of the joint auto-regressive model."""

    levels: tuple[KernelParameters, ...]
    """Kernel of each component, worst located level first."""
    rho: tuple[float, ...]
    """Scale factor of each step between levels."""
    log_likelihood: float
    trend: tuple[float, ...]
    converged: bool
    message: str


def learn(
    points: FloatArray,
    values: FloatArray,
    starts: Sequence[KernelParameters],
    *,
    noise_floor: float,
    max_iterations: int = 100,
    prior_strength: float = 0.0,
    basis: FloatArray | None = None,
    held_noise: FloatArray | None = None,
    age: FloatArray | None = None,
    report: Report | None = None,
    is_cancelled: IsCancelled | None = None,
) -> Learned:
    """Fit the kernel and noise of a Gaussian process, from several starts.

    Args:
        points: Where the values were measured, shape ``(n, 3)``, m.
        values: Measurements, less their mean unless ``basis`` describes it, shape ``(n,)``.
        starts: Where to begin; the first one's shape of kernel is learned, and it is the centre
            of the priors. No parameter goes farther than a factor of 1,000 from the starts.
        noise_floor: Smallest noise variance. Smooth data drive the noise to nothing, and the map
            then claims to know what it interpolates.
        max_iterations: Limit of the search.
        prior_strength: One over the standard deviation, in decades, of log-normal priors about
            the first start; 0 for none.
        basis: Functions of position whose weighted sum is the mean, shape ``(n, p)``.
        held_noise: Noise covariance besides the learned variance, shape ``(n, n)``.
        age: Time of each sample over the memory of the field, shape ``(n,)``.
        report: Told the share of the work that is done, and a sentence.
        is_cancelled: Asked at every evaluation; the best so far is then the outcome.

    Raises:
        ValueError: If there are fewer than two values, no start, or a number that is not finite.

    Source:
        Coleman, thesis, equation (5.3), with the noise and the constant that it leaves out.
    """
    _check(points, values, starts)
    likelihood = MarginalLikelihood(
        points,
        values,
        shapes=(starts[0].shape,),
        age=age,
        held_noise=held_noise,
        basis=basis,
    )
    first = [log_parameters(start) for start in starts]
    found = search(
        likelihood,
        first,
        _limits(
            first, np.array([noise_floor]), np.zeros(PER_LEVEL, dtype=np.bool_), max_iterations
        ),
        LogNormalPrior(first[0], prior_strength),
        report=report,
        is_cancelled=is_cancelled,
    )
    (kernel,) = _kernels(found.log_parameters, (starts[0].shape,))
    return Learned(kernel, -found.likelihood.value, _trend(found), found.converged, found.message)


def learn_levels(
    points: FloatArray,
    values: FloatArray,
    sample_levels: IntArray,
    starts: Sequence[tuple[KernelParameters, ...]],
    *,
    noise_floor: float,
    rho: Sequence[float] = (),
    learns_rho: bool = False,
    held: Sequence[int] = (),
    max_iterations: int = 150,
    prior_strength: float = 0.0,
    basis: FloatArray | None = None,
    age: FloatArray | None = None,
    report: Report | None = None,
    is_cancelled: IsCancelled | None = None,
) -> LearnedLevels:
    """Fit all kernels and noises of the joint auto-regressive model by one likelihood.

    Args:
        points: Where the values were measured, shape ``(n, 3)``, m.
        values: Measurements, less their mean unless ``basis`` describes it, shape ``(n,)``.
        sample_levels: Fidelity level of each sample, shape ``(n,)``.
        starts: Kernels of all levels to begin with; the first are the centre of the priors.
        noise_floor: Smallest noise variance of every level.
        rho: Scale factor of each step between levels, to begin with or to stay; none for 1.
        learns_rho: Whether to learn them too; their priors are normal, as wide about ``rho`` as
            those of the logarithms.
        held: Levels whose kernels stay as they are, such as one without samples, and with them the
            scale factors of the steps to them and from them.
        max_iterations: Limit of the search.
        prior_strength: As in ``learn``.
        basis: As in ``learn``.
        age: As in ``learn``.
        report: As in ``learn``.
        is_cancelled: As in ``learn``.

    Raises:
        ValueError: As ``learn``.
    """
    _check(points, values, starts)
    shapes = tuple(level.shape for level in starts[0])
    likelihood = MarginalLikelihood(
        points,
        values,
        shapes=shapes,
        sample_levels=sample_levels,
        rho=rho,
        learns_rho=learns_rho,
        age=age,
        basis=basis,
    )
    factors = scale_factors(rho, len(shapes))
    tail = factors if learns_rho else factors[:0]
    first = [np.concatenate([*map(log_parameters, levels), tail]) for levels in starts]
    is_held = _held(held, len(shapes), likelihood.size)
    found = search(
        likelihood,
        first,
        _limits(first, np.full(len(shapes), noise_floor), is_held, max_iterations),
        LogNormalPrior(first[0], prior_strength),
        report=report,
        is_cancelled=is_cancelled,
    )
    kernels = _kernels(found.log_parameters, shapes)
    return LearnedLevels(
        tuple(starts[0][t] if t in held else kernel for t, kernel in enumerate(kernels)),
        tuple((found.log_parameters[-len(tail) :] if len(tail) else factors).tolist()),
        -found.likelihood.value,
        _trend(found),
        found.converged,
        found.message,
    )


def log_parameters(kernel: KernelParameters) -> FloatArray:
    """Return the logarithms of signal variance, length scales and noise variance, ``(5,)``."""
    return np.log([kernel.signal_variance, *kernel.length_scales_m(), kernel.noise_variance])


def _check(points: FloatArray, values: FloatArray, starts: Sequence[object]) -> None:
    if len(values) < 2 or not starts:
        raise ValueError("learning needs at least two values and one start")
    if not (np.isfinite(points).all() and np.isfinite(values).all()):
        raise ValueError("positions and values to learn from must be finite")


def _held(levels: Sequence[int], count: int, size: int) -> BoolArray:
    """Mark the hyperparameters of some of ``count`` levels, and of the steps that touch them.

    Returns:
        Shape ``(size,)``: kernels level after level, then the scale factors if they are learned.
    """
    held = np.zeros(size, dtype=np.bool_)
    kernels, steps = held[: count * PER_LEVEL].reshape(count, PER_LEVEL), held[count * PER_LEVEL :]
    for level in levels:
        kernels[level] = True
        steps[max(level - 1, 0) : level + 1] = True
    return held


def _limits(
    starts: Sequence[FloatArray], noise_floors: FloatArray, held: BoolArray, max_iterations: int
) -> Limits:
    lower = np.maximum(np.min(starts, axis=0) - _LOG_RANGE, _LOG_SMALLEST)
    upper = np.minimum(np.max(starts, axis=0) + _LOG_RANGE, _LOG_LARGEST)
    kernels = len(noise_floors) * PER_LEVEL
    lower[kernels:], upper[kernels:] = -LARGEST_FACTOR, LARGEST_FACTOR
    noises = np.arange(len(noise_floors)) * PER_LEVEL + PER_LEVEL - 1
    lower[noises] = np.log(noise_floors)
    lower[held] = np.minimum(lower[held], starts[0][held])
    upper = np.maximum(upper, lower)
    return Limits(lower, upper, held, max_iterations)


def _kernels(found: FloatArray, shapes: tuple[str, ...]) -> tuple[KernelParameters, ...]:
    table = np.exp(found[: PER_LEVEL * len(shapes)]).reshape(-1, PER_LEVEL).tolist()
    return tuple(
        KernelParameters.model_validate(
            {
                "shape": shape,
                "signal_variance": min(signal, 1e6),
                "length_x_m": min(x, 1e6),
                "length_y_m": min(y, 1e6),
                "length_z_m": min(z, 1e6),
                "noise_variance": min(noise, 1e6),
            }
        )
        for shape, (signal, x, y, z, noise) in zip(shapes, table, strict=True)
    )


def _trend(found: Found) -> tuple[float, ...]:
    return tuple(found.likelihood.trend.tolist())
