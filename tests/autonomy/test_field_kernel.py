import numpy as np
import pytest
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from autonomy.field.config import KernelParameters
from autonomy.field.kernel import matern32

PARAMETERS = KernelParameters(
    signal_variance=2.0, length_x_m=0.5, length_y_m=2.0, length_z_m=0.1, noise_variance=0.01
)


def test_a_point_covaries_with_itself_by_the_signal_variance() -> None:
    points = np.random.default_rng(0).uniform(size=(5, 3))
    assert np.diagonal(matern32(points, points, PARAMETERS)) == pytest.approx(2.0, rel=1e-15)


def test_one_length_scale_away_on_any_axis_covaries_as_the_formula_says() -> None:
    origin = np.zeros((1, 3))
    steps = np.diag(PARAMETERS.length_scales_m())
    expected = 2.0 * (1.0 + np.sqrt(3.0)) * np.exp(-np.sqrt(3.0))
    assert matern32(origin, steps, PARAMETERS)[0] == pytest.approx(expected, rel=1e-14)


def test_covariance_is_symmetric_and_positive_definite() -> None:
    points = np.random.default_rng(1).uniform(-1.0, 1.0, size=(60, 3))
    covariance = matern32(points, points, PARAMETERS)
    assert np.array_equal(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance)[0] > 0.0


def test_kernel_equals_the_matern_kernel_of_scikit_learn() -> None:
    rng = np.random.default_rng(2)
    a, b = rng.uniform(size=(20, 3)), rng.uniform(size=(30, 3))
    theirs = ConstantKernel(2.0) * Matern(PARAMETERS.length_scales_m(), nu=1.5)
    assert matern32(a, b, PARAMETERS) == pytest.approx(theirs(a, b), abs=1e-13)
