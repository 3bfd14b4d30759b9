import numpy as np
import pytest
from scipy.optimize import check_grad

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.config import KernelParameters, KernelShape
from autonomy.field.learning.level import learn, learn_levels, log_parameters
from autonomy.field.learning.likelihood import MarginalLikelihood
from autonomy.field.learning.prior import LogNormalPrior
from autonomy.field.model.gaussian_process import GaussianProcess
from autonomy.field.model.joint import JointGaussianProcess
from autonomy.field.model.kernel import covariance
from autonomy.field.model.model_prior import JointPrior, Places

SHAPES: tuple[KernelShape, ...] = ("matern12", "matern32", "matern52", "squared_exponential")
TRUE_KERNEL = KernelParameters(
    signal_variance=2.0, length_x_m=0.4, length_y_m=0.8, length_z_m=0.2, noise_variance=0.02
)
START = KernelParameters(
    signal_variance=1.0, length_x_m=1.0, length_y_m=1.0, length_z_m=1.0, noise_variance=0.1
)
TRUE_LEVELS = (
    KernelParameters(
        signal_variance=1.0, length_x_m=0.9, length_y_m=0.9, length_z_m=0.9, noise_variance=0.09
    ),
    KernelParameters(
        signal_variance=0.3, length_x_m=0.3, length_y_m=0.3, length_z_m=0.3, noise_variance=0.02
    ),
    KernelParameters(
        signal_variance=0.1, length_x_m=0.6, length_y_m=0.6, length_z_m=0.6, noise_variance=0.001
    ),
)


def drawn_samples(n: int, seed: int) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(n, 3))
    K = covariance(points, points, TRUE_KERNEL) + TRUE_KERNEL.noise_variance * np.eye(n)
    return points, np.linalg.cholesky(K) @ rng.standard_normal(n)


def drawn_levels(
    n: int, seed: int, rho: tuple[float, ...] = ()
) -> tuple[FloatArray, FloatArray, IntArray]:
    rng = np.random.default_rng(seed)
    points, levels = rng.uniform(size=(n, 3)), rng.integers(0, 3, n)
    prior, places = JointPrior(TRUE_LEVELS, rho), Places.of(points, level=levels)
    K = prior.covariance(places, places) + np.diag(prior.noise(places))
    return points, np.linalg.cholesky(K) @ rng.standard_normal(n), levels


def full_likelihood(shape: KernelShape, levels: int) -> MarginalLikelihood:
    """Everything at once: levels, learned rho, ageing, held noise and a linear mean."""
    rng = np.random.default_rng(7)
    points, root = rng.uniform(size=(40, 3)), 0.05 * rng.standard_normal((40, 40))
    return MarginalLikelihood(
        points,
        rng.standard_normal(40),
        shapes=(shape,) * levels,
        sample_levels=rng.integers(0, levels, 40),
        learns_rho=levels > 1,
        age=rng.uniform(size=40),
        held_noise=root @ root.T,
        basis=np.column_stack([np.ones(40), points]),
    )


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("levels", [1, 3])
def test_gradient_of_the_likelihood_agrees_with_finite_differences(
    shape: KernelShape, levels: int
) -> None:
    likelihood = full_likelihood(shape, levels)
    for seed in range(2):
        theta = np.random.default_rng(seed).normal(-0.7, 0.5, likelihood.size)
        gradient = likelihood.at(theta).derivatives().gradient
        error = check_grad(
            lambda t: likelihood.at(t).value,
            lambda t: likelihood.at(t).derivatives().gradient,
            theta,
            epsilon=1e-6,
        )
        assert error < 1e-5 * (1.0 + np.linalg.norm(gradient))


def test_derivatives_do_not_depend_on_what_was_evaluated_in_between() -> None:
    likelihood = full_likelihood("matern32", 3)
    theta = np.random.default_rng(0).normal(-0.7, 0.5, likelihood.size)
    expected = likelihood.at(theta).derivatives()
    evaluation = likelihood.at(theta)
    likelihood.at(theta + 0.5).derivatives()
    for _ in range(2):
        found = evaluation.derivatives()
        assert found.gradient == pytest.approx(expected.gradient, rel=1e-12)
        assert found.information == pytest.approx(expected.information, rel=1e-12)


def test_average_information_has_fisher_information_as_its_mean() -> None:
    points = np.random.default_rng(0).uniform(size=(30, 3))
    theta, step = log_parameters(TRUE_KERNEL), 1e-5

    def noisy_covariance(log_kernel: FloatArray) -> FloatArray:
        signal, x, y, z, noise = np.exp(log_kernel).tolist()
        kernel = KernelParameters(
            signal_variance=signal, length_x_m=x, length_y_m=y, length_z_m=z, noise_variance=noise
        )
        return covariance(points, points, kernel) + noise * np.eye(30)

    K = noisy_covariance(theta)
    changes = [
        np.linalg.solve(
            K, (noisy_covariance(theta + step * e) - noisy_covariance(theta - step * e))
        )
        / (2.0 * step)
        for e in np.eye(5)
    ]
    fisher = np.array([[0.5 * np.sum(a * b.T) for b in changes] for a in changes])
    root, rng = np.linalg.cholesky(K), np.random.default_rng(1)
    mean = np.mean(
        [
            MarginalLikelihood(points, root @ rng.standard_normal(30))
            .at(theta)
            .derivatives()
            .information
            for _ in range(1500)
        ],
        axis=0,
    )
    assert np.abs(mean - fisher).max() < 0.1 * np.abs(fisher).max()


