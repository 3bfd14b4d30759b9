import numpy as np
import pytest

from autonomy.field.config import FIELD_PRESETS
from tests.autonomy.manual_survey import (
    PRESET_ESTIMATOR,
    PRESET_MOTION,
    PRESET_SITE,
    derived_preset,
    learned_config,
    simulate_survey,
)


@pytest.mark.parametrize("key", ["blue_light", "chlorophyll"])
def test_presets_are_what_the_simulated_manual_survey_yields(key: str) -> None:
    derived = derived_preset(key, np.random.default_rng(0))
    preset = FIELD_PRESETS[key]
    assert derived.prior_mean == pytest.approx(preset.prior_mean, rel=0.01)
    learned = (derived.single, *derived.levels, *derived.joint_levels)
    stored = (preset.single, *preset.levels, *preset.joint_levels)
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
