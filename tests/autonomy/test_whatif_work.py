"""How much a comparison may ask for, and what becomes of a wrong buoyancy that is trimmed away."""

import numpy as np
import pytest

from autonomy.control.catalogue import CONTROLLERS
from autonomy.vehicle.config import MINIGLIDER
from autonomy.whatif import kernel
from autonomy.whatif.check import UnfitControllerError, check_scenario
from autonomy.whatif.comparison import compare
from autonomy.whatif.config import (
    TABLE_3_1_LINEAR,
    TABLE_3_3_DIAGONAL,
    ControllerChoice,
    DisturbanceConfig,
    TrialConfig,
)
from autonomy.whatif.setting import packed_references, setting
from autonomy.whatif.work import MOST_STEPS_TOGETHER, TooMuchWorkError, check_work, planned_steps

LARGEST = TrialConfig(reference="diagonal", duration_s=36_000.0, step_s=0.09, runs=200)
"""As long, and as often, as a single scenario may be flown."""


def choice(name, **settings):
    kind = CONTROLLERS[f"controller.{name}"]
    preset = kind.preset("miniglider")
    return ControllerChoice(kind.key, kind.title, preset.model_copy(update=settings))


def test_too_many_runs_are_refused_with_the_figures():
    six = [choice(key.partition(".")[2]) for key in CONTROLLERS]
    words = (
        r"200 runs of 6 controllers over 36000 s are 4\.8e8 steps of the model; at most 1e8 are"
        " worked out: take fewer runs"
    )
    for refused in (check_work, check_scenario, compare):
        with pytest.raises(TooMuchWorkError, match=words):
            refused(MINIGLIDER, LARGEST, six)


def test_what_the_largest_form_of_a_page_asks_for_is_accepted():
    ten = TABLE_3_1_LINEAR.model_copy(update={"runs": 100})
    six = [choice(key.partition(".")[2]) for key in CONTROLLERS]
    assert planned_steps(MINIGLIDER, ten, six) == 6 * 100 * 54_000 <= MOST_STEPS_TOGETHER
    check_work(MINIGLIDER, ten, six)


def test_predictions_of_a_controller_count_as_steps():
    scenario = TABLE_3_1_LINEAR.model_copy(update={"runs": 10})
    late = choice("governor", mass_delay_s=2.0)
    assert planned_steps(MINIGLIDER, scenario, [late]) == 10 * 54_000 * (1 + 200)
    with pytest.raises(TooMuchWorkError, match=r"1\.1e8 steps of the model, 1\.1e8 of them to pre"):
        check_work(MINIGLIDER, scenario, [late])
    slower = scenario.model_copy(update={"control_period_s": 0.1})
    assert planned_steps(MINIGLIDER, slower, [late]) == 10 * 5_400 * (10 + 20)


def test_steps_that_the_extended_model_cuts_into_parts_count_as_such():
    scenario = TrialConfig(model="extended", duration_s=100.0, step_s=0.1)
    laws = [choice("pid")]
    plain = planned_steps(MINIGLIDER, scenario, laws)
    heavy = TrialConfig.model_validate(
        scenario.model_dump() | {"disturbance": {"net_buoyancy_error_kg": 1.0}}
    )
    assert planned_steps(MINIGLIDER, heavy, laws) > 20 * plain
    blind = TrialConfig.model_validate(scenario.model_dump() | {"sensing": {"exact": False}})
    assert planned_steps(MINIGLIDER, blind, laws) == plain + 1000


def test_a_delay_of_more_commands_than_a_controller_remembers_is_refused():
    fine = TABLE_3_1_LINEAR.model_copy(update={"step_s": 0.005, "duration_s": 100.0})
    late = choice("governor", mass_delay_s=2.0)
    with pytest.raises(UnfitControllerError, match=r"is 400 control periods of 0\.005 s") as error:
        check_scenario(MINIGLIDER, fine, [choice("pid"), late])
    assert error.value.number == 1
    check_scenario(MINIGLIDER, fine.model_copy(update={"control_period_s": 0.01}), [late])


def flown(is_extended, error, trim):
    """Fly 20 s under commands that are the same but for the trim, which actuators start with.

    ``error`` and ``trim`` are net mass kg and position of the sliding mass m.
    """
    off = DisturbanceConfig(net_buoyancy_error_kg=error[0], mass_position_error_m=error[1])
    scenario = TABLE_3_3_DIAGONAL.model_copy(update={"disturbance": off})
    drawn = setting(MINIGLIDER, scenario, 1, packed_references(MINIGLIDER, scenario))
    rng, dt_s = np.random.default_rng(3), 0.05
    x, inputs = np.zeros(15), np.array([*trim, 0.0])
    x[:3], x[6] = (0.0, 0.0, 5.0), 0.05
    for step in range(400):
        if step % 50 == 0:
            wanted = rng.uniform(-1.0, 1.0, 3) * [0.015, 0.03, 0.5]
        applied = np.array([wanted[0] + trim[0], wanted[1] + trim[1], wanted[2], 0.0, 0.0])
        common = (x, inputs, applied, drawn.true)
        if is_extended:
            around = (drawn.surroundings, drawn.conditions, step * dt_s, dt_s)
            kernel.move_extended(*common, *around)
        else:
            rows = (np.empty(12) for _ in range(3))
            kernel.move_within_rates(*common, drawn.conditions, dt_s, *rows)
    return x[:12]


@pytest.mark.parametrize("is_extended", [False, True])
def test_an_error_cancels_with_commands_that_a_trim_shifts_by_its_opposite(is_extended):
    b, r = 0.002, 0.003
    right = flown(is_extended, (0.0, 0.0), (0.0, 0.0))
    assert flown(is_extended, (-b, -r), (b, r)) == pytest.approx(right, abs=1e-9)
    for trim in ((0.0, 0.0), (-b, -r), (b, 0.0), (0.0, r)):
        assert np.abs(flown(is_extended, (-b, -r), trim) - right).max() > 1e-3
