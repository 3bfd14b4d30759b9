"""Backstepping that learns its offsets: against its readable form, and what it removes."""

import numpy as np
import pytest

from autonomy.control import integral_kernel
from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.governor_config import GovernorConfig
from autonomy.control.integral_config import INTEGRAL_EXPERIMENT, IntegralConfig
from autonomy.control.reference.integral import integral_inputs
from autonomy.control.swimming_config import SwimmingConfig
from autonomy.control.trajectory import Reference
from autonomy.vehicle.config import MINIGLIDER
from autonomy.whatif.config import (
    TABLE_3_1_LINEAR,
    TABLE_3_3_DIAGONAL,
    ControllerChoice,
    TrialConfig,
)
from autonomy.whatif.run import run_trial
from tests.autonomy.test_control import PACKED, close, random_reference, random_state

SEEDS = (1, 2)
PERIODS = 1500
"""The last two dives of the diagonal at 10 Hz."""


def trials(name, scenario, seeds=SEEDS, **disturbance):
    kind = CONTROLLERS[f"controller.{name}"]
    config = TrialConfig.model_validate(scenario.model_dump() | {"disturbance": disturbance})
    choice = ControllerChoice(kind.key, kind.title, kind.preset("miniglider"))
    return [run_trial(MINIGLIDER, config, choice, seed) for seed in seeds]


def offset(name, column, **disturbance):
    """Half the difference of the mean error between an error and its opposite."""
    means = [
        np.mean(
            [
                trial.errors[-PERIODS:, column].mean()
                for trial in trials(
                    name,
                    TABLE_3_3_DIAGONAL,
                    **{key: sign * value for key, value in disturbance.items()},
                )
            ]
        )
        for sign in (1.0, -1.0)
    ]
    return abs(means[0] - means[1]) / 2


def test_compiled_law_is_the_readable_one_and_learns_the_same():
    rng = np.random.default_rng(4)
    gains = INTEGRAL_EXPERIMENT
    for n in range(2000):
        state = random_state(rng)
        reference = random_reference(rng, near=state if n % 2 else None)
        learned = rng.uniform(-1, 1, 3) * [0.012, 0.012, 1.1]
        readable, known = integral_inputs(state, reference, learned, gains, MINIGLIDER, 0.1)
        compiled = integral_kernel.integral(
            state, reference.packed(), gains.packed(), PACKED, learned, 0.1
        )
        assert close(compiled, readable)
        assert close(learned, known)


def test_packed_gains_stand_in_the_order_that_the_kernel_reads():
    names = list(IntegralConfig.model_fields)
    assert names[integral_kernel.K_DEPTH] == "k_depth_integral"
    assert names[integral_kernel.MASS_POSITION_MOST] == "mass_position_most_m"
    assert names[integral_kernel.ALONG_MOST] == "along_most_m"
    assert len(names) == integral_kernel.GAINS == INTEGRAL_EXPERIMENT.packed().size


@pytest.mark.parametrize(
    ("name", "limit"), [("k_depth_integral", 0.08 * 0.9), ("k_pitch_integral", 16.0)]
)
@pytest.mark.parametrize("model", [IntegralConfig, GovernorConfig, SwimmingConfig])
def test_an_integral_gain_beyond_the_limit_of_stability_is_refused(model, name, limit):
    assert getattr(model(**{name: 0.99 * limit}), name) == pytest.approx(0.99 * limit)
    with pytest.raises(ValueError, match=f"{name} must be below {limit:g}"):
        model(**{name: limit})


def test_depth_offset_of_a_wrong_net_buoyancy_is_removed():
    assert offset("backstepping", 0, net_buoyancy_error_kg=0.002) > 0.03
    proposed = offset("backstepping", 0, net_buoyancy_error_kg=0.002)
    assert offset("integral", 0, net_buoyancy_error_kg=0.002) <= 0.5 * proposed


