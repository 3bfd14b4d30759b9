"""The field models behind one interface."""

from typing import Protocol

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import FieldConfig
from autonomy.field.fidelity import fidelity_level
from autonomy.field.model.gaussian_process import Ageing, GaussianProcess
from autonomy.field.model.joint import JointGaussianProcess
from autonomy.field.model.position_noise import PositionNoiseGaussianProcess, Told
from autonomy.field.model.recursive import RecursiveGaussianProcess
from autonomy.field.samples import FieldSamples


class FieldModel(Protocol):
    """A field given samples, in the model's scale."""

    def mean(self, targets: FloatArray) -> FloatArray:
        """Return the expected field at targets ``(q, 3)``, shape ``(q,)``."""
        ...

    def variance(self, targets: FloatArray) -> FloatArray:
        """Return the variance of the field, without noise, at targets, shape ``(q,)``."""
        ...

    def marginals(self, targets: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance at targets, each ``(q,)``: half the time of both apart."""
        ...

    def covariance(self, targets: FloatArray) -> FloatArray:
        """Return the covariance of the field between targets, shape ``(q, q)``."""
        ...

    def log_marginal_likelihood(self) -> float:
        """Return the log density of the samples under the model."""
        ...


class FieldAboutMean:
    """A zero-mean model about the linear prior mean of the settings."""

    def __init__(self, config: FieldConfig, about_zero: FieldModel) -> None:
        """Add the prior mean of ``config`` to ``about_zero``."""
        self._config = config
        self.about_zero = about_zero

    def mean(self, targets: FloatArray) -> FloatArray:
        """Return the expected field at targets, shape ``(q,)``."""
        return self._config.prior_mean_at(targets) + self.about_zero.mean(targets)

    def variance(self, targets: FloatArray) -> FloatArray:
        """Return the variance of the field at targets, shape ``(q,)``."""
        return self.about_zero.variance(targets)

    def marginals(self, targets: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance at targets, each of shape ``(q,)``."""
        mean, variance = self.about_zero.marginals(targets)
        return self._config.prior_mean_at(targets) + mean, variance

    def covariance(self, targets: FloatArray) -> FloatArray:
        """Return the covariance of the field between targets, shape ``(q, q)``."""
        return self.about_zero.covariance(targets)

    def log_marginal_likelihood(self) -> float:
        """Return the log density of the samples under the model."""
        return self.about_zero.log_marginal_likelihood()


def condition(
    config: FieldConfig,
    samples: FieldSamples,
    *,
    now_s: float | None = None,
    noise: FloatArray | None = None,
) -> FieldModel:
    """Condition the model that the settings name on samples, in ``O(n^3)``.

    Args:
        config: Model, kernels, prior mean, scale.
        samples: All the samples; without any, the prior.
        now_s: Time of the map of a field that changes; that of the newest sample if not given.
        noise: Noise covariance of the samples, shape ``(n, n)``, where it is known already; only
            the model with position-dependent noise looks at it.

    Raises:
        ValueError: If the samples' covariance has no factor, or the kernel cannot serve the model.
    """
    values = centred_values(config, samples)
    ageing = ageing_of(config, samples, now_s)
    if config.model == "single":
        model = GaussianProcess(config.single, samples.points, values, ageing=ageing)
    elif config.model == "position_noise" and noise is not None:
        model = GaussianProcess(config.single, samples.points, values, noise=noise, ageing=ageing)
    elif config.model == "position_noise":
        told = Told.by(config, samples, values, ageing)
        model = PositionNoiseGaussianProcess(
            told.kernel, samples, values, scale=told.scale, ageing=ageing
        )
    else:
        is_joint = config.model == "joint"
        model = (JointGaussianProcess if is_joint else RecursiveGaussianProcess)(
            config.joint_levels if is_joint else config.levels,
            samples.points,
            values,
            fidelity_level(samples.position_std_m, config.fidelity_thresholds_m),
            rho=config.rho,
            ageing=ageing,
        )
    return FieldAboutMean(config, model)


def centred_values(config: FieldConfig, samples: FieldSamples) -> FloatArray:
    """Return values in the model's scale, less the prior mean, shape ``(n,)``."""
    seen = config.in_model_scale(samples.values)
    return seen - config.prior_mean_at(samples.points)


def ageing_of(config: FieldConfig, samples: FieldSamples, now_s: float | None) -> Ageing | None:
    """Return the times of a field that changes, None for one that stays."""
    if config.memory_s == 0.0:
        return None
    newest_s = float(np.max(samples.time_s)) if len(samples) else 0.0
    return Ageing(samples.time_s, newest_s if now_s is None else now_s, config.memory_s)
