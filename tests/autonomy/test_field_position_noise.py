"""The model with position-dependent noise: its noise, its limits, and what it does with them."""

import numpy as np
import pytest

from autonomy.field.config import KernelParameters
from autonomy.field.model.gaussian_process import Ageing, GaussianProcess
from autonomy.field.model.kernel import covariance, gradient_variance
from autonomy.field.model.model_prior import Places
from autonomy.field.model.position_noise import (
    PositionNoiseGaussianProcess,
    Slope,
    curvature_noise,
    position_noise,
    slope_correlation,
    slope_given,
)
from autonomy.field.reckoning import position_error_covariance
from autonomy.field.samples import FieldSamples

KERNEL = KernelParameters(
    signal_variance=2.0, length_x_m=1.1, length_y_m=0.8, length_z_m=0.6, noise_variance=0.01
)
TARGETS = np.random.default_rng(5).uniform(0.0, [2.0, 1.5, 0.6], (12, 3))


def samples_of_dives(dives=4, each=8, greatest_std_m=0.2, seed=0):
    """Samples along dives whose positions become less and less certain."""
    rng = np.random.default_rng(seed)
    n = dives * each
    points = rng.uniform(0.0, [2.0, 1.5, 0.6], (n, 3))
    std = np.tile(np.linspace(0.01, greatest_std_m, each), dives)
    values = wavy(points) + 0.1 * rng.standard_normal(n)
    return FieldSamples.of(points, values, std)


def wavy(points):
    return np.sin(2.0 * points[:, 0]) + points[:, 1]


def exactly_located(samples):
    return FieldSamples.of(samples.points, samples.values, np.zeros(len(samples)))


def test_with_exact_positions_it_is_the_plain_gaussian_process():
    samples = exactly_located(samples_of_dives())
    model = PositionNoiseGaussianProcess(KERNEL, samples, samples.values)
    plain = GaussianProcess(KERNEL, samples.points, samples.values)
    np.testing.assert_allclose(model.mean(TARGETS), plain.mean(TARGETS), atol=1e-12)
    np.testing.assert_allclose(model.covariance(TARGETS), plain.covariance(TARGETS), atol=1e-12)
    assert model.log_marginal_likelihood() == pytest.approx(plain.log_marginal_likelihood())


def test_without_samples_it_is_the_prior():
    model = PositionNoiseGaussianProcess(KERNEL, FieldSamples.none(), np.empty(0))
    np.testing.assert_array_equal(model.mean(TARGETS), np.zeros(len(TARGETS)))
    np.testing.assert_array_equal(model.variance(TARGETS), np.full(len(TARGETS), 2.0))


@pytest.mark.parametrize("shape", ["matern32", "matern52", "squared_exponential"])
def test_its_noise_is_a_covariance_within_each_dive_and_nothing_between_dives(shape):
    kernel = KERNEL.model_copy(update={"shape": shape})
    samples = samples_of_dives(greatest_std_m=0.5)
    model = PositionNoiseGaussianProcess(kernel, samples, samples.values)
    noise = model.noise.covariance
    np.testing.assert_allclose(noise, noise.T, atol=1e-14)
    assert np.linalg.eigvalsh(noise).min() >= -1e-12
    assert not noise[np.not_equal.outer(samples.dive, samples.dive)].any()
    assert (noise[:8, :8] != 0.0).all()


def test_a_sample_alone_in_its_dive_gets_the_variance_of_its_error_times_the_squared_slope():
    samples = samples_of_dives()
    alone = FieldSamples.of(
        samples.points, samples.values, samples.position_std_m, dive=np.arange(len(samples))
    )
    model = PositionNoiseGaussianProcess(KERNEL, alone, alone.values)
    squared_slope = np.sum(model.noise.slope.mean**2, axis=1) + model.noise.slope.std**2
    expected = alone.position_std_m**2 * squared_slope
    expected = np.diag(expected + curvature_noise(alone.position_std_m, KERNEL))
    np.testing.assert_allclose(model.noise.covariance, expected, atol=1e-14)


def test_before_any_iteration_the_slope_is_the_prior_one():
    samples = samples_of_dives()
    model = PositionNoiseGaussianProcess(KERNEL, samples, samples.values, iterations=0)
    shared = position_error_covariance(samples, samples)
    alike = slope_correlation(samples.points, samples.points, KERNEL)
    expected = shared * alike * sum(gradient_variance(KERNEL))
    size = np.sqrt(curvature_noise(samples.position_std_m, KERNEL)) / samples.position_std_m**2
    expected += shared**2 * alike * np.outer(size, size)
    np.testing.assert_allclose(model.noise.covariance, expected, atol=1e-14)