@pytest.mark.parametrize("column", [2, 3])
def test_pitch_offset_of_a_wrong_mass_position_is_removed(column):
    proposed = offset("backstepping", column, mass_position_error_m=0.002)
    assert proposed > 0.01
    assert offset("integral", column, mass_position_error_m=0.002) <= 0.5 * proposed


def test_learned_numbers_are_those_that_the_model_has_wrong():
    config = TrialConfig.model_validate(
        TABLE_3_1_LINEAR.model_dump()
        | {
            "control_period_s": 0.1,
            "disturbance": {"net_buoyancy_error_kg": 0.002, "mass_position_error_m": 0.002},
        }
    )
    kind = CONTROLLERS["controller.integral"]
    controller = kind.make(MINIGLIDER, kind.preset("miniglider"))
    choice = ControllerChoice(kind.key, "", kind.preset("miniglider"))
    trial = run_trial(MINIGLIDER, config, choice, 1)
    for state, row in zip(trial.state, trial.reference, strict=True):
        reference = Reference(
            tuple(row[:3]), row[3], tuple(row[4:7]), row[7], tuple(row[8:11]), row[11]
        )
        command = controller.command(state, reference, 0.1)
    assert [command.m0_kg, command.rp1_m] == pytest.approx(trial.commands[-1, :2], abs=1e-12)
    exact = {**config.model_dump(), "disturbance": {}}
    without = run_trial(MINIGLIDER, TrialConfig.model_validate(exact), choice, 1)
    # with the errors learned, the masses that are really there are those of an exact model
    learned = without.inputs[-1, :2] - trial.inputs[-1, :2]
    assert learned == pytest.approx([0.002, 0.002], rel=0.05)


def test_distance_that_a_current_leaves_is_reduced():
    along = TrialConfig.model_validate(
        TABLE_3_1_LINEAR.model_dump()
        | {
            "reference": "straight_glide",
            "control_period_s": 0.1,
            "step_s": 0.05,
            "start": {"north_m": 0.0, "east_m": 0.0, "forward_speed_m_s": 0.02},
        }
    )
    left = {
        name: trials(name, along, seeds=(1,), current_north_m_s=-0.003)[0].errors[-500:, 1].mean()
        for name in ("backstepping", "integral")
    }
    assert left["integral"] < 0.65 * left["backstepping"]


def test_learning_does_not_lose_the_horizontal_claim():
    ends = {
        name: trials(name, TABLE_3_1_LINEAR.model_copy(update={"control_period_s": 0.1}), (1,))[0]
        for name in ("integral", "baseline", "pid")
    }
    rms = {name: trial.rms()[1] for name, trial in ends.items()}
    assert rms["integral"] < 0.6 * min(rms["baseline"], rms["pid"])


def test_nothing_is_learned_far_away_nor_into_an_end_stop():
    controller = CONTROLLERS["controller.integral"].make(MINIGLIDER, INTEGRAL_EXPERIMENT)
    fresh = CONTROLLERS["controller.backstepping"].make(
        MINIGLIDER, CONTROLLERS["controller.backstepping"].preset("miniglider")
    )
    state = np.zeros(12)
    state[6] = 0.05
    near = Reference((0.0, 0.0, 0.02), -0.05, (0.05, 0.0, 0.0))
    for far in (
        Reference((30.0, 0.0, 5.0), 0.0),
        Reference((30.0, 0.0, 0.25), -0.2, (0.0, 0.0, 2.0)),
    ):
        for _ in range(200):
            stopped = controller.command(state, far, 0.1)
        if far.velocity_ned[2] > 0.0:
            assert stopped.m0_kg == MINIGLIDER.limits.m0_max_kg
            assert (
                controller.command(state, near, 0.0).m0_kg == fresh.command(state, near, 0.0).m0_kg
            )
        controller.reset()
    assert controller.command(state, near, 0.0) == fresh.command(state, near, 0.0)
