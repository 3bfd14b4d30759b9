import numpy as np
import pytest

from autonomy.arrays import FloatArray
from autonomy.field.config import FIELD_PRESETS, FieldConfig, KernelParameters
from autonomy.field.fidelity import fidelity_level
from autonomy.field.live.inducing import InducingPosterior, inducing_places
from autonomy.field.live.inducing_model import GrowingInducing, InducingGaussianProcess
from autonomy.field.model.model import centred_values, condition
from autonomy.field.model.model_prior import AgeingPrior, JointPrior, Places, Prior, SinglePrior
from autonomy.field.model.posterior import Posterior
from autonomy.field.samples import FieldSamples
from autonomy.field.synthetic import measure, truth
from autonomy.site import TANK

KERNEL = KernelParameters(
    signal_variance=2.0, length_x_m=0.8, length_y_m=0.6, length_z_m=0.4, noise_variance=0.01
)
LEVELS = (KERNEL, KERNEL.model_copy(update={"signal_variance": 0.3, "noise_variance": 0.002}))
PRIORS: dict[str, Prior] = {
    "single": SinglePrior(KERNEL),
    "joint": JointPrior(LEVELS, rho=(0.8,)),
}
HIGH = [2.75, 1.37, 0.65]


def some_places(count: int, seed: int) -> Places:
    rng = np.random.default_rng(seed)
    return Places.of(
        rng.uniform([0.0, 0.0, 0.0], HIGH, size=(count, 3)),
        level=rng.integers(0, 2, count),
        time_s=rng.uniform(0.0, 100.0, count),
    )


def tank_samples(count: int, seed: int, position_std_m: float = 0.0) -> FieldSamples:
    rng = np.random.default_rng(seed)
    points = rng.uniform([0.0, 0.0, 0.0], HIGH, size=(count, 3))
    return FieldSamples.of(
        points, measure("blue_light", points, rng), np.full(count, position_std_m)
    )


def settings(**changes: object) -> FieldConfig:
    preset = FIELD_PRESETS["blue_light"].model_dump()
    return FieldConfig.model_validate(preset | {"model": "single"} | changes)


def log_light(points: FloatArray) -> FloatArray:
    return np.log(truth("blue_light", points))


@pytest.mark.parametrize("name", PRIORS)
@pytest.mark.parametrize("own_noise", [False, True])
def test_sums_at_the_samples_themselves_are_exact(name: str, own_noise: bool) -> None:
    prior, places, targets = PRIORS[name], some_places(60, 0), some_places(25, 1)
    rng = np.random.default_rng(2)
    values, noise = rng.standard_normal(60), rng.uniform(0.01, 0.2, 60) if own_noise else None
    exact = Posterior(prior, places, values, noise)
    summed = InducingPosterior(prior, places)
    summed.append(places, values, noise)
    at_top = Places.of(targets.points, level=prior.top_level, time_s=90.0)
    assert summed.mean(at_top) == pytest.approx(exact.mean(at_top), abs=1e-8)
    for ours, theirs in zip(summed.marginals(at_top), exact.marginals(at_top), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-8)
    assert summed.covariance(at_top) == pytest.approx(exact.covariance(at_top), abs=1e-8)
    assert summed.log_marginal_likelihood() == pytest.approx(
        exact.log_marginal_likelihood(), rel=1e-8
    )
    assert summed.unexplained_share < 1e-9


def test_ageing_between_samples_is_the_exact_space_time_model() -> None:
    memory_s, places = 50.0, some_places(60, 0)
    values, stay = np.random.default_rng(2).standard_normal(60), SinglePrior(KERNEL)
    times = np.repeat([0.0, 30.0, 45.0], 20)
    places = Places.of(places.points, time_s=times)
    exact = Posterior(AgeingPrior(stay, memory_s), places, values)
    everywhere = Places.of(places.points)
    summed = InducingPosterior(stay, everywhere)
    before_s = 0.0
    for time_s in (0.0, 30.0, 45.0):
        summed.age(np.exp(-(time_s - before_s) / memory_s))
        now, before_s = times == time_s, time_s
        summed.append(everywhere[now], values[now])
    targets = some_places(25, 1).points
    found = summed.marginals(Places.of(targets))
    expected = exact.marginals(Places.of(targets, time_s=45.0))
    for ours, theirs in zip(found, expected, strict=True):
        assert ours == pytest.approx(theirs, abs=1e-7)
    assert summed.log_marginal_likelihood() == pytest.approx(
        exact.log_marginal_likelihood(), rel=1e-7
    )


def test_samples_taken_in_one_by_one_count_as_those_taken_in_at_once() -> None:
    places, values = some_places(3000, 3), np.random.default_rng(4).standard_normal(3000)
    inducing = inducing_places(places, 40, (1.0, 1.0, 1.0))
    at_once = InducingPosterior(PRIORS["single"], inducing)
    at_once.append(places, values)
    in_parts = InducingPosterior(PRIORS["single"], inducing)
    in_parts.append(places[:1], values[:1])
    in_parts.append(places[1:1500], values[1:1500])
    in_parts.append(places[1500:], values[1500:])
    targets = some_places(20, 5)
    for ours, theirs in zip(in_parts.marginals(targets), at_once.marginals(targets), strict=True):
        assert ours == pytest.approx(theirs, rel=1e-7, abs=1e-9)
    assert in_parts.samples == at_once.samples == 3000
    assert in_parts.unexplained_share == pytest.approx(at_once.unexplained_share)


