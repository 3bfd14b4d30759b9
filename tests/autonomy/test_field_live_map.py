import dataclasses
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autonomy.arrays import FloatArray
from autonomy.field.config import FIELD_PRESETS, FieldConfig, GridShape, KernelParameters
from autonomy.field.grid import Grid
from autonomy.field.live import live_map as live_map_module
from autonomy.field.live.growing_factor import GrowingFactor, Growth, WhitenedColumns
from autonomy.field.live.live_map import LiveMap
from autonomy.field.model.model import condition
from autonomy.field.samples import FieldSamples
from autonomy.field.synthetic import measure, truth
from autonomy.site import TANK

GRID = Grid.over(TANK.domain, GridShape(x=6, y=5, z=4))
MODELS = ("single", "recursive", "joint", "position_noise")
EVERY_MODEL = pytest.mark.parametrize("model", MODELS)


def tank_config(model: str, **changes: object) -> FieldConfig:
    preset = FIELD_PRESETS["blue_light"].model_dump()
    return FieldConfig.model_validate(preset | {"model": model} | changes)


def tank_samples(n: int, seed: int = 0) -> FieldSamples:
    """Draw samples of dives of 23, whose positions get worse as a dive goes on."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(n, 3))
    std = 0.01 + 0.008 * (np.arange(n) % 23)
    return FieldSamples.of(
        points, measure("blue_light", points, rng), std, time_s=10.0 * np.arange(n)
    )


def tank_map(model: str, samples: FieldSamples | None = None, **changes: object) -> LiveMap:
    live_map = LiveMap(tank_config(model, **changes), GRID)
    if samples is not None:
        live_map.append(samples)
    return live_map


def assert_equals_conditioning_anew(live_map: LiveMap, tolerance: float = 1e-9) -> None:
    mean, variance = live_map.conditioned().marginals(GRID.points)
    assert live_map.mean == pytest.approx(mean, abs=tolerance)
    assert live_map.std**2 == pytest.approx(variance, abs=tolerance)


@EVERY_MODEL
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"rho": (0.8, -1.3)},
        {"memory_s": 600.0},
        {"slope_north_per_m": 0.3, "slope_depth_per_m": -1.0, "scale": "linear"},
    ],
)
def test_samples_one_by_one_give_the_map_that_conditioning_anew_gives(
    model: str, changes: dict[str, object]
) -> None:
    samples = tank_samples(200)
    live_map = tank_map(model, **changes)
    for i in range(200):
        live_map.append(samples[i : i + 1])
    assert sum(live_map.samples_per_level) == 200
    assert np.array_equal(live_map.samples.points, samples.points)
    assert_equals_conditioning_anew(live_map)


@EVERY_MODEL
@settings(max_examples=12, deadline=None)
@given(sizes=st.lists(st.integers(0, 40), min_size=1, max_size=8), seed=st.integers(0, 1000))
def test_samples_in_any_batches_give_the_map_that_conditioning_anew_gives(
    model: str, sizes: list[int], seed: int
) -> None:
    samples = tank_samples(sum(sizes), seed)
    live_map = tank_map(model)
    first = 0
    for size in sizes:
        live_map.append(samples[first : first + size])
        first += size
    assert_equals_conditioning_anew(live_map)


@EVERY_MODEL
def test_many_samples_in_many_batches_give_the_map_that_conditioning_anew_gives(
    model: str,
) -> None:
    samples = tank_samples(700)
    live_map = tank_map(model)
    for first in range(0, 700, 70):
        live_map.append(samples[first : first + 70])
    assert_equals_conditioning_anew(live_map)


@EVERY_MODEL
@pytest.mark.parametrize("memory_s", [0.0, 300.0])
def test_a_rebuilt_map_is_the_reference_model(model: str, memory_s: float) -> None:
    samples = tank_samples(300)
    live_map = tank_map(model, samples[:120], memory_s=memory_s)
    live_map.append(samples[120:])
    live_map.replace(live_map.samples)
    mean, variance = condition(live_map.config, samples).marginals(GRID.points)
    assert live_map.mean == pytest.approx(mean, abs=1e-9)
    assert live_map.std**2 == pytest.approx(variance, abs=1e-9)


@EVERY_MODEL
def test_smoothed_samples_that_replace_others_make_the_map_of_their_own(model: str) -> None:
    samples = tank_samples(150)
    live_map = tank_map(model, samples)
    smoothed = FieldSamples.of(
        samples.points + np.array([0.03, -0.02, 0.0]),
        samples.values,
        0.4 * samples.position_std_m,
        filtered_std_m=samples.filtered_std_m,
        time_s=samples.time_s,
    )
    live_map.replace(smoothed)
    assert np.array_equal(live_map.mean, tank_map(model, smoothed).mean)
    assert live_map.samples_per_level[2] > tank_map(model, samples).samples_per_level[2]


@pytest.mark.parametrize("model", ["single", "recursive", "joint"])
def test_the_order_of_samples_does_not_matter(model: str) -> None:
    samples = tank_samples(120)
    forward, backward = tank_map(model, samples), tank_map(model, samples[::-1])
    assert forward.mean == pytest.approx(backward.mean, abs=1e-9)
    assert forward.std == pytest.approx(backward.std, abs=1e-9)


@EVERY_MODEL
def test_a_new_sample_never_makes_the_map_less_certain(model: str) -> None:
    samples = tank_samples(60)
    live_map = tank_map(model)
    before = live_map.std
    for i in range(60):
        live_map.append(samples[i : i + 1])
        after = live_map.std
        assert np.all(after <= before + 1e-12)
        before = after


@pytest.mark.parametrize("model", MODELS)
def test_a_field_that_changes_is_forgotten_in_time(model: str) -> None:
    samples = tank_samples(40)
    live_map = tank_map(model, samples, memory_s=100.0)
    later = FieldSamples.of([[0.0, 0.0, 0.0]], [200.0], [0.01], time_s=[1e6], after=samples)
    live_map.append(later)
    alone = tank_map(model, later, memory_s=100.0)
    assert live_map.mean == pytest.approx(alone.mean, abs=1e-9)
    assert live_map.std == pytest.approx(alone.std, abs=1e-9)
    assert_equals_conditioning_anew(live_map)


def test_what_fades_are_the_rows_that_samples_filled() -> None:
    columns = WhitenedColumns(3)
    columns.append(Growth(np.empty((0, 1)), np.ones((1, 1)), np.ones(1)), np.full((1, 3), 2.0))
    columns._panels[0][1:] = np.inf
    columns.scale(0.0)
    assert columns.mean.tolist() == columns.reduction.tolist() == [0.0] * 3


def test_a_sample_that_comes_late_is_as_old_as_it_is() -> None:
    samples = tank_samples(90)
    order = np.random.default_rng(0).permutation(90)
    for model in MODELS[:3]:
        live_map = tank_map(model, memory_s=200.0)
        for i in order:
            live_map.append(samples[i : i + 1])
        mean, variance = condition(live_map.config, samples).marginals(GRID.points)
        assert live_map.mean == pytest.approx(mean, abs=1e-9)
        assert live_map.std**2 == pytest.approx(variance, abs=1e-9)


@EVERY_MODEL
def test_without_samples_the_map_is_the_prior(model: str) -> None:
    live_map = tank_map(model, FieldSamples.none(), slope_east_per_m=2.0)
    config = live_map.config
    prior = {"recursive": config.levels, "joint": config.joint_levels}
    kernels = prior.get(model, (config.single,))
    expected = np.sqrt(sum(kernel.signal_variance for kernel in kernels))
    assert live_map.mean == pytest.approx(config.prior_mean + 2.0 * GRID.points[:, 1])
    assert live_map.std == pytest.approx(expected, rel=1e-12)
    assert live_map.samples_per_level == (0, 0, 0)


@EVERY_MODEL
def test_one_sample_makes_a_map(model: str) -> None:
    live_map = tank_map(model, FieldSamples.of([[1.0, 0.5, 0.2]], [100.0], [0.01]))
    assert live_map.samples_per_level == (0, 0, 1)
    assert_equals_conditioning_anew(live_map)


@EVERY_MODEL
@pytest.mark.parametrize("shape", ["matern32", "matern52", "squared_exponential"])
def test_a_hundred_samples_at_one_place_with_hardly_any_noise_make_a_map(
    model: str, shape: str
) -> None:
    exact = KernelParameters.model_validate({"noise_variance": 1e-14, "shape": shape}).model_dump()
    live_map = tank_map(model, single=exact, levels=(exact,) * 3, joint_levels=(exact,) * 3)
    point = np.array([[1.0, 0.5, 0.2]])
    for i in range(100):
        live_map.append(FieldSamples.of(point, [100.0], [0.08 * (i % 3)], dive=[i]))
    nearest = np.argmin(np.linalg.norm(GRID.points - point, axis=1))
    assert np.isfinite(live_map.mean).all()
    assert np.isfinite(live_map.std).all()
    assert live_map.mean[nearest] == pytest.approx(np.log(100.0), abs=0.5)


@EVERY_MODEL
def test_constant_values_map_to_that_constant(model: str) -> None:
    samples = tank_samples(150)
    constant = FieldSamples.of(samples.points, np.full(150, 50.0), samples.position_std_m)
    inside = tank_map(model, constant).predict(samples.points).mean
    assert inside == pytest.approx(np.log(50.0), abs=0.35)


def test_a_batch_that_is_refused_leaves_the_map_as_it_was() -> None:
    samples = tank_samples(10)
    live_map = tank_map("recursive", samples)
    before = live_map.mean
    bad = samples.values.copy()
    bad[4] = np.nan
    broken = dataclasses.replace(samples, values=bad)
    for change in (live_map.append, live_map.replace):
        with pytest.raises(ValueError, match="values of sample 4 is not finite"):
            change(broken)
    assert np.array_equal(live_map.mean, before)
    assert sum(live_map.samples_per_level) == 10


def test_samples_that_the_model_cannot_hold_leave_the_map_as_it_was(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    samples = tank_samples(300)
    live_map = tank_map("single", samples[:20])
    before = live_map.mean
    growth = GrowingFactor.append

    def append_until_full(factor: GrowingFactor, B: FloatArray, L: FloatArray) -> None:
        if len(factor) > 100:
            raise ValueError("the matrix to factorize is not a covariance matrix")
        growth(factor, B, L)

    monkeypatch.setattr(GrowingFactor, "append", append_until_full)
    for change in (live_map.append, live_map.replace):
        with pytest.raises(ValueError, match="not a covariance"):
            change(samples[20:])
        assert live_map.mean == pytest.approx(before, abs=1e-12)
        assert sum(live_map.samples_per_level) == 20


def test_a_kernel_without_a_slope_is_refused_by_position_noise_with_a_sentence() -> None:
    rough = KernelParameters(shape="matern12")
    with pytest.raises(ValueError, match=r"single\.shape must be smoother"):
        tank_config("position_noise", single=rough.model_dump())


@EVERY_MODEL
def test_samples_are_counted_by_fidelity_in_every_model(model: str) -> None:
    points = tank_samples(6).points
    std = np.array([0.2, 0.12, 0.06, 0.05, 0.01, 0.0])
    samples = FieldSamples.of(points, np.full(6, 100.0), std)
    live_map = tank_map(model, samples, fidelity_thresholds_m=(0.05, 0.12))
    assert live_map.samples_per_level == (1, 2, 3)
    assert live_map.sample_levels.tolist() == [0, 1, 1, 2, 2, 2]


@EVERY_MODEL
def test_prediction_on_the_grid_is_the_map(model: str) -> None:
    samples = tank_samples(80)
    live_map = tank_map(model, samples[:50])
    live_map.append(samples[50:])
    prediction = live_map.predict(GRID.points)
    assert prediction.mean == pytest.approx(live_map.mean, abs=1e-9)
    assert np.sqrt(np.diagonal(prediction.covariance)) == pytest.approx(live_map.std, abs=1e-9)


@EVERY_MODEL
def test_a_full_map_keeps_an_even_part_of_its_samples_and_goes_on(model: str) -> None:
    samples = tank_samples(260)
    live_map = tank_map(model, max_samples=100)
    for first in range(0, 260, 20):
        live_map.append(samples[first : first + 20])
        assert sum(live_map.samples_per_level) <= 100
    assert sum(live_map.samples_per_level) + live_map.samples_dropped == 260
    assert_equals_conditioning_anew(live_map)


def test_a_batch_larger_than_the_map_is_thinned_at_once() -> None:
    live_map = tank_map("single", tank_samples(500), max_samples=100)
    assert sum(live_map.samples_per_level) == 75
    assert live_map.samples_dropped == 425


def test_a_very_large_grid_holds_fewer_samples_so_that_memory_is_bounded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(live_map_module, "_MOST_NUMBERS", 80 * len(GRID.points))
    live_map = tank_map("single", tank_samples(70))
    assert live_map.samples_dropped == 0
    live_map.append(tank_samples(30, seed=1))
    assert sum(live_map.samples_per_level) == 60
    assert live_map.samples_dropped == 40
    assert_equals_conditioning_anew(live_map)


@EVERY_MODEL
def test_a_map_that_sums_its_samples_up_keeps_them_all_and_is_nearly_the_exact_one(
    model: str,
) -> None:
    samples = tank_samples(260)
    live_map = tank_map(model, max_samples=100, beyond="inducing", inducing_points=200)
    for first in range(0, 260, 20):
        live_map.append(samples[first : first + 20])
    assert sum(live_map.samples_per_level) == 260
    assert live_map.samples_dropped == 0
    assert 100 < live_map.inducing_points <= 200
    assert tank_map(model, samples[:90], beyond="inducing").inducing_points == 0
    exact = "joint" if model == "recursive" else model
    levels = live_map.config.levels if model == "recursive" else live_map.config.joint_levels
    near = tank_map(exact, samples, max_samples=1000, joint_levels=levels)
    assert np.sqrt(np.mean((live_map.mean - near.mean) ** 2)) < 0.3 * near.std.mean()
    assert live_map.std.mean() == pytest.approx(near.std.mean(), rel=0.25)
    prediction = live_map.predict(GRID.points)
    assert prediction.mean == pytest.approx(live_map.mean, abs=1e-9)
    assert np.sqrt(np.diagonal(prediction.covariance)) == pytest.approx(live_map.std, abs=1e-7)
    assert np.isfinite(live_map.conditioned().log_marginal_likelihood())


def test_a_map_that_sums_up_chooses_its_points_anew_where_samples_go_elsewhere() -> None:
    samples = tank_samples(200)
    west = np.flatnonzero(samples.points[:, 1] < 0.7)
    east = np.setdiff1d(np.arange(200), west)
    options = {"max_samples": 50, "beyond": "inducing", "inducing_points": 40}
    live_map = tank_map("single", samples[west], **options)
    before = live_map.std
    for i in east:
        live_map.append(samples[i : i + 1])
    far = GRID.points[:, 1] > 1.0
    assert live_map.std[far].mean() < 0.5 * before[far].mean()


def test_models_that_know_how_samples_are_located_state_their_uncertainty_better() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(300, 3))
    std = rng.uniform(0.0, 0.25, 300)
    believed = points + np.column_stack(
        [std[:, None] * rng.standard_normal((300, 2)), np.zeros(300)]
    )
    values = measure("blue_light", points, rng)
    samples = FieldSamples.of(believed, values, std, dive=np.arange(300))
    far_off: dict[str, float] = {}
    for model in MODELS:
        live_map = tank_map(model, samples)
        from_truth = live_map.mean - np.log(truth("blue_light", GRID.points))
        far_off[model] = float(np.mean((from_truth / live_map.std) ** 2))
    assert far_off["single"] > 3.0
    assert all(far_off[model] < 2.5 for model in MODELS[1:])


@EVERY_MODEL
def test_memory_that_a_map_tells_is_what_its_factors_take(model):
    samples = tank_samples(400)
    tank_map(model, samples)  # what is compiled and cached is no part of a map
    tracemalloc.start()
    try:
        live_map = tank_map(model, samples)
        taken = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert 0.5 * taken < live_map.memory_bytes <= taken
