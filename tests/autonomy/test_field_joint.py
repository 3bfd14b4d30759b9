import math

import numpy as np
import pytest

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.config import KernelParameters, KernelShape
from autonomy.field.model.gaussian_process import Ageing, GaussianProcess
from autonomy.field.model.joint import JointGaussianProcess
from autonomy.field.model.kernel import covariance
from autonomy.field.model.recursive import RecursiveGaussianProcess

GPY_JITTER = 1e-8
"""GPy adds this to every noise variance."""


def levels_of(shape: KernelShape, count: int = 3) -> list[KernelParameters]:
    return [
        KernelParameters(
            shape=shape,
            signal_variance=signal,
            length_x_m=length,
            length_y_m=1.2 * length,
            length_z_m=0.5 * length,
            noise_variance=noise,
        )
        for signal, length, noise in ((2.0, 1.4, 0.02), (0.5, 0.6, 0.01), (0.2, 0.3, 0.0025))
    ][:count]


def drawn_samples(n: int, levels: int = 3) -> tuple[FloatArray, FloatArray, IntArray]:
    rng = np.random.default_rng(0)
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(n, 3))
    values = np.sin(3.0 * points[:, 0]) + points[:, 1] * points[:, 2]
    return points, values + 0.05 * rng.standard_normal(n), rng.integers(0, levels, n)


def explicit_covariance(
    levels: list[KernelParameters],
    rho: tuple[float, ...],
    a: tuple[FloatArray, IntArray],
    b: tuple[FloatArray, IntArray],
) -> FloatArray:
    """Sum the definition, sample by sample."""
    parts = [covariance(a[0], b[0], kernel) for kernel in levels]
    total = np.zeros(parts[0].shape)
    for row, i in enumerate(a[1]):
        for column, k in enumerate(b[1]):
            total[row, column] = sum(
                math.prod(rho[j:i]) * math.prod(rho[j:k]) * parts[j][row, column]
                for j in range(min(i, k) + 1)
            )
    return total


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("factors", [(1.0, 1.0), (0.6, -1.4), (0.0, 0.7), (0.7, 0.0)])
def test_every_level_covaries_with_every_other_as_the_definition_says(
    count: int, factors: tuple[float, ...]
) -> None:
    rho = factors[: count - 1]
    levels = levels_of("matern32", count)
    points, values, assigned = drawn_samples(60, count)
    targets = drawn_samples(12)[0]
    top = np.full(12, count - 1)
    K = explicit_covariance(levels, rho, (points, assigned), (points, assigned))
    K += np.diag([levels[level].noise_variance for level in assigned])
    cross = explicit_covariance(levels, rho, (targets, top), (points, assigned))
    prior = explicit_covariance(levels, rho, (targets, top), (targets, top))
    ours = JointGaussianProcess(levels, points, values, assigned, rho=rho)
    assert ours.mean(targets) == pytest.approx(cross @ np.linalg.solve(K, values), abs=1e-9)
    expected = prior - cross @ np.linalg.solve(K, cross.T)
    assert ours.covariance(targets) == pytest.approx(expected, abs=1e-9)
    assert ours.variance(targets) == pytest.approx(np.diagonal(expected), abs=1e-9)
    quadratic = values @ np.linalg.solve(K, values) + np.linalg.slogdet(K)[1]
    likelihood = -0.5 * (quadratic + 60 * np.log(2.0 * np.pi))
    assert ours.log_marginal_likelihood() == pytest.approx(likelihood, rel=1e-10)


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")
@pytest.mark.parametrize("shape", ["matern12", "matern32", "matern52", "squared_exponential"])
@pytest.mark.parametrize("rho", [(1.0, 1.0), (0.8, 1.3)])
def test_mean_and_variance_agree_with_emukit(shape: KernelShape, rho: tuple[float, float]) -> None:
    GPy = pytest.importorskip("GPy")
    pytest.importorskip("emukit")
    from emukit.model_wrappers import GPyMultiOutputWrapper
    from emukit.multi_fidelity.kernels import LinearMultiFidelityKernel
    from emukit.multi_fidelity.models import GPyLinearMultiFidelityModel

    levels = levels_of(shape)
    points, values, assigned = drawn_samples(150)
    targets = drawn_samples(40)[0]
    theirs = {
        "matern12": GPy.kern.Exponential,
        "matern32": GPy.kern.Matern32,
        "matern52": GPy.kern.Matern52,
        "squared_exponential": GPy.kern.RBF,
    }[shape]
    kernels = [
        theirs(3, kernel.signal_variance, kernel.length_scales_m(), ARD=True) for kernel in levels
    ]
    model = GPyLinearMultiFidelityModel(
        np.column_stack([points, assigned]),
        values[:, None],
        LinearMultiFidelityKernel(kernels),
        n_fidelities=3,
    )
    model.multifidelity.scale.fix(np.array(rho))
    for level, kernel in enumerate(levels):
        noise = f"Gaussian_noise_{level}" if level else "Gaussian_noise"
        model.mixed_noise[f".*{noise}.variance"].fix(kernel.noise_variance - GPY_JITTER)
    wrapper = GPyMultiOutputWrapper(model, 3, n_optimization_restarts=1)
    at_top = np.column_stack([targets, np.full(40, 2)])
    mean, with_noise = wrapper.predict(at_top)
    ours = JointGaussianProcess(levels, points, values, assigned, rho=rho)
    our_mean, our_variance = ours.marginals(targets)
    assert our_mean == pytest.approx(mean[:, 0], abs=1e-7)
    theirs_variance = with_noise[:, 0] - (levels[2].noise_variance - GPY_JITTER)
    assert our_variance == pytest.approx(theirs_variance, abs=1e-7)