def test_the_slope_is_the_derivative_of_the_posterior_mean_and_of_its_covariance():
    samples = samples_of_dives()
    process = GaussianProcess(KERNEL, samples.points, samples.values)
    slope = slope_given(process.posterior, Places.of(TARGETS), KERNEL)
    step, total = 1e-4, np.zeros(len(TARGETS))
    for axis in range(2):
        offset = np.zeros(3)
        offset[axis] = step
        ahead, behind = TARGETS + offset, TARGETS - offset
        difference = (process.mean(ahead) - process.mean(behind)) / (2 * step)
        np.testing.assert_allclose(slope.mean[:, axis], difference, atol=1e-4)
        for i in range(len(TARGETS)):
            pair = process.covariance(np.array([ahead[i], behind[i]]))
            total[i] += (pair[0, 0] + pair[1, 1] - 2 * pair[0, 1]) / (2 * step) ** 2
    np.testing.assert_allclose(slope.std, np.sqrt(total), rtol=2e-3)


def test_noise_between_two_sets_of_samples_is_a_block_of_the_noise_of_all():
    samples = samples_of_dives()
    model = PositionNoiseGaussianProcess(KERNEL, samples, samples.values)
    first, last, slope = slice(0, 20), slice(20, None), model.noise.slope
    block = position_noise(samples[first], samples[last], slope[first], slope[last], KERNEL)
    assert block.any()
    np.testing.assert_allclose(block, model.noise.covariance[first, last], atol=1e-14)


@pytest.mark.parametrize("shape", ["matern32", "matern52", "squared_exponential"])
def test_curvature_noise_is_what_drawn_fields_differ_by_from_their_tangents(shape):
    kernel = KERNEL.model_copy(update={"shape": shape})
    rng = np.random.default_rng(7)
    std_m, step = 0.3, 1e-4
    expected = curvature_noise(np.array([std_m]), kernel)[0]
    left = []
    for _ in range(400):
        error = np.array([*(std_m * rng.standard_normal(2)), 0.0])
        places = np.array([[0, 0, 0], error, [step, 0, 0], [0, step, 0]])
        weights = np.array([-1.0, 1.0, -error[0] / step, -error[1] / step])
        weights[0] += (error[0] + error[1]) / step
        left.append(weights @ covariance(places, places, kernel) @ weights)
    assert expected == pytest.approx(np.mean(left), abs=4.0 * np.std(left) / 20.0)
    assert curvature_noise(np.zeros(2), kernel) == pytest.approx([0.0, 0.0])


def test_curvature_noise_of_the_thesis_kernel_grows_with_the_third_power_of_a_small_error():
    small, double = curvature_noise(np.array([0.001, 0.002]), KERNEL)
    assert double / small == pytest.approx(8.0, rel=0.02)


def test_a_dive_that_was_carried_away_pulls_the_map_less_than_if_its_samples_erred_one_by_one():
    rng = np.random.default_rng(3)
    good = rng.uniform(0.0, [2.0, 1.5, 0.6], (60, 3))
    carried = np.column_stack(
        [np.linspace(0.3, 1.7, 15), np.full(15, 0.7), np.linspace(0.1, 0.5, 15)]
    )
    believed = carried + np.array([0.25, 0.0, 0.0])
    points = np.concatenate([good, believed])
    values = np.concatenate([wavy(good), wavy(carried)])
    std = np.concatenate([np.zeros(60), np.full(15, 0.25)])
    together = FieldSamples.of(points, values, std, dive=np.repeat([0, 1], [60, 15]))
    apart = FieldSamples.of(points, values, std, dive=np.arange(75))
    error = [
        np.sqrt(np.mean((model.mean(believed) - wavy(believed)) ** 2))
        for model in (
            PositionNoiseGaussianProcess(KERNEL, together, values),
            PositionNoiseGaussianProcess(KERNEL, apart, values),
            GaussianProcess(KERNEL, points, values),
        )
    ]
    assert error[0] < 0.9 * error[1] < 0.9 * error[2]


def test_samples_that_time_has_made_worthless_tell_nothing_of_the_slope():
    samples = samples_of_dives()
    old = FieldSamples.of(
        samples.points, samples.values, samples.position_std_m, time_s=1e6 * np.arange(32)
    )
    ageing = Ageing(old.time_s, float(old.time_s[-1]), memory_s=10.0)
    model = PositionNoiseGaussianProcess(
        KERNEL,
        old[:-1],
        old.values[:-1],
        ageing=Ageing(old.time_s[:-1], ageing.now_s, ageing.memory_s),
    )
    np.testing.assert_allclose(model.mean(TARGETS), 0.0, atol=1e-12)
    np.testing.assert_allclose(model.noise.slope.mean, 0.0, atol=1e-12)
    prior = Slope.of_prior(31, KERNEL)
    np.testing.assert_allclose(model.noise.slope.std, prior.std)


def test_a_field_without_slope_is_refused_in_words():
    samples = samples_of_dives()
    rough = KERNEL.model_copy(update={"shape": "matern12"})
    with pytest.raises(ValueError, match="Matern-1/2"):
        PositionNoiseGaussianProcess(rough, samples, samples.values)
