import math

import numpy as np
import pytest
from pydantic import ValidationError

from autonomy.channel import CHANNELS
from autonomy.field.config import (
    FIELD_PRESETS,
    FieldConfig,
    GridShape,
    KernelParameters,
    LearningConfig,
)
from autonomy.field.fidelity import fidelity_level
from autonomy.field.grid import Grid
from autonomy.field.scale import from_model, to_model
from autonomy.field.score import score
from autonomy.field.synthetic import LARGEST_COUNT, measure, measurement_noise, truth
from autonomy.field.thinning import space_filling
from autonomy.site import LAKE, TANK, Box


def test_grid_reaches_every_edge_of_its_box_and_varies_depth_fastest() -> None:
    box = Box(x_min_m=-1.0, x_max_m=3.0, y_min_m=2.0, y_max_m=4.0, depth_max_m=6.0)
    grid = Grid.over(box, GridShape(x=5, y=3, z=4))
    assert grid.shape == (5, 3, 4)
    assert grid.points.shape == (60, 3)
    assert grid.points.min(axis=0).tolist() == [-1.0, 2.0, 0.0]
    assert grid.points.max(axis=0).tolist() == [3.0, 4.0, 6.0]
    assert grid.points[1].tolist() == [-1.0, 2.0, 2.0]
    mean = grid.points[:, 2].reshape(grid.shape)
    assert np.array_equal(mean[2, 1], grid.z_m)


def test_fidelity_is_better_the_better_the_position() -> None:
    levels = fidelity_level(np.array([0.0, 0.05, 0.051, 0.12, 0.13, 9.0]), (0.05, 0.12))
    assert levels.tolist() == [2, 2, 1, 1, 0, 0]


def test_without_thresholds_there_is_one_level() -> None:
    assert fidelity_level(np.array([0.0, 7.0]), ()).tolist() == [0, 0]


def test_thresholds_that_do_not_ascend_are_refused() -> None:
    with pytest.raises(ValueError, match="ascend strictly"):
        fidelity_level(0.1, (0.2, 0.2))


def test_a_calibrated_prediction_scores_wmse_1_and_coverage_90() -> None:
    rng = np.random.default_rng(0)
    factor = np.tril(rng.standard_normal((200, 200)) * 0.1) + np.eye(200)
    covariance = factor @ factor.T
    scores = [
        score(np.zeros(200), covariance, factor @ rng.standard_normal(200)) for _ in range(40)
    ]
    assert np.mean([s.wmse for s in scores]) == pytest.approx(1.0, abs=0.03)
    assert np.mean([s.coverage_90 for s in scores]) == pytest.approx(0.9, abs=0.03)


def test_inflated_variance_lowers_wmse_and_raises_coverage_but_not_nlpd() -> None:
    rng = np.random.default_rng(1)
    errors = rng.standard_normal(500)
    honest = score(np.zeros(500), np.eye(500), errors)
    inflated = score(np.zeros(500), 9.0 * np.eye(500), errors)
    assert inflated.wmse == pytest.approx(honest.wmse / 9.0, rel=1e-6)
    assert inflated.coverage_90 > 0.99
    assert inflated.nlpd > honest.nlpd
    assert inflated.rmse == honest.rmse


def test_scores_of_two_points_are_what_a_hand_computes() -> None:
    covariance = np.array([[4.0, 1.0], [1.0, 1.0]])
    scores = score(np.array([0.0, 0.0]), covariance, np.array([2.0, 3.0]))
    assert scores.rmse == pytest.approx(math.sqrt(6.5))
    assert scores.wmse == pytest.approx((2.0 * 2.0 - 2.0 * 6.0 + 4.0 * 9.0) / 3.0 / 2.0, rel=1e-6)
    nlpd = 0.5 * (1.0 + math.log(2 * math.pi * 4.0)) + 0.5 * (9.0 + math.log(2 * math.pi))
    assert scores.nlpd == pytest.approx(nlpd / 2.0, rel=1e-12)
    assert scores.coverage_90 == 0.5


