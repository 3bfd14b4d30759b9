import numpy as np
import pytest
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Kernel, Matern

from autonomy.field.config import KernelParameters, KernelShape
from autonomy.field.model.kernel import (
    covariance,
    gradient_covariance,
    gradient_gradient_covariance,
    gradient_variance,
)

SHAPES: tuple[KernelShape, ...] = ("matern12", "matern32", "matern52", "squared_exponential")
EVERY_SHAPE = pytest.mark.parametrize("shape", SHAPES)
EVERY_SMOOTH_SHAPE = pytest.mark.parametrize("shape", SHAPES[1:])


def kernel(shape: KernelShape = "matern32") -> KernelParameters:
    return KernelParameters(
        shape=shape,
        signal_variance=2.0,
        length_x_m=0.5,
        length_y_m=2.0,
        length_z_m=0.1,
        noise_variance=0.01,
    )


def scikit_learn_kernel(parameters: KernelParameters) -> Kernel:
    lengths = parameters.length_scales_m()
    nu = {"matern12": 0.5, "matern32": 1.5, "matern52": 2.5}.get(parameters.shape)
    correlation = RBF(lengths) if nu is None else Matern(lengths, nu=nu)
    return ConstantKernel(parameters.signal_variance) * correlation


@EVERY_SHAPE
def test_a_point_covaries_with_itself_by_the_signal_variance(shape: KernelShape) -> None:
    points = np.random.default_rng(0).uniform(size=(5, 3))
    assert np.diagonal(covariance(points, points, kernel(shape))) == pytest.approx(2.0, rel=1e-15)


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ("matern12", np.exp(-1.0)),
        ("matern32", (1.0 + np.sqrt(3.0)) * np.exp(-np.sqrt(3.0))),
        ("matern52", (1.0 + np.sqrt(5.0) + 5.0 / 3.0) * np.exp(-np.sqrt(5.0))),
        ("squared_exponential", np.exp(-0.5)),
    ],
)
def test_one_length_scale_away_on_any_axis_covaries_as_the_formula_says(
    shape: KernelShape, expected: float
) -> None:
    steps = np.diag(kernel().length_scales_m())
    found = covariance(np.zeros((1, 3)), steps, kernel(shape))[0]
    assert found == pytest.approx(2.0 * expected, rel=1e-14)


@EVERY_SHAPE
def test_covariance_is_symmetric_and_positive_definite(shape: KernelShape) -> None:
    points = np.random.default_rng(1).uniform(-1.0, 1.0, size=(60, 3))
    found = covariance(points, points, kernel(shape))
    assert np.array_equal(found, found.T)
    assert np.linalg.eigvalsh(found)[0] > 0.0


@EVERY_SHAPE
def test_kernels_equal_those_of_scikit_learn(shape: KernelShape) -> None:
    rng = np.random.default_rng(2)
    a, b = rng.uniform(size=(20, 3)), rng.uniform(size=(30, 3))
    theirs = scikit_learn_kernel(kernel(shape))(a, b)
    assert covariance(a, b, kernel(shape)) == pytest.approx(theirs, abs=1e-13)


@EVERY_SMOOTH_SHAPE
def test_gradient_covariance_is_the_slope_of_the_kernel(shape: KernelShape) -> None:
    rng = np.random.default_rng(4)
    a, b = rng.uniform(size=(8, 3)), rng.uniform(size=(9, 3))
    h = 1e-6
    for axis, gradient in enumerate(gradient_covariance(a, b, kernel(shape))):
        step = np.zeros(3)
        step[axis] = h
        there = covariance(a + step, b, kernel(shape))
        back = covariance(a - step, b, kernel(shape))
        assert gradient == pytest.approx((there - back) / (2.0 * h), abs=1e-7)


@EVERY_SMOOTH_SHAPE
def test_covariance_of_gradients_is_the_slope_of_the_gradient_covariance(
    shape: KernelShape,
) -> None:
    rng = np.random.default_rng(5)
    a, b = rng.uniform(size=(8, 3)), rng.uniform(size=(9, 3))
    h = 1e-6
    north, east, mixed = gradient_gradient_covariance(a, b, kernel(shape))
    step_north, step_east = np.array([h, 0.0, 0.0]), np.array([0.0, h, 0.0])
    there = gradient_covariance(a, b + step_north, kernel(shape))
    back = gradient_covariance(a, b - step_north, kernel(shape))
    assert north == pytest.approx((there[0] - back[0]) / (2.0 * h), abs=1e-6)
    assert mixed == pytest.approx((there[1] - back[1]) / (2.0 * h), abs=1e-6)
    there = gradient_covariance(a, b + step_east, kernel(shape))
    back = gradient_covariance(a, b - step_east, kernel(shape))
    assert east == pytest.approx((there[1] - back[1]) / (2.0 * h), abs=1e-6)


@EVERY_SMOOTH_SHAPE
def test_a_gradient_covaries_with_itself_by_its_variance(shape: KernelShape) -> None:
    point = np.zeros((1, 3))
    north, east, mixed = gradient_gradient_covariance(point, point, kernel(shape))
    assert (north[0, 0], east[0, 0]) == pytest.approx(gradient_variance(kernel(shape)))
    assert mixed[0, 0] == 0.0


def test_a_matern12_field_has_no_gradient_and_says_so() -> None:
    point = np.zeros((1, 3))
    with pytest.raises(ValueError, match="no gradient: choose a smoother shape"):
        gradient_covariance(point, point, kernel("matern12"))
