from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import check_grad

from autonomy.arrays import FloatArray
from autonomy.field.config import FIELD_PRESETS, KernelParameters
from autonomy.field.gaussian_process import GaussianProcess
from autonomy.field.kernel import matern32
from autonomy.field.learning import learn, negative_log_likelihood
from autonomy.field.manual_survey import (
    PRESET_ESTIMATOR,
    PRESET_MOTION,
    PRESET_SITE,
    derived_preset,
    learned_config,
    simulate_survey,
)
from autonomy.field.recorded import fit_recording, recorded_map

DEPLOYMENT = Path(__file__).parents[3] / "shared" / "data" / "eva035_chl_temp.csv"
TRUE_KERNEL = KernelParameters(
    signal_variance=2.0, length_x_m=0.4, length_y_m=0.8, length_z_m=0.2, noise_variance=0.02
)


def drawn_samples(n: int, seed: int) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(n, 3))
    covariance = matern32(points, points, TRUE_KERNEL) + TRUE_KERNEL.noise_variance * np.eye(n)
    return points, np.linalg.cholesky(covariance) @ rng.standard_normal(n)


def test_gradient_of_the_likelihood_agrees_with_finite_differences() -> None:
    points, values = drawn_samples(40, seed=0)
    squared = np.square(points.T[:, :, None] - points.T[:, None, :])
    for seed in range(3):
        theta = np.random.default_rng(seed).normal(-1.0, 0.5, 5)
        error = check_grad(
            lambda t: negative_log_likelihood(t, squared, values)[0],
            lambda t: negative_log_likelihood(t, squared, values)[1],
            theta,
            epsilon=1e-6,
        )
        scale = np.linalg.norm(negative_log_likelihood(theta, squared, values)[1])
        assert error < 1e-5 * scale


def test_likelihood_is_that_of_the_gaussian_process() -> None:
    points, values = drawn_samples(30, seed=1)
    squared = np.square(points.T[:, :, None] - points.T[:, None, :])
    theta = np.log(list(TRUE_KERNEL.model_dump(exclude={"shape"}).values()))
    expected = -GaussianProcess(TRUE_KERNEL, points, values).log_marginal_likelihood()
    assert negative_log_likelihood(theta, squared, values)[0] == pytest.approx(expected, rel=1e-12)


def test_learning_finds_the_kernel_that_drew_the_samples() -> None:
    points, values = drawn_samples(350, seed=2)
    start = KernelParameters(
        signal_variance=1.0, length_x_m=1.0, length_y_m=1.0, length_z_m=1.0, noise_variance=0.1
    )
    learned = learn(points, values, [start], noise_floor=1e-6)
    assert learned.converged
    for name, true in TRUE_KERNEL.model_dump(exclude={"shape"}).items():
        assert getattr(learned.parameters, name) == pytest.approx(true, rel=0.6), name
    truth = GaussianProcess(TRUE_KERNEL, points, values).log_marginal_likelihood()
    assert learned.log_likelihood >= truth


def test_the_best_of_several_starts_wins() -> None:
    points, values = drawn_samples(60, seed=3)
    hopeless = TRUE_KERNEL.model_copy(update={"length_x_m": 1e-6, "length_y_m": 1e-6})
    good = learn(points, values, [TRUE_KERNEL], noise_floor=1e-6)
    both = learn(points, values, [hopeless, TRUE_KERNEL], noise_floor=1e-6)
    assert both.log_likelihood == good.log_likelihood


def test_noise_is_never_learned_below_its_floor() -> None:
    points = np.random.default_rng(4).uniform(size=(80, 3))
    smooth = np.sin(points.sum(axis=1))
    learned = learn(points, smooth, [KernelParameters()], noise_floor=0.01)
    assert learned.parameters.noise_variance == pytest.approx(0.01, rel=1e-9)


def test_learning_from_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="at least two values"):
        learn(np.zeros((1, 3)), np.zeros(1), [KernelParameters()], noise_floor=1e-6)


@pytest.mark.parametrize("key", ["blue_light", "chlorophyll"])
def test_presets_are_what_the_simulated_manual_survey_yields(key: str) -> None:
    derived = derived_preset(key, np.random.default_rng(0))
    preset = FIELD_PRESETS[key]
    assert derived.prior_mean == pytest.approx(preset.prior_mean, rel=0.01)
    learned, stored = (derived.single, *derived.levels), (preset.single, *preset.levels)
    for ours, theirs in zip(learned, stored, strict=True):
        for name, value in theirs.model_dump(exclude={"shape"}).items():
            assert getattr(ours, name) == pytest.approx(value, rel=0.03), name


