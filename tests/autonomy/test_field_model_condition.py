import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autonomy.field.config import FIELD_PRESETS, FieldConfig, GridShape, KernelParameters
from autonomy.field.grid import Grid
from autonomy.field.live.live_map import LiveMap
from autonomy.field.model.model import condition
from autonomy.field.samples import FieldSamples
from autonomy.field.synthetic import measure
from autonomy.site import TANK

MODELS = ("single", "recursive", "joint", "position_noise")
EVERY_MODEL = pytest.mark.parametrize("model", MODELS)
GRID = Grid.over(TANK.domain, GridShape(x=4, y=3, z=3))


def config_of(model: str, **changes: object) -> FieldConfig:
    preset = FIELD_PRESETS["blue_light"].model_dump()
    return FieldConfig.model_validate(preset | {"model": model} | changes)


def tank_samples(n: int) -> FieldSamples:
    rng = np.random.default_rng(0)
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(n, 3))
    return FieldSamples.of(
        points,
        measure("blue_light", points, rng),
        0.01 + 0.01 * (np.arange(n) % 17),
        time_s=5.0 * np.arange(n),
    )


@EVERY_MODEL
def test_every_model_says_the_same_by_each_of_its_methods(model: str) -> None:
    field = condition(config_of(model), tank_samples(80))
    mean, variance = field.marginals(GRID.points)
    assert np.array_equal(field.mean(GRID.points), mean)
    assert np.array_equal(field.variance(GRID.points), variance)
    assert np.diagonal(field.covariance(GRID.points)) == pytest.approx(variance, abs=1e-10)
    assert np.isfinite(field.log_marginal_likelihood())


@EVERY_MODEL
def test_far_from_all_samples_the_field_is_the_linear_prior_mean(model: str) -> None:
    config = config_of(model, slope_north_per_m=0.01, slope_east_per_m=-0.02, slope_depth_per_m=0.5)
    far = np.array([[900.0, -700.0, 3.0]])
    expected = config.prior_mean + 9.0 + 14.0 + 1.5
    assert condition(config, tank_samples(40)).mean(far) == pytest.approx(expected)


@EVERY_MODEL
def test_a_plane_in_the_values_is_learned_exactly_as_a_plane_in_the_prior(model: str) -> None:
    samples = tank_samples(40)
    flat = config_of(model, scale="linear")
    tilted = config_of(model, scale="linear", slope_north_per_m=3.0, slope_depth_per_m=-2.0)
    plane = samples.points @ [3.0, 0.0, -2.0]
    raised = FieldSamples.of(samples.points, samples.values + plane, samples.position_std_m)
    level = FieldSamples.of(samples.points, samples.values, samples.position_std_m)
    at = GRID.points
    difference = condition(tilted, raised).mean(at) - condition(flat, level).mean(at)
    assert difference == pytest.approx(at @ [3.0, 0.0, -2.0], abs=1e-8)


@EVERY_MODEL
def test_the_map_of_a_field_that_changes_fades_to_the_prior_as_time_goes_on(model: str) -> None:
    config, samples = config_of(model, memory_s=500.0), tank_samples(60)
    prior = condition(config, FieldSamples.none()).variance(GRID.points)
    last = condition(config, samples, now_s=300.0)
    newest = condition(config, samples)
    assert newest.mean(GRID.points) == pytest.approx(
        condition(config, samples, now_s=295.0).mean(GRID.points)
    )
    assert np.all(last.variance(GRID.points) > newest.variance(GRID.points))
    gone = condition(config, samples, now_s=1e6)
    assert gone.variance(GRID.points) == pytest.approx(prior)
    assert gone.mean(GRID.points) == pytest.approx(config.prior_mean)


@EVERY_MODEL
def test_samples_of_one_level_leave_the_others_at_their_prior(model: str) -> None:
    samples = tank_samples(30)
    for std in (0.01, 0.08, 0.3):
        at_one = FieldSamples.of(samples.points, samples.values, np.full(30, std))
        mean, variance = condition(config_of(model), at_one).marginals(GRID.points)
        assert np.isfinite(mean).all()
        assert np.all(variance > 0.0)


@st.composite
def crowded_samples(draw: st.DrawFn) -> FieldSamples:
    """Few places, few values, any uncertainty: the worst that a robot at rest may send."""
    n = draw(st.integers(1, 25))
    place = st.sampled_from([(0.0, 0.0, 0.0), (1.0, 0.5, 0.2), (1.0, 0.5, 0.2 + 1e-12)])
    points = draw(st.lists(place, min_size=n, max_size=n))
    value = st.sampled_from([0.0, 100.0, 100.0 + 1e-9, 4095.0])
    values = draw(st.lists(value, min_size=n, max_size=n))
    std = draw(st.lists(st.sampled_from([0.0, 1e-9, 0.1, 5.0]), min_size=n, max_size=n))
    time_s = draw(st.lists(st.sampled_from([0.0, 1.0, 1e9]), min_size=n, max_size=n))
    return FieldSamples.of(points, values, std, time_s=time_s)


@EVERY_MODEL
@settings(max_examples=40, deadline=None)
@given(
    samples=crowded_samples(),
    noise=st.sampled_from([1e-15, 1e-6, 0.01]),
    signal=st.sampled_from([1e-6, 1.0, 1e6]),
    memory_s=st.sampled_from([0.0, 1e-3, 100.0]),
)
def test_no_samples_of_a_robot_at_rest_break_a_map(
    model: str, samples: FieldSamples, noise: float, signal: float, memory_s: float
) -> None:
    kernel = KernelParameters(noise_variance=noise, signal_variance=signal).model_dump()
    config = config_of(
        model,
        single=kernel,
        levels=(kernel,) * 3,
        joint_levels=(kernel,) * 3,
        memory_s=memory_s,
    )
    live_map = LiveMap(config, GRID)
    live_map.append(samples[: len(samples) // 2])
    live_map.append(samples[len(samples) // 2 :])
    mean, variance = condition(config, samples).marginals(GRID.points)
    for array in (live_map.mean, live_map.std, mean, variance):
        assert np.isfinite(array).all()
    assert np.all(variance >= 0.0)
