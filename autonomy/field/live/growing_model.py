"""The field models as they grow sample by sample; ``condition`` is their reference."""

from typing import Protocol

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.config import FieldConfig, KernelParameters
from autonomy.field.fidelity import fidelity_level
from autonomy.field.level_scale import scale_factors
from autonomy.field.live.growing import GrowingGaussianProcess, MapTargets, SampleTargets
from autonomy.field.model.kernel import noise_variance
from autonomy.field.model.model import ageing_of
from autonomy.field.model.model_prior import AgeingPrior, JointPrior, Places, Prior, SinglePrior
from autonomy.field.model.position_noise import (
    PositionNoise,
    Slope,
    Told,
    position_noise,
    slope_given,
)
from autonomy.field.reckoning import ErrorScale
from autonomy.field.samples import FieldSamples, joined


class GrowingModel(Protocol):
    """Mean and variance of a zero-mean field at the points of a map."""

    @property
    def mean(self) -> FloatArray:
        """Posterior mean, shape ``(q,)``."""
        ...

    @property
    def variance(self) -> FloatArray:
        """Posterior variance of the field, shape ``(q,)``."""
        ...

    @property
    def noise_covariance(self) -> FloatArray | None:
        """Noise of the samples, shape ``(n, n)``, where it depends on when they came in."""
        ...

    @property
    def kernel(self) -> KernelParameters | None:
        """The kernel of the one Gaussian process that noise is given for, None for the others."""
        ...

    @property
    def memory_bytes(self) -> int:
        """What is kept to take in the next sample."""
        ...

    def append(self, samples: FieldSamples, values: FloatArray) -> None:
        """Take in samples whose ``values`` are centred and in the model's scale, ``(m,)``."""
        ...


def growing_model(config: FieldConfig, points: FloatArray) -> GrowingModel:
    """Return the model that the settings name, without samples, for a map at points ``(q, 3)``."""
    if config.model == "recursive":
        return GrowingRecursion(config, points)
    if config.model == "position_noise":
        return GrowingPositionNoise(config, points)
    return GrowingField(config, points)


class GrowingField:
    """The single and the joint model: one Gaussian process, noise by level."""

    def __init__(self, config: FieldConfig, points: FloatArray) -> None:
        """Begin with the prior at points ``(q, 3)``."""
        self._thresholds_m = config.fidelity_thresholds_m
        self._is_joint = config.model == "joint"
        still = (
            JointPrior(config.joint_levels, config.rho)
            if self._is_joint
            else SinglePrior(config.single)
        )
        self._process, self._map = _process_and_map(still, points, config.memory_s)

    @property
    def mean(self) -> FloatArray:
        """Posterior mean, shape ``(q,)``."""
        return self._map.mean

    @property
    def variance(self) -> FloatArray:
        """Posterior variance of the field, shape ``(q,)``."""
        return self._map.variance

    @property
    def noise_covariance(self) -> FloatArray | None:
        """None: the levels' own noise is all there is."""
        return None

    @property
    def kernel(self) -> KernelParameters | None:
        """None: the kernels are as they are set."""
        return None

    @property
    def memory_bytes(self) -> int:
        """What is kept to take in the next sample."""
        return self._process.memory_bytes

    def append(self, samples: FieldSamples, values: FloatArray) -> None:
        """Take in samples whose ``values`` are centred and in the model's scale, ``(m,)``."""
        level = fidelity_level(samples.position_std_m, self._thresholds_m) if self._is_joint else 0
        self._process.append(Places.of(samples.points, level=level, time_s=samples.time_s), values)


class GrowingPositionNoise:
    """The model with position-dependent noise.

    The noise of a sample follows from the slope that the map has when the sample comes in, and
    stays. What is appended to an empty map, as all the samples of a rebuilt one are, gets the
    noise that the reference finds by iteration, and tells the kernel and the scale of the position
    errors, which stay until the map is rebuilt.
    """

    def __init__(self, config: FieldConfig, points: FloatArray) -> None:
        """Begin with the prior at points ``(q, 3)``."""
        self._config = config
        self._points = points
        self._samples = FieldSamples.none()
        self._begin(Told(config.single, ErrorScale(1.0, config.steady_current_m_s)))

    def _begin(self, told: Told) -> None:
        """Begin with the prior that the samples have told."""
        self._told = told
        self._slope = Slope.of_prior(0, told.kernel)
        self._process, self._map = _process_and_map(
            SinglePrior(told.kernel), self._points, self._config.memory_s
        )

    @property
    def mean(self) -> FloatArray:
        """Posterior mean, shape ``(q,)``."""
        return self._map.mean

    @property
    def variance(self) -> FloatArray:
        """Posterior variance of the field, shape ``(q,)``."""
        return self._map.variance

    @property
    def memory_bytes(self) -> int:
        """What is kept to take in the next sample."""
        return self._process.memory_bytes

    def append(self, samples: FieldSamples, values: FloatArray) -> None:
        """Take in samples whose ``values`` are centred and in the model's scale, ``(m,)``."""
        places = Places.of(samples.points, time_s=samples.time_s)
        if len(self._samples):
            slope = slope_given(self._process, places, self._told.kernel, self._config.memory_s)
            noise = _noise(samples, slope, self._told)
        else:
            ageing = ageing_of(self._config, samples, None)
            told = Told.by(self._config, samples, values, ageing)
            self._begin(told)
            found = PositionNoise.of(told.kernel, samples, values, scale=told.scale, ageing=ageing)
            slope, noise = found.slope, found.covariance
            noise[np.diag_indices(len(samples))] += noise_variance(told.kernel)
        self._process.append(places, values, noise, self._noise_with_earlier(samples, slope))
        self._samples = joined(self._samples, samples)
        self._slope = Slope(
            np.concatenate([self._slope.mean, slope.mean]),
            np.concatenate([self._slope.std, slope.std]),
        )

    @property
    def noise_covariance(self) -> FloatArray | None:
        """Noise of all samples, that of the measurement included, shape ``(n, n)``."""
        return _noise(self._samples, self._slope, self._told)

    @property
    def kernel(self) -> KernelParameters:
        """The kernel that the samples have told."""
        return self._told.kernel

    def _noise_with_earlier(self, samples: FieldSamples, slope: Slope) -> FloatArray:
        """Return the covariance of new noise with earlier noise, which only a dive shares."""
        noise = np.zeros((len(self._samples), len(samples)))
        same = np.flatnonzero(np.isin(self._samples.dive, samples.dive))
        if len(same):
            noise[same] = position_noise(
                self._samples[same],
                samples,
                self._slope[same],
                slope,
                self._told.kernel,
                self._told.scale,
            )
        return noise