def test_more_inducing_points_come_closer_to_the_exact_map() -> None:
    config, samples = settings(), tank_samples(1200, 6)
    values, targets = centred_values(config, samples), tank_samples(300, 7).points
    exact = condition(config, samples)
    errors, shares = [], []
    for count in (64, 256, 1024):
        few = config.model_copy(update={"inducing_points": count})
        summed = InducingGaussianProcess(few, samples, values)
        difference = config.prior_mean + summed.mean(targets) - exact.mean(targets)
        errors.append(float(np.sqrt(np.mean(difference**2))))
        shares.append(summed.unexplained_share)
        assert summed.variance(targets).mean() > 0.95 * exact.variance(targets).mean()
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.1 * np.sqrt(np.mean(exact.variance(targets)))
    assert shares == sorted(shares, reverse=True)


def test_a_map_of_many_samples_is_as_good_as_it_says() -> None:
    config, samples = settings(inducing_points=256), tank_samples(10_000, 8)
    summed = InducingGaussianProcess(config, samples, centred_values(config, samples))
    targets = tank_samples(400, 9).points
    mean, variance = summed.marginals(targets)
    error = log_light(targets) - config.prior_mean - mean
    assert np.sqrt(np.mean(error**2)) < 0.02
    assert np.mean(np.abs(error) < 1.645 * np.sqrt(variance)) > 0.85
    assert summed.covariance(targets).diagonal() == pytest.approx(variance, rel=1e-6, abs=1e-12)
    assert summed.samples == 10_000


def test_badly_located_samples_count_less_where_the_field_is_steep() -> None:
    bad, good = tank_samples(800, 10, position_std_m=0.15), tank_samples(100, 11)
    both = FieldSamples.of(
        np.vstack([bad.points, good.points]),
        np.concatenate([bad.values, good.values]),
        np.concatenate([bad.position_std_m, good.position_std_m]),
    )
    targets = tank_samples(300, 12).points
    variances = {}
    for model in ("single", "position_noise"):
        config = settings(model=model, inducing_points=200)
        summed = InducingGaussianProcess(config, both, centred_values(config, both))
        variances[model] = summed.variance(targets)
    assert (variances["position_noise"] > variances["single"]).all()
    exact = condition(settings(model="position_noise"), good)
    assert variances["position_noise"].mean() < 1.2 * exact.variance(targets).mean()


def test_levels_of_either_model_are_joint_levels() -> None:
    samples = tank_samples(150, 13)
    spread = np.random.default_rng(0).uniform(0.0, 0.2, 150)
    samples = FieldSamples.of(samples.points, samples.values, spread)
    targets = tank_samples(30, 14).points
    for model, name in (("joint", "joint_levels"), ("recursive", "levels")):
        config = settings(model=model, inducing_points=150)
        values = centred_values(config, samples)
        summed = InducingGaussianProcess(config, samples, values)
        level = fidelity_level(spread, config.fidelity_thresholds_m)
        prior = JointPrior(getattr(config, name), config.rho)
        exact = Posterior(prior, Places.of(samples.points, level=level), values)
        expected = exact.mean(Places.of(targets, level=2))
        assert summed.mean(targets) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("model", ["single", "joint", "recursive", "position_noise"])
def test_a_growing_map_learns_from_what_is_appended(model: str) -> None:
    config = settings(model=model, inducing_points=64)
    samples = tank_samples(400, 15, position_std_m=0.02)
    values, points = centred_values(config, samples), tank_samples(50, 16).points
    growing = GrowingInducing(config, points, samples[:200], values[:200])
    before = growing.variance.mean()
    growing.append(samples[200:], values[200:])
    assert growing.variance.mean() < before
    assert growing.noise_covariance is None
    error = log_light(points) - config.prior_mean - growing.mean
    assert np.sqrt(np.mean(error**2)) < 0.25
    growing.append(samples[:0], values[:0])
    assert growing.field.samples == 400


@pytest.mark.parametrize("model", ["single", "position_noise"])
def test_a_growing_map_of_a_field_that_changes_forgets(model: str) -> None:
    config = settings(model=model, inducing_points=128, memory_s=200.0)
    base = tank_samples(2000, 15)
    times = np.arange(2000.0)
    brighter = np.where(times < 1000.0, 1.0, 3.0)
    samples = FieldSamples.of(
        base.points, base.values * brighter, base.position_std_m, time_s=times
    )
    values, points = centred_values(config, samples), tank_samples(50, 16).points
    growing = GrowingInducing(config, points, samples[:900], values[:900])
    for start in range(900, 2000, 20):
        growing.append(samples[start : start + 20], values[start : start + 20])
    error = log_light(points) + np.log(3.0) - config.prior_mean - growing.mean
    assert np.sqrt(np.mean(error**2)) < 0.4
    assert np.mean(np.abs(error) < 1.645 * np.sqrt(growing.variance)) > 0.8
    assert (growing.variance > 0.0).all()


def test_samples_at_one_place_and_one_sample_alone_make_a_map() -> None:
    config = settings()
    for count in (1, 30):
        samples = FieldSamples.of(np.ones((count, 3)) / 2.0, np.full(count, 150.0), np.zeros(count))
        summed = InducingGaussianProcess(config, samples, centred_values(config, samples))
        mean, variance = summed.marginals(samples.points[:1])
        assert config.prior_mean + mean == pytest.approx(np.log(150.0), abs=0.01)
        assert 0.0 <= variance[0] < 0.002


def test_a_sum_without_inducing_points_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one inducing point"):
        InducingPosterior(PRIORS["single"], some_places(0, 0))


def test_inducing_points_spread_over_the_domain() -> None:
    places = some_places(500, 17)
    chosen = inducing_places(places, 30, (1.0, 1.0, 1.0)).points
    gaps = np.linalg.norm(chosen[:, None] - chosen[None], axis=2) + np.eye(30) * 9.0
    assert gaps.min() > 0.2
    assert TANK.domain.contains(*chosen[0])