@pytest.mark.parametrize("key", ["blue_light", "chlorophyll"])
def test_manual_survey_stays_in_the_domain_and_visits_every_fidelity_level(key: str) -> None:
    domain = PRESET_SITE[key].domain
    survey = simulate_survey(
        key, domain, PRESET_MOTION[key], PRESET_ESTIMATOR[key], 600, np.random.default_rng(1)
    )
    slack = 5.0 * survey.position_std.max()
    assert all(domain.contains(*point, margin_m=slack) for point in survey.points)
    low, high = FIELD_PRESETS[key].fidelity_thresholds_m
    std = survey.position_std
    for count in ((std <= low).sum(), ((std > low) & (std <= high)).sum(), (std > high).sum()):
        assert count >= 20


def test_a_level_that_a_survey_hardly_visits_keeps_its_kernel() -> None:
    domain, motion = PRESET_SITE["blue_light"].domain, PRESET_MOTION["blue_light"]
    survey = simulate_survey(
        "blue_light", domain, motion, PRESET_ESTIMATOR["blue_light"], 80, np.random.default_rng(2)
    )
    base = FIELD_PRESETS["blue_light"].with_thresholds((0.05, 9.0))
    learned = learned_config(base, survey, survey)
    assert learned.levels[0] == base.levels[0]
    assert learned.levels[1] != base.levels[1]


def yo_yo_recording(n: int) -> tuple[FloatArray, FloatArray]:
    along = np.linspace(0.0, 5000.0, n)
    depth = 60.0 * (1.0 - np.cos(2.0 * np.pi * along / 500.0))
    points = np.column_stack([along, 0.3 * along, depth])
    bloom = np.exp(-0.5 * ((depth - 40.0) / 15.0) ** 2) * (1.0 + 0.3 * np.sin(along / 800.0))
    return points, bloom + 0.05 * np.random.default_rng(5).standard_normal(n)


def test_a_recording_is_learned_scored_and_mapped() -> None:
    points, values = yo_yo_recording(800)
    fit = fit_recording("chlorophyll", points, values, np.random.default_rng(0), training=250)
    assert (fit.training, fit.test) == (250, 200)
    assert fit.scores.rmse < 0.25
    assert 0.8 <= fit.scores.coverage_90 <= 1.0
    assert fit.config.single.noise_variance == pytest.approx(0.05**2, rel=0.6)
    live_map = recorded_map(fit, points, values)
    assert live_map.grid.z_m[-1] == fit.box.depth_max_m == points[:, 2].max()
    assert live_map.mean.max() > 5.0 * abs(live_map.mean.min())


def test_a_recording_with_holes_or_hardly_any_samples_is_refused() -> None:
    points, values = yo_yo_recording(100)
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="at least 20 samples above 1 m"):
        fit_recording("chlorophyll", points, values, rng, depth_limit_m=1.0)
    values[3] = np.nan
    with pytest.raises(ValueError, match="finite"):
        fit_recording("chlorophyll", points, values, rng)


def test_a_recording_of_one_constant_at_one_place_is_mapped() -> None:
    points, values = np.ones((40, 3)), np.full(40, 3.0)
    fit = fit_recording("chlorophyll", points, values, np.random.default_rng(0))
    assert recorded_map(fit, points, values).mean == pytest.approx(3.0, abs=1e-3)


@pytest.mark.skipif(not DEPLOYMENT.exists(), reason=f"{DEPLOYMENT.name} is not on this machine")
def test_chlorophyll_of_a_real_glider_is_mapped_to_a_third_of_its_spread() -> None:
    rows = np.genfromtxt(DEPLOYMENT, delimiter=",", names=True)
    latitude, longitude = np.radians(rows["latitude"]), np.radians(rows["longitude"])
    north = (latitude - latitude[0]) * 6.371e6
    east = (longitude - longitude[0]) * 6.371e6 * np.cos(latitude[0])
    points = np.column_stack([north, east, rows["depth"]])
    fit = fit_recording("chlorophyll", points, rows["chlorophyll"], np.random.default_rng(0))
    assert (fit.training, fit.test) == (900, 400)
    assert fit.scores.rmse < 0.306
    assert fit.scores.nlpd < 0.1
    assert fit.scores.coverage_90 > 0.85