@pytest.mark.parametrize("shape", SHAPES)
def test_likelihood_is_that_of_the_gaussian_process(shape: KernelShape) -> None:
    points, values = drawn_samples(30, seed=1)
    kernel = TRUE_KERNEL.model_copy(update={"shape": shape})
    expected = -GaussianProcess(kernel, points, values).log_marginal_likelihood()
    found = MarginalLikelihood(points, values, shapes=(shape,)).at(log_parameters(kernel)).value
    assert found == pytest.approx(expected, rel=1e-12)


def test_likelihood_of_levels_is_that_of_the_joint_model() -> None:
    points, values, levels = drawn_levels(60, seed=2, rho=(0.7, -1.2))
    theta = np.concatenate([log_parameters(level) for level in TRUE_LEVELS])
    model = JointGaussianProcess(TRUE_LEVELS, points, values, levels, rho=(0.7, -1.2))
    found = MarginalLikelihood(
        points, values, shapes=("matern32",) * 3, sample_levels=levels, rho=(0.7, -1.2)
    )
    assert found.at(theta).value == pytest.approx(-model.log_marginal_likelihood(), rel=1e-12)


def test_learning_finds_the_kernel_that_drew_the_samples() -> None:
    points, values = drawn_samples(350, seed=2)
    learned = learn(points, values, [START], noise_floor=1e-6)
    assert learned.converged
    for name, true in TRUE_KERNEL.model_dump(exclude={"shape"}).items():
        assert getattr(learned.parameters, name) == pytest.approx(true, rel=0.6), name
    truth = GaussianProcess(TRUE_KERNEL, points, values).log_marginal_likelihood()
    assert learned.log_likelihood >= truth


def test_learning_ends_where_the_likelihood_is_stationary() -> None:
    points, values = drawn_samples(150, seed=5)
    for shape in SHAPES:
        start = START.model_copy(update={"shape": shape})
        learned = learn(points, values, [start], noise_floor=1e-9)
        assert learned.converged
        assert learned.parameters.shape == shape
        theta = log_parameters(learned.parameters)
        likelihood = MarginalLikelihood(points, values, shapes=(shape,))
        assert np.abs(likelihood.at(theta).derivatives().gradient).max() < 0.05


def test_joint_learning_finds_the_levels_that_drew_the_samples() -> None:
    points, values, levels = drawn_levels(420, seed=3)
    learned = learn_levels(points, values, levels, [(START,) * 3], noise_floor=1e-6)
    truth = JointGaussianProcess(TRUE_LEVELS, points, values, levels).log_marginal_likelihood()
    assert learned.log_likelihood > truth
    found = JointGaussianProcess(learned.levels, points, values, levels)
    assert learned.log_likelihood == pytest.approx(found.log_marginal_likelihood(), rel=1e-9)
    for mine, true in zip(learned.levels, TRUE_LEVELS, strict=True):
        assert mine.length_x_m == pytest.approx(true.length_x_m, rel=0.8)
        assert mine.signal_variance == pytest.approx(true.signal_variance, rel=0.9)
    assert learned.levels[0].noise_variance == pytest.approx(0.09, rel=0.5)


def test_the_scale_of_each_step_between_levels_is_learned_where_asked() -> None:
    for rho in ((2.0, 0.6), (-1.5, 1.0)):
        points, values, levels = drawn_levels(300, seed=4, rho=rho)
        learned = learn_levels(
            points, values, levels, [TRUE_LEVELS], noise_floor=1e-6, learns_rho=True
        )
        assert learned.rho == pytest.approx(rho, abs=0.3)
        same = JointGaussianProcess(learned.levels, points, values, levels, rho=learned.rho)
        assert learned.log_likelihood == pytest.approx(same.log_marginal_likelihood(), rel=1e-9)


def test_a_held_level_keeps_its_kernel() -> None:
    points, values, levels = drawn_levels(90, seed=4)
    learned = learn_levels(points, values, levels, [(START,) * 3], noise_floor=1e-6, held=[1])
    assert learned.levels[1] == START
    assert learned.levels[0] != START


def test_a_held_level_keeps_the_scale_of_its_steps() -> None:
    points, values, levels = drawn_levels(120, seed=4)
    for held, stays, moves in ((0, 0, 1), (2, 1, 0)):
        learned = learn_levels(
            points,
            values,
            levels,
            [(START,) * 3],
            noise_floor=1e-6,
            rho=(0.9, 1.1),
            learns_rho=True,
            held=[held],
        )
        assert learned.rho[stays] == (0.9, 1.1)[stays]
        assert learned.rho[moves] != (0.9, 1.1)[moves]