def test_a_singular_covariance_is_scored_and_nothing_at_all_is_refused() -> None:
    assert math.isfinite(score(np.zeros(5), np.ones((5, 5)), np.zeros(5)).nlpd)
    with pytest.raises(ValueError, match="at least one point"):
        score(np.empty(0), np.empty((0, 0)), np.empty(0))
    with pytest.raises(ValueError, match="finite"):
        score(np.array([math.nan]), np.eye(1), np.zeros(1))


def test_log_variables_are_mapped_by_their_logarithm_and_no_count_is_too_small() -> None:
    counts = np.array([0.0, 1.0, 4095.0])
    seen = to_model("log", counts, CHANNELS["blue_light"].log_floor)
    assert seen.tolist() == [math.log(0.5), 0.0, math.log(4095.0)]
    assert from_model("log", seen)[1:] == pytest.approx(counts[1:])
    assert to_model("linear", counts, 0.5).tolist() == counts.tolist()
    assert from_model("linear", counts).tolist() == counts.tolist()


def test_tank_field_is_the_printed_formula_at_its_first_lamp() -> None:
    lamp = np.array([[0.62, 0.48, 0.50]])
    r = math.dist((0.62, 0.48, 0.50), (2.02, 0.92, 0.28))
    expected = 30.0 * math.exp(-0.6) + 60.0 / 0.22**2 + 85.0 * math.exp(-1.1 * r) / (r**2 + 0.26**2)
    assert truth("blue_light", lamp)[0] == pytest.approx(expected, rel=1e-12)


def test_lake_field_is_the_printed_formula_at_a_bloom() -> None:
    x, y, z = 140.0, 340.0, 1.0
    layer = 6.0 + 2.0 * math.sin(2 * math.pi * x / 700.0) + 0.004 * y
    patches = 0.6 + 0.4 * math.cos(2 * math.pi * (x + 0.6 * y) / 420.0)
    other = ((x - 360.0) / 50.0) ** 2 + ((y - 150.0) / 65.0) ** 2
    expected = (
        1.2
        + 6.5 * math.exp(-0.5 * ((z - layer) / 2.2) ** 2) * patches
        + (9.0 + 6.0 * math.exp(-0.5 * other)) * math.exp(-z / 3.5)
    )
    assert truth("chlorophyll", np.array([[x, y, z]]))[0] == pytest.approx(expected, rel=1e-12)
    deep = truth("chlorophyll", np.array([[x, y, 14.0], [x, y, 17.0]]))
    assert deep[1] < 0.4 * deep[0]


def test_synthetic_fields_have_the_published_ranges() -> None:
    tank = truth("blue_light", Grid.over(TANK.domain, GridShape(x=12, y=7, z=5)).points)
    lake = truth("chlorophyll", Grid.over(LAKE.water, GridShape(x=12, y=7, z=5)).points)
    assert 25.0 < tank.min() < 35.0
    assert 900.0 < tank.max() < 1300.0
    assert 0.1 < lake.min() < 0.3
    assert 8.0 < lake.max() < 11.0


@pytest.mark.parametrize("key", ["blue_light", "chlorophyll"])
def test_measurements_scatter_about_the_truth_by_the_stated_noise(key: str) -> None:
    rng = np.random.default_rng(2)
    points = (
        np.tile([[100.0, 100.0, 5.0]], (4000, 1)) if key == "chlorophyll" else np.ones((4000, 3))
    )
    config = FIELD_PRESETS[key]
    error = config.in_model_scale(measure(key, points, rng)) - config.in_model_scale(
        truth(key, points)
    )
    assert np.std(error) == pytest.approx(measurement_noise(key), rel=0.05)
    assert abs(np.mean(error)) < 0.05 * measurement_noise(key) * 2


def test_the_light_sensor_saturates() -> None:
    lamp = np.tile([[0.62, 0.48, 0.50]], (2000, 1))
    brightest = measure("blue_light", lamp, np.random.default_rng(0)).max()
    assert truth("blue_light", lamp)[0] < brightest <= LARGEST_COUNT


def test_a_variable_without_a_synthetic_field_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="temperature"):
        truth("temperature", np.zeros((1, 3)))
    with pytest.raises(ValueError, match="temperature"):
        measurement_noise("temperature")


