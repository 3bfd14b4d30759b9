import numpy as np
import pytest

from autonomy.field.config import FIELD_PRESETS, FieldConfig, LearningConfig
from autonomy.field.learning.model import MOST_SAMPLES, learn_config
from autonomy.field.model.model import condition
from autonomy.field.samples import FieldSamples
from tests.autonomy.manual_survey import (
    PRESET_ESTIMATOR,
    PRESET_MOTION,
    PRESET_SITE,
    simulate_survey,
)

MODELS = ("single", "recursive", "joint", "position_noise")


def surveyed(count: int, seed: int) -> FieldSamples:
    survey = simulate_survey(
        "blue_light",
        PRESET_SITE["blue_light"].domain,
        PRESET_MOTION["blue_light"],
        PRESET_ESTIMATOR["blue_light"],
        count,
        np.random.default_rng(seed),
    )
    return FieldSamples.of(survey.points, survey.values, survey.position_std)


def settings(model: str, **learning: object) -> FieldConfig:
    preset = FIELD_PRESETS["blue_light"]
    return FieldConfig.model_validate(
        preset.model_dump() | {"model": model, "learning": LearningConfig(**learning)}  # type: ignore[arg-type]
    )


SAMPLES = surveyed(250, seed=1)


@pytest.mark.parametrize("model", MODELS)
def test_each_model_learns_its_own_kernels_and_becomes_more_likely(model: str) -> None:
    config = settings(model)
    learned = learn_config(config, SAMPLES, starts=2, rng=np.random.default_rng(0))
    assert learned.is_changed
    assert learned.before_nll is not None
    assert learned.after_nll is not None
    assert learned.after_nll < learned.before_nll
    as_learned = learned.config.model_copy(update={"adapts": False})
    likelihood = condition(as_learned, SAMPLES).log_marginal_likelihood()
    assert learned.after_nll == pytest.approx(-likelihood)
    used = {"recursive": "levels", "joint": "joint_levels"}.get(model, "single")
    for name in ("single", "levels", "joint_levels"):
        is_same = getattr(learned.config, name) == getattr(config, name)
        assert is_same == (name != used)
    assert f"{learned.after_nll:.1f}" in learned.message


@pytest.mark.parametrize("model", MODELS)
def test_the_mean_is_learned_where_asked(model: str) -> None:
    far_off = settings(model, mean="constant").model_copy(update={"prior_mean": 300.0})
    learned = learn_config(far_off, SAMPLES, starts=1, rng=np.random.default_rng(0))
    assert np.log(20.0) < learned.config.prior_mean < np.log(2000.0)
    sloped = learn_config(
        settings(model, mean="linear"), SAMPLES, starts=1, rng=np.random.default_rng(0)
    )
    assert sloped.config.slope_depth_per_m != 0.0
    fixed = learn_config(settings(model), SAMPLES, starts=1, rng=np.random.default_rng(0))
    assert fixed.config.prior_mean == settings(model).prior_mean


def test_the_same_seed_learns_the_same() -> None:
    first, again = (
        learn_config(settings("single"), SAMPLES, rng=np.random.default_rng(3)) for _ in range(2)
    )
    assert first == again


def test_a_level_with_few_samples_keeps_its_kernel_and_says_so() -> None:
    for model, name in (("recursive", "levels"), ("joint", "joint_levels")):
        config = settings(model).with_thresholds((0.05, 9.0))  # nothing is located that badly
        learned = learn_config(config, SAMPLES, starts=2, rng=np.random.default_rng(0))
        assert getattr(learned.config, name)[0] == getattr(config, name)[0]
        assert getattr(learned.config, name)[1] != getattr(config, name)[1]
        assert learned.kernels[0] == "level 0: 0 samples are too few, its kernel stays"


def test_the_scale_between_levels_is_learned_where_the_settings_say_so() -> None:
    for learns_rho in (False, True):
        learned = learn_config(
            settings("joint", learns_rho=learns_rho),
            SAMPLES,
            starts=1,
            rng=np.random.default_rng(0),
        )
        assert len(learned.config.rho) == (2 if learns_rho else 0)
        assert any("scale between levels" in fact for fact in learned.kernels) == learns_rho


