"""Peers of the field models, brought to the same problem: scikit-learn, GPy and Emukit."""

import warnings

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.config import KernelParameters

GPY_JITTER = 1e-8
"""GPy adds this to the noise variance of its own accord; it is given that much less."""


def scikit_learn_fit(kernel: KernelParameters, points: FloatArray, values: FloatArray):
    """Condition scikit-learn's process with fixed hyperparameters."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern

    prior = ConstantKernel(kernel.signal_variance) * Matern(kernel.length_scales_m(), nu=1.5)
    model = GaussianProcessRegressor(prior, alpha=kernel.noise_variance, optimizer=None)
    return model.fit(points, values)


def gpy_fit(kernel: KernelParameters, points: FloatArray, values: FloatArray):
    """Condition GPy's process with fixed hyperparameters."""
    import GPy

    return GPy.models.GPRegression(
        points, values[:, None], gpy_kernel(kernel), noise_var=kernel.noise_variance - GPY_JITTER
    )


def gpy_kernel(kernel: KernelParameters):
    """Return GPy's Matern-3/2 kernel."""
    import GPy

    return GPy.kern.Matern32(
        3,
        variance=kernel.signal_variance,
        lengthscale=list(kernel.length_scales_m()),
        ARD=True,
    )


class EmukitJoint:
    """Emukit's linear multi-fidelity model with a scale factor of 1 between levels."""

    def __init__(
        self,
        levels: tuple[KernelParameters, ...],
        points: FloatArray,
        values: FloatArray,
        sample_levels: IntArray,
    ) -> None:
        """Condition on samples."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from emukit.multi_fidelity.kernels import LinearMultiFidelityKernel
            from emukit.multi_fidelity.models import GPyLinearMultiFidelityModel

        order = np.argsort(sample_levels, kind="stable")
        inputs = np.column_stack([points, sample_levels.astype(np.float64)])[order]
        self._top = len(levels) - 1
        self.model = GPyLinearMultiFidelityModel(
            inputs,
            values[order][:, None],
            LinearMultiFidelityKernel([gpy_kernel(level) for level in levels]),
            n_fidelities=len(levels),
        )
        self.model.multifidelity.scale.fix(1.0)
        for number, level in enumerate(levels):
            name = "Gaussian_noise" if number == 0 else f"Gaussian_noise_{number}"
            getattr(self.model.mixed_noise, name).variance = level.noise_variance - GPY_JITTER

    def marginals(self, targets: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of the best level at targets, each ``(q,)``."""
        inputs = np.column_stack([targets, np.full(len(targets), float(self._top))])
        mean, variance = self.model.predict_noiseless(inputs)
        return mean[:, 0], variance[:, 0]
