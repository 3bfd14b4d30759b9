"""Backstepping for a slow, late mass actuator: against its readable form, and without swinging."""

import numpy as np
import pytest

from autonomy.control import governor_kernel, integral_kernel
from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.governor_config import (
    GOVERNOR_EXPERIMENT,
    MOST_DELAY_CALLS,
    GovernorConfig,
)
from autonomy.control.integral_config import INTEGRAL_EXPERIMENT
from autonomy.control.reference.governor import SentCommands, governor_inputs
from autonomy.vehicle.config import MINIGLIDER
from autonomy.whatif.config import (
    TABLE_3_3_DIAGONAL,
    TABLE_3_3_FIGURE_EIGHT,
    ControllerChoice,
    DisturbanceConfig,
)
from autonomy.whatif.run import run_trial
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
        compare_with_readable(rng, config, calls=20, dt_s=0.1)


def test_a_delay_longer_than_the_memory_is_cut_alike_in_both():
    config = KNOWS.model_copy(update={"mass_delay_s": 2.0})
    assert config.delay_calls(0.005) == MOST_DELAY_CALLS == 255
    compare_with_readable(np.random.default_rng(7), config, calls=300, dt_s=0.005)


def compare_with_readable(rng, config, *, calls, dt_s):
    known = rng.uniform(-1, 1, 3) * [0.012, 0.012, 1.1]
    sent, memory = SentCommands(), np.zeros(governor_kernel.MEMORY_SIZE)
    memory[:3] = known
    for n in range(calls):
        state = random_state(rng)
        reference = random_reference(rng, near=state if n % 2 else None)
        readable, known, sent = governor_inputs(
            state, reference, known, sent, config, MINIGLIDER, dt_s
        )
        compiled = governor_kernel.governor(
            state, reference.packed(), config.packed(), PACKED, memory, dt_s
        )
        assert close(compiled, readable)
        assert close(memory[:3], known)
        assert close(memory[3:6], np.array(sent.actuators))


def test_with_a_prompt_actuator_it_is_the_integral_controller():
    rng = np.random.default_rng(8)
    learning = INTEGRAL_EXPERIMENT
    prompt = GovernorConfig(**learning.model_dump(), mass_rate_share=2.0, rate_use=100.0)
    known, memory = np.zeros(3), np.zeros(governor_kernel.MEMORY_SIZE)
    for _ in range(200):
        state = random_state(rng)
        reference = random_reference(rng, near=state)
        one = integral_kernel.integral(
            state, reference.packed(), learning.packed(), PACKED, known, 0.1
        )
        other = governor_kernel.governor(
            state, reference.packed(), prompt.packed(), PACKED, memory, 0.1
        )
        assert close(other, one)


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


def test_without_integrals_and_at_the_nominal_actuator_it_is_the_proposed_controller():
    off = {"k_depth_integral": 0.0, "k_pitch_integral": 0.0}
    plain = GOVERNOR_EXPERIMENT.model_copy(update=off)
    for proposed, governed in zip(
        pitch_rms("backstepping", TABLE_3_3_DIAGONAL),
        pitch_rms("governor", TABLE_3_3_DIAGONAL, plain),
        strict=True,
    ):
        assert governed == pytest.approx(proposed, rel=0.01)


@pytest.mark.parametrize("actuator", [{}, {"actuator_rate_share": 0.25, "actuator_delay_s": 0.4}])
def test_it_removes_the_offsets_of_wrong_masses_with_a_good_and_with_a_slow_late_actuator(actuator):
    for column, error in (
        (0, {"net_buoyancy_error_kg": 0.002}),
        (2, {"mass_position_error_m": 0.002}),
    ):
        config = KNOWS if actuator else GOVERNOR_EXPERIMENT
        proposed = abs(offset("backstepping", column, error))
        assert abs(offset("governor", column, error | actuator, config)) <= 0.1 * proposed


def offset(name, column, disturbance, config=None):
    """Half the difference of the mean error between an error and its opposite."""
    kind = CONTROLLERS[f"controller.{name}"]
    choice = ControllerChoice(kind.key, kind.title, config or kind.preset("miniglider"))
    means = []
    for sign in (1.0, -1.0):
        signed = {
            key: sign * value if key.endswith(("_kg", "error_m")) else value
            for key, value in disturbance.items()
        }
        off = DisturbanceConfig(**signed)
        scenario = TABLE_3_3_DIAGONAL.model_copy(update={"disturbance": off})
        trials = [run_trial(MINIGLIDER, scenario, choice, seed) for seed in SEEDS]
        means.append(np.mean([trial.errors[-1500:, column].mean() for trial in trials]))
    return (means[0] - means[1]) / 2


def test_an_estimate_that_is_not_a_number_is_not_remembered():
    kind = CONTROLLERS["controller.governor"]
    controller, fresh = (kind.make(MINIGLIDER, KNOWS) for _ in range(2))
    rng = np.random.default_rng(6)
    state, reference = random_state(rng), random_reference(rng)
    lost = controller.command(np.full(12, np.nan), reference, 0.1)
    assert (lost.m0_kg, lost.rp1_m, lost.delta_rad) == (0.0, 0.0, 0.0)
    assert controller.command(state, reference, 0.1) == fresh.command(state, reference, 0.1)
