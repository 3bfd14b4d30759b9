"""What a what-if run is refused for before it begins: words, and the field that is to blame."""

import pytest

from autonomy.control.catalogue import CONTROLLERS
from autonomy.vehicle.config import MINIGLIDER
from autonomy.whatif.config import ControllerChoice, TrialConfig
from server.study.task import WhatIfProblem
from server.study.whatif_task import check


def refusal(scenario, **settings):
    controllers = []
    for key in ("controller.pid", "controller.governor"):
        preset = CONTROLLERS[key].preset("miniglider")
        known = {name: value for name, value in settings.items() if hasattr(preset, name)}
        controllers.append(ControllerChoice(key, key, preset.model_copy(update=known)))
    problem = WhatIfProblem(MINIGLIDER, TrialConfig.model_validate(scenario), tuple(controllers))
    return check(problem, lambda _news: None, lambda: False)


def test_a_scenario_within_every_limit_is_not_refused():
    assert refusal({"runs": 10}) is None


@pytest.mark.parametrize(
    ("scenario", "settings", "loc", "words"),
    [
        (
            {"reference": "diagonal", "duration_s": 36_000.0, "step_s": 0.09, "runs": 200},
            {},
            ("scenario", "runs"),
            "200 runs of 2 controllers over 36000 s are 1.6e8 steps of the model; at most 1e8",
        ),
        (
            {"step_s": 0.005, "duration_s": 50.0},
            {"mass_delay_s": 2.0},
            ("controllers", 1, "config", "mass_delay_s"),
            "A delay of 2 s is 400 control periods of 0.005 s",
        ),
        (
            {"reference": "straight_glide", "straight": {"vertical_speed_m_s": 0.2}},
            {},
            ("scenario", "reference"),
            "buoyancy allows at most",
        ),
    ],
)
def test_a_refusal_names_the_limit_and_the_field(scenario, settings, loc, words):
    found = refusal(scenario, **settings)
    assert found.loc == loc
    assert words in found.message
    assert found.message[0] == found.message[0].upper()
    assert found.message.endswith(".")
