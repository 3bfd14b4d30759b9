import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import WhiteKernel

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters, KernelShape
from autonomy.field.model.factorization import cholesky
from autonomy.field.model.gaussian_process import Ageing, GaussianProcess
from autonomy.field.model.kernel import covariance
from autonomy.field.model.recursive import RecursiveGaussianProcess
from autonomy.field.synthetic import measure
from tests.autonomy.test_field_kernel import SHAPES, scikit_learn_kernel

PARAMETERS = KernelParameters()


def tank_samples(n: int, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(n, 3))
    return points, np.log(measure("blue_light", points, rng))


@pytest.mark.parametrize("shape", SHAPES)
def test_mean_and_variance_agree_with_scikit_learn(shape: KernelShape) -> None:
    parameters = PARAMETERS.model_copy(update={"shape": shape})
    points, values = tank_samples(400)
    targets, _ = tank_samples(1300, seed=1)
    theirs = GaussianProcessRegressor(
        scikit_learn_kernel(parameters), alpha=PARAMETERS.noise_variance, optimizer=None
    )
    mean, std = theirs.fit(points, values).predict(targets, return_std=True)
    ours = GaussianProcess(parameters, points, values)
    assert ours.mean(targets) == pytest.approx(mean, abs=1e-7)
    assert ours.variance(targets) == pytest.approx(std**2, abs=1e-7)
    our_mean, our_variance = ours.marginals(targets)
    assert our_mean == pytest.approx(mean, abs=1e-7)
    assert our_variance == pytest.approx(std**2, abs=1e-7)


def test_given_noise_takes_the_place_of_the_kernels() -> None:
    points, values = tank_samples(60)
    targets, _ = tank_samples(10, seed=2)
    rng = np.random.default_rng(3)
    root = 0.2 * rng.standard_normal((60, 60))
    noise = root @ root.T + 0.01 * np.eye(60)
    ours = GaussianProcess(PARAMETERS, points, values, noise=noise)
    cross = covariance(targets, points, PARAMETERS)
    K_inverse = np.linalg.inv(covariance(points, points, PARAMETERS) + noise)
    assert ours.mean(targets) == pytest.approx(cross @ K_inverse @ values, abs=1e-9)
    expected = PARAMETERS.signal_variance - np.einsum("qn,nm,qm->q", cross, K_inverse, cross)
    assert ours.variance(targets) == pytest.approx(expected, abs=1e-9)
    by_variance = GaussianProcess(PARAMETERS, points, values, noise=np.diagonal(noise).copy())
    by_matrix = GaussianProcess(PARAMETERS, points, values, noise=np.diag(np.diagonal(noise)))
    assert np.array_equal(by_variance.mean(targets), by_matrix.mean(targets))


def test_an_ageing_field_is_a_field_with_time_for_a_fourth_axis() -> None:
    points, values = tank_samples(50)
    targets, _ = tank_samples(10, seed=2)
    time_s = np.linspace(0.0, 900.0, 50)
    ours = GaussianProcess(
        PARAMETERS, points, values, ageing=Ageing(time_s, now_s=1000.0, memory_s=400.0)
    )
    K = covariance(points, points, PARAMETERS)
    K *= np.exp(-np.abs(time_s[:, None] - time_s) / 400.0)
    cross = covariance(targets, points, PARAMETERS) * np.exp((time_s - 1000.0) / 400.0)
    expected = cross @ np.linalg.solve(K + PARAMETERS.noise_variance * np.eye(50), values)
    assert ours.mean(targets) == pytest.approx(expected, abs=1e-9)
    still = GaussianProcess(
        PARAMETERS, points, values, ageing=Ageing(time_s, now_s=1000.0, memory_s=0.0)
    )
    assert np.array_equal(
        still.mean(targets), GaussianProcess(PARAMETERS, points, values).mean(targets)
    )


def test_likelihood_agrees_with_scikit_learn() -> None:
    points, values = tank_samples(150)
    kernel = scikit_learn_kernel(PARAMETERS) + WhiteKernel(PARAMETERS.noise_variance)
    theirs = GaussianProcessRegressor(kernel, alpha=0.0, optimizer=None).fit(points, values)
    ours = GaussianProcess(PARAMETERS, points, values).log_marginal_likelihood()
    assert ours == pytest.approx(theirs.log_marginal_likelihood_value_, rel=1e-9)