def test_the_recursive_model_is_learned_with_the_scale_between_its_levels() -> None:
    config = settings("recursive").model_copy(update={"rho": (0.5, 2.0)})
    learned = learn_config(config, SAMPLES, starts=1, rng=np.random.default_rng(0))
    plain = learn_config(settings("recursive"), SAMPLES, starts=1, rng=np.random.default_rng(0))
    assert learned.config.rho == (0.5, 2.0)
    assert learned.config.levels[0] == plain.config.levels[0]
    assert learned.config.levels[2] != plain.config.levels[2]


def test_learned_noise_stays_above_its_share_of_the_variance() -> None:
    exact = FieldSamples.of(SAMPLES.points, np.exp(SAMPLES.points.sum(axis=1)), np.zeros(250))
    learned = learn_config(
        settings("single", noise_floor_share=0.02), exact, starts=2, rng=np.random.default_rng(0)
    )
    floor = 0.02 * np.var(SAMPLES.points.sum(axis=1))
    assert learned.config.single.noise_variance == pytest.approx(floor, rel=1e-6)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    ("points", "values", "sentence"),
    [
        (np.zeros((1, 3)), np.ones(1), "at least two samples"),
        (np.random.default_rng(0).uniform(size=(30, 3)), np.full(30, 7.0), "same value"),
        (np.ones((30, 3)), np.arange(1.0, 31.0), "one place"),
    ],
)
def test_samples_that_tell_nothing_leave_the_kernels_and_say_why(
    model: str, points: np.ndarray, values: np.ndarray, sentence: str
) -> None:
    samples = FieldSamples.of(points, values, np.zeros(len(values)))
    learned = learn_config(settings(model), samples, rng=np.random.default_rng(0))
    assert learned.config == settings(model)
    assert not learned.is_changed
    assert sentence in learned.message


@pytest.mark.parametrize("model", MODELS)
def test_samples_taken_twice_at_one_place_are_learned_from(model: str) -> None:
    some = SAMPLES[:60]
    twice = FieldSamples.of(
        np.vstack([some.points, some.points]),
        np.concatenate([some.values, some.values]),
        np.concatenate([some.position_std_m, some.position_std_m]),
        dive=np.concatenate([some.dive, some.dive]),
    )
    learned = learn_config(settings(model), twice, starts=2, rng=np.random.default_rng(0))
    assert learned.message
    assert np.isfinite(condition(learned.config, twice).log_marginal_likelihood())


@pytest.mark.parametrize("model", MODELS)
def test_a_cancelled_search_keeps_the_kernels_and_works_no_further(model: str) -> None:
    asked = iter(range(10_000))
    config, reports = settings(model), []
    learned = learn_config(
        config,
        SAMPLES,
        rng=np.random.default_rng(0),
        report=lambda share, message: reports.append((share, message)),
        is_cancelled=lambda: next(asked) >= 5,
    )
    assert learned.config == config
    assert not learned.is_changed
    assert learned.before_nll is None
    assert "called off" in learned.message
    assert len(reports) <= 5
    assert next(asked) <= 8


def test_learning_reports_a_share_that_only_rises() -> None:
    told: list[tuple[float, str]] = []
    learn_config(
        settings("recursive"),
        SAMPLES,
        rng=np.random.default_rng(0),
        report=lambda share, message: told.append((share, message)),
    )
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert 0.0 < shares[0] < shares[-1] <= 1.0


def test_a_field_that_changes_is_learned_as_one() -> None:
    times = 100.0 * np.arange(250)
    samples = FieldSamples.of(SAMPLES.points, SAMPLES.values, SAMPLES.position_std_m, time_s=times)
    for model in MODELS:
        config = settings(model).model_copy(update={"memory_s": 20_000.0})
        learned = learn_config(config, samples, starts=1, rng=np.random.default_rng(0))
        assert learned.is_changed
        assert learned.config.memory_s == 20_000.0


def test_more_samples_than_can_be_learned_from_are_thinned() -> None:
    count = MOST_SAMPLES + 100
    rng = np.random.default_rng(0)
    points = rng.uniform(size=(count, 3))
    values = np.exp(5.0 + 0.3 * rng.standard_normal(count))
    learned = learn_config(
        settings("single"),
        FieldSamples.of(points, values, np.zeros(count)),
        starts=1,
        rng=rng,
    )
    assert f"{MOST_SAMPLES} samples" in learned.kernels[0]
