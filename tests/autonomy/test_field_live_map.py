import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autonomy.arrays import FloatArray
from autonomy.field.config import FIELD_PRESETS, FieldConfig, GridShape, KernelParameters
from autonomy.field.grid import Grid
from autonomy.field.live_map import LiveMap
from autonomy.field.recursive import RecursiveGaussianProcess
from autonomy.field.synthetic import measure, truth
from autonomy.site import TANK

GRID = Grid.over(TANK.domain, GridShape(x=6, y=5, z=4))
BOTH_MODELS = pytest.mark.parametrize("model", ["single", "recursive"])


def tank_config(model: str, **changes: object) -> FieldConfig:
    preset = FIELD_PRESETS["blue_light"].model_dump()
    return FieldConfig.model_validate(preset | {"model": model} | changes)


def tank_samples(n: int, seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(n, 3))
    return points, measure("blue_light", points, rng), rng.uniform(0.0, 0.2, n)


def refit(live_map: LiveMap) -> tuple[FloatArray, FloatArray]:
    config = live_map.config
    single = config.model == "single"
    model = RecursiveGaussianProcess(
        (config.single,) if single else config.levels,
        live_map.points,
        live_map.values - config.prior_mean,
        live_map.sample_levels * (not single),
    )
    return config.prior_mean + model.mean(GRID.points), model.variance(GRID.points)


def assert_equals_a_refit(live_map: LiveMap, tolerance: float = 1e-10) -> None:
    mean, variance = refit(live_map)
    assert live_map.mean == pytest.approx(mean, abs=tolerance)
    assert live_map.std**2 == pytest.approx(variance, abs=tolerance)


@BOTH_MODELS
def test_samples_one_by_one_give_the_map_that_a_refit_gives(model: str) -> None:
    points, values, std = tank_samples(400)
    live_map = LiveMap(tank_config(model), GRID)
    for i in range(400):
        live_map.append(points[i : i + 1], values[i : i + 1], std[i : i + 1])
    assert sum(live_map.samples_per_level) == 400
    assert_equals_a_refit(live_map)


@BOTH_MODELS
@settings(max_examples=20, deadline=None)
@given(sizes=st.lists(st.integers(0, 40), min_size=1, max_size=8), seed=st.integers(0, 1000))
def test_samples_in_any_batches_give_the_map_that_a_refit_gives(
    model: str, sizes: list[int], seed: int
) -> None:
    points, values, std = tank_samples(sum(sizes), seed)
    live_map = LiveMap(tank_config(model), GRID)
    first = 0
    for size in sizes:
        batch = slice(first, first + size)
        live_map.append(points[batch], values[batch], std[batch])
        first += size
    assert_equals_a_refit(live_map)


@BOTH_MODELS
def test_the_order_of_samples_does_not_matter(model: str) -> None:
    points, values, std = tank_samples(120)
    forward, backward = LiveMap(tank_config(model), GRID), LiveMap(tank_config(model), GRID)
    forward.append(points, values, std)
    backward.append(points[::-1], values[::-1], std[::-1])
    assert forward.mean == pytest.approx(backward.mean, abs=1e-10)
    assert forward.std == pytest.approx(backward.std, abs=1e-10)


@BOTH_MODELS
def test_a_new_sample_never_makes_the_map_less_certain(model: str) -> None:
    points, values, std = tank_samples(60)
    live_map = LiveMap(tank_config(model), GRID)
    before = live_map.std
    for i in range(60):
        live_map.append(points[i : i + 1], values[i : i + 1], std[i : i + 1])
        after = live_map.std
        assert np.all(after <= before + 1e-12)
        before = after


@BOTH_MODELS
def test_without_samples_the_map_is_the_prior(model: str) -> None:
    config = tank_config(model)
    live_map = LiveMap(config, GRID)
    live_map.append(np.empty((0, 3)), np.empty(0), np.empty(0))
    prior = [config.single] if model == "single" else list(config.levels)
    expected = np.sqrt(sum(kernel.signal_variance for kernel in prior))
    assert np.all(live_map.mean == config.prior_mean)
    assert live_map.std == pytest.approx(expected, rel=1e-12)
    assert live_map.samples_per_level == (0, 0, 0)


@BOTH_MODELS
def test_one_sample_makes_a_map(model: str) -> None:
    live_map = LiveMap(tank_config(model), GRID)
    live_map.append(np.array([[1.0, 0.5, 0.2]]), np.array([100.0]), np.array([0.01]))
    assert live_map.samples_per_level == (0, 0, 1)
    assert_equals_a_refit(live_map)