def test_factors_that_do_not_fit_the_levels_are_refused() -> None:
    levels = levels_of("matern32", 3)
    points, values, assigned = drawn_samples(10)
    for model in (JointGaussianProcess, RecursiveGaussianProcess):
        with pytest.raises(ValueError, match="rho has 1 factors, but 3 levels have 2 steps"):
            model(levels, points, values, assigned, rho=(0.5,))


def test_with_one_level_it_is_a_plain_gaussian_process() -> None:
    levels = levels_of("matern52", 1)
    points, values, _ = drawn_samples(50)
    targets = drawn_samples(9)[0]
    joint = JointGaussianProcess(levels, points, values, [0] * 50)
    alone = GaussianProcess(levels[0], points, values)
    assert joint.mean(targets) == pytest.approx(alone.mean(targets), abs=1e-12)
    assert joint.variance(targets) == pytest.approx(alone.variance(targets), abs=1e-12)


def test_well_located_samples_take_away_what_the_levels_below_left_open() -> None:
    levels = levels_of("matern32")
    points, values, _ = drawn_samples(200)
    joint = JointGaussianProcess(levels, points, values, [2] * 200)
    below = levels[0].signal_variance + levels[1].signal_variance
    assert np.all(joint.variance(points) < 0.05 * below)


def test_levels_without_a_sample_and_no_samples_at_all_leave_the_prior() -> None:
    levels = levels_of("matern32")
    nothing = JointGaussianProcess(levels, np.empty((0, 3)), np.empty(0), [])
    targets = drawn_samples(5)[0]
    assert np.all(nothing.mean(targets) == 0.0)
    assert nothing.variance(targets) == pytest.approx(2.7)
    far = JointGaussianProcess(levels, np.array([[1e4, 0.0, 0.0]]), np.ones(1), [0])
    assert far.variance(targets) == pytest.approx(2.7)


def test_an_ageing_joint_field_forgets_every_level_alike() -> None:
    levels = levels_of("matern32")
    points, values, assigned = drawn_samples(40)
    ageing = Ageing(np.zeros(40), now_s=1e9, memory_s=10.0)
    old = JointGaussianProcess(levels, points, values, assigned, ageing=ageing)
    assert old.mean(points) == pytest.approx(0.0, abs=1e-12)
    assert old.variance(points) == pytest.approx(2.7)