def test_a_strong_prior_keeps_the_kernel_and_none_lets_it_go() -> None:
    points, values = drawn_samples(120, seed=6)
    offsets = [
        np.abs(
            log_parameters(
                learn(points, values, [START], noise_floor=1e-9, prior_strength=strength).parameters
            )
            - log_parameters(START)
        ).max()
        for strength in (0.0, 2.0, 50.0, 1e4)
    ]
    assert offsets == sorted(offsets, reverse=True)
    assert offsets[-1] < 1e-3
    assert offsets[0] > 1.0


def test_a_prior_of_one_decade_costs_half_a_nat_at_one_decade() -> None:
    prior = LogNormalPrior(np.zeros(5), strength=1.0)
    value, slope = prior.penalty(np.array([np.log(10.0), 0.0, 0.0, 0.0, 0.0]))
    assert value == pytest.approx(0.5)
    assert slope == pytest.approx([1.0 / np.log(10.0), 0.0, 0.0, 0.0, 0.0])


def test_a_mean_is_learned_with_the_kernel() -> None:
    points, values = drawn_samples(250, seed=8)
    slope = np.array([3.0, -2.0, 5.0])
    shifted = values + 40.0 + points @ slope
    basis = np.column_stack([np.ones(250), points])
    learned = learn(points, shifted, [TRUE_KERNEL], noise_floor=1e-6, basis=basis)
    assert learned.trend[0] == pytest.approx(40.0, abs=4.0)
    assert learned.trend[1:] == pytest.approx(slope, abs=4.0)
    same = learn(points, values, [TRUE_KERNEL], noise_floor=1e-6, basis=basis)
    assert same.log_likelihood == pytest.approx(learned.log_likelihood, abs=1e-3)


def test_held_noise_explains_what_a_learned_noise_would_have_to() -> None:
    points, values = drawn_samples(200, seed=9)
    spoilt = values.copy()
    spoilt[::2] += 3.0 * np.random.default_rng(0).standard_normal(100)
    held = np.diag(np.tile([9.0, 0.0], 100))
    told = learn(points, spoilt, [TRUE_KERNEL], noise_floor=1e-6, held_noise=held)
    untold = learn(points, spoilt, [TRUE_KERNEL], noise_floor=1e-6)
    assert told.parameters.noise_variance < 0.2
    assert untold.parameters.noise_variance > 2.0


def test_the_best_of_several_starts_wins() -> None:
    points, values = drawn_samples(60, seed=3)
    hopeless = TRUE_KERNEL.model_copy(update={"length_x_m": 1e-6, "length_y_m": 1e-6})
    good = learn(points, values, [TRUE_KERNEL], noise_floor=1e-6)
    both = learn(points, values, [hopeless, TRUE_KERNEL], noise_floor=1e-6)
    assert both.log_likelihood == pytest.approx(good.log_likelihood, abs=1e-3)


def test_noise_is_never_learned_below_its_floor() -> None:
    points = np.random.default_rng(4).uniform(size=(80, 3))
    smooth = np.sin(points.sum(axis=1))
    learned = learn(points, smooth, [KernelParameters()], noise_floor=0.01)
    assert learned.parameters.noise_variance == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parametrize(
    "wrong",
    [
        {"signal_variance": 1e-9},
        {"signal_variance": 1e6, "noise_variance": 1e-9},
        {"length_x_m": 1e6, "length_y_m": 1e6, "length_z_m": 1e6},
        {"length_x_m": 1e-6, "length_y_m": 1e-6, "length_z_m": 1e-6},
        {"noise_variance": 1e6},
    ],
)
def test_a_wrong_start_ends_in_a_kernel_and_a_sentence(wrong: dict[str, float]) -> None:
    points, values = drawn_samples(50, seed=10)
    doubled = np.vstack([points, points])  # each sample twice at one place
    learned = learn(
        doubled,
        np.concatenate([values, values]),
        [START.model_copy(update=wrong)],
        noise_floor=1e-12,
    )
    assert np.isfinite(learned.log_likelihood)
    assert learned.message


def test_the_iteration_limit_holds_and_is_told() -> None:
    points, values = drawn_samples(60, seed=3)
    learned = learn(points, values, [START], noise_floor=1e-6, max_iterations=1)
    assert not learned.converged
    assert learned.message == "stopped after 1 iterations, before it converged"


def test_learning_from_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="at least two values"):
        learn(np.zeros((1, 3)), np.zeros(1), [KernelParameters()], noise_floor=1e-6)
    with pytest.raises(ValueError, match="finite"):
        learn(np.zeros((2, 3)), np.array([0.0, np.nan]), [KernelParameters()], noise_floor=1e-6)