@BOTH_MODELS
def test_a_hundred_samples_at_one_place_with_hardly_any_noise_make_a_map(model: str) -> None:
    exact = KernelParameters(noise_variance=1e-14).model_dump()
    config = tank_config(model, single=exact, levels=(exact, exact, exact))
    live_map = LiveMap(config, GRID)
    point = np.array([[1.0, 0.5, 0.2]])
    for i in range(100):
        live_map.append(point, np.array([100.0]), np.array([0.08 * (i % 3)]))
    nearest = np.argmin(np.linalg.norm(GRID.points - point, axis=1))
    assert np.isfinite(live_map.mean).all()
    assert live_map.mean[nearest] == pytest.approx(np.log(100.0), abs=0.5)


@BOTH_MODELS
def test_constant_values_map_to_that_constant(model: str) -> None:
    points, _, std = tank_samples(150)
    live_map = LiveMap(tank_config(model), GRID)
    live_map.append(points, np.full(150, 50.0), std)
    inside = live_map.predict(points).mean
    assert inside == pytest.approx(np.log(50.0), abs=0.35)


@pytest.mark.parametrize("broken", ["points", "values", "position_std"])
def test_a_number_that_is_not_finite_is_refused_and_leaves_the_map_as_it_was(broken: str) -> None:
    points, values, std = tank_samples(10)
    live_map = LiveMap(tank_config("recursive"), GRID)
    live_map.append(points, values, std)
    before = live_map.mean
    bad = {"points": points.copy(), "values": values.copy(), "position_std": std.copy()}
    bad[broken][4] = np.nan
    with pytest.raises(ValueError, match=f"{broken} of sample 4 is not finite"):
        live_map.append(**bad)
    assert np.array_equal(live_map.mean, before)
    assert sum(live_map.samples_per_level) == 10


def test_samples_whose_shapes_disagree_are_refused() -> None:
    live_map = LiveMap(tank_config("single"), GRID)
    with pytest.raises(ValueError, match="samples need points"):
        live_map.append(np.zeros((2, 3)), np.ones(3), np.zeros(2))
    with pytest.raises(ValueError, match="must not be negative"):
        live_map.append(np.zeros((1, 3)), np.ones(1), np.array([-0.1]))


@BOTH_MODELS
def test_samples_are_counted_by_fidelity_in_both_models(model: str) -> None:
    live_map = LiveMap(tank_config(model, fidelity_thresholds_m=(0.05, 0.12)), GRID)
    points, values, _ = tank_samples(6)
    live_map.append(points, values, np.array([0.2, 0.12, 0.06, 0.05, 0.01, 0.0]))
    assert live_map.samples_per_level == (1, 2, 3)


def test_prediction_on_the_grid_is_the_map() -> None:
    points, values, std = tank_samples(80)
    live_map = LiveMap(tank_config("recursive"), GRID)
    live_map.append(points, values, std)
    prediction = live_map.predict(GRID.points)
    assert prediction.mean == pytest.approx(live_map.mean, abs=1e-10)
    assert np.sqrt(np.diagonal(prediction.covariance)) == pytest.approx(live_map.std, abs=1e-9)


@BOTH_MODELS
def test_a_full_map_keeps_an_even_part_of_its_samples_and_goes_on(model: str) -> None:
    points, values, std = tank_samples(260)
    live_map = LiveMap(tank_config(model, max_samples=100), GRID)
    for first in range(0, 260, 20):
        batch = slice(first, first + 20)
        live_map.append(points[batch], values[batch], std[batch])
        assert sum(live_map.samples_per_level) <= 100
    assert sum(live_map.samples_per_level) + live_map.samples_dropped == 260
    assert_equals_a_refit(live_map)


def test_a_batch_larger_than_the_map_is_thinned_at_once() -> None:
    points, values, std = tank_samples(500)
    live_map = LiveMap(tank_config("single", max_samples=100), GRID)
    live_map.append(points, values, std)
    assert sum(live_map.samples_per_level) == 75
    assert live_map.samples_dropped == 425


def test_multi_fidelity_states_its_uncertainty_better_than_a_single_model() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(300, 3))
    std = rng.uniform(0.0, 0.25, 300)
    believed = points + np.column_stack(
        [std[:, None] * rng.standard_normal((300, 2)), np.zeros(300)]
    )
    values = measure("blue_light", points, rng)
    far_off: dict[str, float] = {}
    for model in ("single", "recursive"):
        live_map = LiveMap(tank_config(model), GRID)
        live_map.append(believed, values, std)
        from_truth = live_map.mean - np.log(truth("blue_light", GRID.points))
        far_off[model] = float(np.mean((from_truth / live_map.std) ** 2))
    assert far_off["single"] > 3.0
    assert far_off["recursive"] < 1.5