def test_thinning_keeps_the_corners_before_the_crowd() -> None:
    rng = np.random.default_rng(3)
    crowd = rng.normal(0.5, 0.001, size=(200, 3))
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    kept = space_filling(np.concatenate([crowd, corners]), 9, (1.0, 1.0, 1.0))
    assert np.count_nonzero(kept >= 200) == 8
    assert np.all(np.diff(kept) > 0)


def test_thinning_covers_what_it_leaves_out_at_least_as_well_as_chance() -> None:
    points = np.random.default_rng(4).uniform(size=(400, 3))

    def worst_gap(kept: np.ndarray) -> float:
        distance = np.linalg.norm(points[:, None] - points[None, kept], axis=2)
        return float(distance.min(axis=1).max())

    even = worst_gap(space_filling(points, 50, (1.0, 1.0, 1.0)))
    chance = [worst_gap(np.random.default_rng(s).permutation(400)[:50]) for s in range(20)]
    assert even < min(chance)


def test_thinning_takes_each_sample_once_even_where_all_lie_together() -> None:
    kept = space_filling(np.zeros((30, 3)), 10, (1.0, 1.0, 1.0))
    assert len(set(kept.tolist())) == 10
    assert space_filling(np.zeros((3, 3)), 10, (1.0, 1.0, 1.0)).tolist() == [0, 1, 2]


def test_every_preset_maps_a_known_variable_of_its_key() -> None:
    for key, preset in FIELD_PRESETS.items():
        assert preset.variable == key
        assert key in CHANNELS


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"variable": "Salt!"}, "variable must be the key"),
        ({"fidelity_thresholds_m": (0.1,)}, "one number fewer than levels"),
        ({"fidelity_thresholds_m": (0.2, 0.1)}, "must ascend"),
        ({"fidelity_thresholds_m": (-0.2, 0.1)}, "must be positive"),
        ({"levels": ()}, "at least 1 item"),
        ({"single": {"signal_variance": 0.0}}, "greater than 0"),
        ({"grid": {"x": 1}}, "greater than or equal to 2"),
        ({"speed": 1}, "Extra inputs"),
        ({"joint_levels": ({},)}, "as many kernels as levels"),
        ({"rho": (0.5,)}, "rho needs one factor fewer than levels, or none"),
        ({"rho": (0.5, 11.0)}, "less than or equal to 10"),
        ({"model": "position_noise", "single": {"shape": "matern12"}}, "smoother than matern12"),
        ({"model": "best"}, "Input should be"),
        ({"memory_s": -1.0}, "greater than or equal to 0"),
        ({"learning": {"starts": 0}}, "greater than or equal to 1"),
    ],
)
def test_a_config_that_cannot_be_used_is_refused_with_a_reason(
    change: dict[str, object], message: str
) -> None:
    with pytest.raises(ValidationError, match=message):
        FieldConfig.model_validate(change)


def test_a_document_from_before_the_joint_model_gives_it_the_levels_that_it_has() -> None:
    one = KernelParameters(signal_variance=7.0)
    old = {"levels": [one.model_dump(exclude={"shape"})], "fidelity_thresholds_m": []}
    config = FieldConfig.model_validate(old)
    assert config.joint_levels == config.levels == (one,)
    assert FieldConfig.model_validate(config.model_dump(mode="json")) == config


def test_the_scale_is_that_of_the_variable_unless_a_map_says_otherwise() -> None:
    assert FieldConfig(variable="blue_light").resolved_scale() == "log"
    assert FieldConfig(variable="chlorophyll").resolved_scale() == "linear"
    assert FieldConfig(variable="chlorophyll", scale="log").resolved_scale() == "log"


def test_a_mission_may_bring_its_own_thresholds() -> None:
    preset = FIELD_PRESETS["blue_light"]
    assert preset.with_thresholds((0.1, 0.2)).fidelity_thresholds_m == (0.1, 0.2)
    with pytest.raises(ValidationError, match="fewer than levels"):
        preset.with_thresholds((0.1,))


def test_every_setting_tells_a_form_its_title_and_help() -> None:
    for model in (FieldConfig, KernelParameters, GridShape, LearningConfig):
        for name, field in model.model_json_schema()["properties"].items():
            assert field.get("title"), name
            assert field.get("description"), name
