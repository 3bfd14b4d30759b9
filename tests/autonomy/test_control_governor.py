"""Backstepping for a slow, late mass actuator: against its readable form, and without swinging."""

import numpy as np
import pytest

from autonomy.control import governor_kernel
from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.governor import SentCommands, governor_inputs
from autonomy.control.governor_config import GOVERNOR_EXPERIMENT, GovernorConfig
from autonomy.trial.config import TABLE_3_3_DIAGONAL, TABLE_3_3_FIGURE_EIGHT, DisturbanceConfig
from autonomy.trial.run import ControllerChoice, run_trial
from autonomy.vehicle.config import MINIGLIDER
from tests.autonomy.test_control import PACKED, close, random_reference, random_state

SLOW = DisturbanceConfig(
    net_buoyancy_error_kg=0.001, actuator_rate_share=0.25, actuator_delay_s=0.4
)
KNOWS = GOVERNOR_EXPERIMENT.model_copy(update={"mass_rate_share": 0.25, "mass_delay_s": 0.4})
SEEDS = (1, 2)


def pitch_rms(name, scenario, config=None):
    kind = CONTROLLERS[f"controller.{name}"]
    choice = ControllerChoice(kind.key, kind.title, config or kind.preset("miniglider"))
    return [run_trial(MINIGLIDER, scenario, choice, seed).rms()[2] for seed in SEEDS]


@pytest.mark.parametrize("delay_s", [0.0, 0.4])
def test_compiled_law_is_the_readable_one_through_a_series_of_calls(delay_s):
    rng = np.random.default_rng(5)
    config = KNOWS.model_copy(update={"mass_delay_s": delay_s})
    for _ in range(40):
        sent, memory = SentCommands(), np.zeros(governor_kernel.MEMORY_SIZE)
        for n in range(20):
            state = random_state(rng)
            reference = random_reference(rng, near=state if n % 2 else None)
            readable, sent = governor_inputs(state, reference, sent, config, MINIGLIDER, 0.1)
            compiled = governor_kernel.governor(
                state, reference.packed(), config.packed(), PACKED, memory, 0.1
            )
            assert close(compiled, readable)
            assert close(memory[:3], np.array(sent.actuators))


def test_packed_gains_stand_in_the_order_that_the_kernel_reads():
    names = list(GovernorConfig.model_fields)
    assert names[governor_kernel.MASS_RATE_SHARE] == "mass_rate_share"
    assert names[governor_kernel.MASS_DELAY] == "mass_delay_s"
    assert names[governor_kernel.RATE_USE] == "rate_use"
    assert names[governor_kernel.DELAY_MARGIN] == "delay_margin"
    assert len(names) == governor_kernel.GAINS == KNOWS.packed().size


@pytest.mark.parametrize("scenario", [TABLE_3_3_DIAGONAL, TABLE_3_3_FIGURE_EIGHT])
def test_it_does_not_swing_with_a_slow_late_actuator_where_the_others_do(scenario):
    slow = scenario.model_copy(update={"disturbance": SLOW})
    assert max(pitch_rms("governor", slow, KNOWS)) <= 0.1
    for name in ("backstepping", "baseline", "pid"):
        assert min(pitch_rms(name, slow)) > 0.13


def test_at_the_nominal_actuator_it_is_as_good_as_the_proposed_controller():
    for proposed, governed in zip(
        pitch_rms("backstepping", TABLE_3_3_DIAGONAL),
        pitch_rms("governor", TABLE_3_3_DIAGONAL),
        strict=True,
    ):
        assert governed <= 1.01 * proposed


def test_an_estimate_that_is_not_a_number_is_not_remembered():
    kind = CONTROLLERS["controller.governor"]
    controller, fresh = (kind.make(MINIGLIDER, KNOWS) for _ in range(2))
    rng = np.random.default_rng(6)
    state, reference = random_state(rng), random_reference(rng)
    lost = controller.command(np.full(12, np.nan), reference, 0.1)
    assert (lost.m0_kg, lost.rp1_m, lost.delta_rad) == (0.0, 0.0, 0.0)
    assert controller.command(state, reference, 0.1) == fresh.command(state, reference, 0.1)