def test_one_sample_pulls_the_mean_by_signal_over_signal_plus_noise() -> None:
    point = np.array([[1.0, 0.5, 0.2]])
    process = GaussianProcess(PARAMETERS, point, np.array([3.0]))
    share = PARAMETERS.signal_variance / (PARAMETERS.signal_variance + PARAMETERS.noise_variance)
    assert process.mean(point)[0] == pytest.approx(3.0 * share, rel=1e-12)
    expected = PARAMETERS.signal_variance * (1.0 - share)
    assert process.variance(point)[0] == pytest.approx(expected, rel=1e-9)


def test_without_samples_it_is_the_prior() -> None:
    targets, _ = tank_samples(4)
    prior = GaussianProcess(PARAMETERS, np.empty((0, 3)), np.empty(0))
    assert np.all(prior.mean(targets) == 0.0)
    assert np.all(prior.variance(targets) == PARAMETERS.signal_variance)
    assert np.array_equal(prior.covariance(targets), covariance(targets, targets, PARAMETERS))
    assert prior.log_marginal_likelihood() == 0.0


def test_variance_is_the_diagonal_of_the_covariance() -> None:
    points, values = tank_samples(50)
    targets, _ = tank_samples(20, seed=3)
    process = GaussianProcess(PARAMETERS, points, values)
    diagonal = np.diagonal(process.covariance(targets))
    assert process.variance(targets) == pytest.approx(diagonal, abs=1e-12)


def test_recursion_is_the_thesis_equations_with_explicit_inverses() -> None:
    points, values = tank_samples(90)
    targets, _ = tank_samples(15, seed=4)
    levels = [
        PARAMETERS.model_copy(update={"signal_variance": s, "noise_variance": n})
        for s, n in ((5.0, 0.02), (0.4, 0.01), (0.1, 0.0025))
    ]
    assigned = np.arange(90) % 3
    factors = (0.7, -1.2)
    mean, spread = np.zeros(15), np.zeros((15, 15))
    at_samples = np.zeros(90)
    for level, kernel in enumerate(levels):
        rho = factors[level - 1] if level else 0.0
        X = points[assigned == level]
        K_inverse = np.linalg.inv(covariance(X, X, kernel) + kernel.noise_variance * np.eye(len(X)))
        weights = K_inverse @ (values - rho * at_samples)[assigned == level]
        cross = covariance(targets, X, kernel)
        mean = rho * mean + cross @ weights
        spread = rho**2 * spread + covariance(targets, targets, kernel)
        spread -= cross @ K_inverse @ cross.T
        at_samples = rho * at_samples + covariance(points, X, kernel) @ weights
    ours = RecursiveGaussianProcess(levels, points, values, assigned, rho=factors)
    assert ours.mean(targets) == pytest.approx(mean, abs=1e-8)
    assert ours.covariance(targets) == pytest.approx(spread, abs=1e-8)
    assert ours.variance(targets) == pytest.approx(np.diagonal(spread), abs=1e-8)


def test_an_empty_level_adds_its_prior_variance_and_nothing_to_the_mean() -> None:
    points, values = tank_samples(30)
    targets, _ = tank_samples(10, seed=5)
    worst = PARAMETERS.model_copy(update={"signal_variance": 0.7})
    alone = GaussianProcess(PARAMETERS, points, values)
    both = RecursiveGaussianProcess([worst, PARAMETERS], points, values, [1] * 30)
    assert both.mean(targets) == pytest.approx(alone.mean(targets), abs=1e-12)
    assert both.variance(targets) == pytest.approx(alone.variance(targets) + 0.7, abs=1e-12)


def test_a_singular_covariance_is_factorized_with_a_small_jitter() -> None:
    ones = np.ones((50, 50))
    factor = cholesky(ones, 1.0)
    assert factor @ factor.T == pytest.approx(ones, abs=1e-6)


def test_a_matrix_that_is_no_covariance_is_refused_with_a_sentence() -> None:
    with pytest.raises(ValueError, match="not a covariance matrix"):
        cholesky(-np.eye(3), 1.0)