def _noise(samples: FieldSamples, slope: Slope, told: Told) -> FloatArray:
    noise = position_noise(samples, samples, slope, slope, told.kernel, told.scale)
    noise[np.diag_indices(len(samples))] += noise_variance(told.kernel)
    return noise


class GrowingRecursion:
    """The thesis's recursion: a growing process for each level.

    Samples are targets of every level below theirs, so that their residuals follow when a level
    below learns something.
    """

    def __init__(self, config: FieldConfig, points: FloatArray) -> None:
        """Begin with the prior at points ``(q, 3)``."""
        self._factors: list[float] = [0.0, *scale_factors(config.rho, len(config.levels)).tolist()]
        """By which what is below enters each level."""
        self._thresholds_m = config.fidelity_thresholds_m
        self._levels = [
            _Level(kernel, points, config.memory_s, below)
            for below, kernel in enumerate(config.levels)
        ]

    @property
    def mean(self) -> FloatArray:
        """Posterior mean, shape ``(q,)``."""
        total = self._levels[0].map.mean
        for rho, level in zip(self._factors[1:], self._levels[1:], strict=True):
            total = rho * total + level.map.mean
        return total

    @property
    def variance(self) -> FloatArray:
        """Posterior variance of the field, shape ``(q,)``."""
        total = self._levels[0].map.variance
        for rho, level in zip(self._factors[1:], self._levels[1:], strict=True):
            total = rho**2 * total + level.map.variance
        return total

    @property
    def noise_covariance(self) -> FloatArray | None:
        """None: the levels' own noise is all there is."""
        return None

    @property
    def kernel(self) -> KernelParameters | None:
        """None: the kernels are as they are set."""
        return None

    @property
    def memory_bytes(self) -> int:
        """What is kept to take in the next sample."""
        return sum(level.process.memory_bytes for level in self._levels)

    def append(self, samples: FieldSamples, values: FloatArray) -> None:
        """Take in samples whose ``values`` are centred and in the model's scale, ``(m,)``."""
        fidelity = fidelity_level(samples.position_std_m, self._thresholds_m)
        places = Places.of(samples.points, time_s=samples.time_s)
        for level in self._levels:
            level.map.go_on(float(np.max(samples.time_s)))
        moved = False
        for number, level in enumerate(self._levels):
            mine = fidelity == number
            known = len(level.values)
            below = self._levels[:number]
            if mine.any():
                level.values = np.concatenate([level.values, values[mine]])
                for lower, seen in zip(below, level.seen_by, strict=True):
                    seen.extend(lower.see(places[mine]))
            if not mine.any() and not (moved and known):
                continue
            residuals = self._residuals(level, below)
            if moved and known:
                level.process.replace_values(residuals[:known])
            level.process.append(places[mine], residuals[known:])
            moved = moved or bool(mine.any())

    def _residuals(self, level: "_Level", below: list["_Level"]) -> FloatArray:
        """Return what the levels below leave unexplained of a level's samples."""
        explained = np.zeros(len(level.values))
        for rho, lower, seen in zip(self._factors, below, level.seen_by, strict=False):
            explained = rho * explained + lower.above.mean[seen]
        return level.values - self._factors[len(below)] * explained


class _Level:
    """One level of the recursion."""

    def __init__(
        self, kernel: KernelParameters, points: FloatArray, memory_s: float, below: int
    ) -> None:
        self.process, self.map = _process_and_map(SinglePrior(kernel), points, memory_s)
        self.above = SampleTargets(self.process)
        """The samples of the levels above."""
        self.values = np.empty(0)
        self.seen_by: list[list[int]] = [[] for _ in range(below)]
        """Which targets of each level below the samples of this level are."""

    def see(self, places: Places) -> IntArray:
        """Take samples of a level above for targets, and return their numbers."""
        first = len(self.above.mean)
        self.above.add(places)
        return np.arange(first, first + len(places))


def _process_and_map(
    still: Prior, points: FloatArray, memory_s: float
) -> tuple[GrowingGaussianProcess, MapTargets]:
    """Return a process without samples, and the map that it keeps at points ``(q, 3)``."""
    process = GrowingGaussianProcess(AgeingPrior(still, memory_s) if memory_s > 0.0 else still)
    targets = MapTargets(still, points, memory_s)
    process.follow(targets)
    return process, targets
