"""The swimming controller: against its readable form, and where it gets a robot."""

import math

import numpy as np
import pytest

from autonomy.control import swimming_kernel
from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.reference.swimming import amplitude_for, swimming_command
from autonomy.control.swimming_config import SWIMMING_PRESETS, SwimmingConfig
from autonomy.vehicle.config import MINIGLIDER, VEHICLES
from autonomy.whatif.config import ControllerChoice, StartConfig, StraightConfig, TrialConfig
from autonomy.whatif.run import run_trial
from tests.autonomy.test_control import PACKED, close, random_reference, random_state

SWIM = TrialConfig(
    reference="level_swim",
    straight=StraightConfig(swim_speed_m_s=0.05, depth_m=0.5),
    duration_s=200.0,
    control_period_s=0.1,
    step_s=0.02,
    model="extended",
    start=StartConfig(north_m=-0.3, east_m=0.2, down_m=-0.1, forward_speed_m_s=0.0),
)


def swim(config, vehicle=MINIGLIDER):
    kind = CONTROLLERS["controller.swimming"]
    choice = ControllerChoice(kind.key, kind.title, kind.preset(vehicle.key))
    return run_trial(vehicle, config, choice, 1)


def test_compiled_law_is_the_readable_one_and_learns_the_same():
    rng = np.random.default_rng(7)
    config = SWIMMING_PRESETS["miniglider"]
    for n in range(2000):
        state = random_state(rng)
        reference = random_reference(rng, near=state if n % 2 else None)
        learned = rng.uniform(-1, 1, 3) * [0.012, 0.012, 0.1]
        readable, known = swimming_command(state, reference, learned, config, MINIGLIDER, 0.1)
        compiled = swimming_kernel.swimming(
            state, reference.packed(), config.packed(), PACKED, learned, 0.1
        )
        compiled[:3] = MINIGLIDER.limits.clip(*compiled[:3].tolist())
        wanted = [
            readable.m0_kg,
            readable.rp1_m,
            readable.delta_rad,
            readable.tail_amplitude_rad,
            readable.tail_frequency_hz,
        ]
        assert close(compiled, wanted)
        assert close(learned, known)


def test_packed_gains_stand_in_the_order_that_the_kernel_reads():
    names = list(SwimmingConfig.model_fields)
    assert names[swimming_kernel.POSITION_GAIN] == "position_gain"
    assert names[swimming_kernel.FREQUENCY] == "frequency_hz"
    assert names[swimming_kernel.PITCH_MOST] == "pitch_most_rad"
    assert len(names) == swimming_kernel.GAINS == SwimmingConfig().packed().size


@pytest.mark.parametrize("key", VEHICLES)
@pytest.mark.parametrize("heading_rad", [0.6, -1.5, 3.0])
def test_a_robot_swims_along_a_level_course_wherever_it_first_looks(key, heading_rad):
    speed = 0.05 if key == "miniglider" else 0.1
    straight = StraightConfig(swim_speed_m_s=speed, depth_m=0.5, heading_rad=heading_rad)
    trial = swim(SWIM.model_copy(update={"straight": straight}), VEHICLES[key])
    depth, horizontal, _, _ = np.abs(trial.errors[-300:]).mean(axis=0)
    assert depth < 0.01
    assert horizontal < 0.06
    way = trial.state[-1, :2] - trial.state[-301, :2]
    assert np.hypot(*way) / 30.0 == pytest.approx(speed, rel=0.02)
    assert math.atan2(way[1], way[0]) == pytest.approx(heading_rad, abs=0.02)


def test_the_tail_never_flaps_faster_than_its_servo():
    fast = SWIM.model_copy(update={"straight": StraightConfig(swim_speed_m_s=0.3, depth_m=0.5)})
    trial = swim(fast)
    assert trial.flap[-1, 0] == SWIMMING_PRESETS["miniglider"].amplitude_most_rad
    rate = 2.0 * math.pi * trial.flap[:, 1] * trial.flap[:, 0]
    assert np.all(rate <= MINIGLIDER.limits.delta_rate_rad_s)
    greedy = SWIMMING_PRESETS["miniglider"].model_copy(
        update={"amplitude_most_rad": 1.5, "frequency_hz": 2.0}
    )
    assert amplitude_for(1.0, 0.0, greedy, MINIGLIDER) == pytest.approx(1.05 / (4.0 * math.pi))


def test_the_amplitude_for_a_speed_gives_about_that_speed():
    blind = SWIMMING_PRESETS["miniglider"].model_copy(
        update={"speed_gain": 0.0, "position_gain": 1e-6}
    )
    kind = CONTROLLERS["controller.swimming"]
    trial = run_trial(MINIGLIDER, SWIM, ControllerChoice(kind.key, "", blind), 1)
    assert np.hypot(*(trial.state[-1, :2] - trial.state[-501, :2])) / 50.0 == pytest.approx(
        0.05, rel=0.25
    )


def test_a_diving_course_is_followed_by_pitch_and_net_buoyancy():
    dive = SWIM.model_copy(update={"reference": "diagonal", "start": StartConfig(north_m=0.0)})
    trial = swim(dive)
    assert np.abs(trial.errors[-500:, 0]).max() < 0.03
    assert trial.errors[-500:, 1].mean() < 0.1


def test_without_a_tail_that_pushes_it_only_steers():
    still = SWIM.model_copy(update={"model": "thesis", "duration_s": 60.0})
    assert swim(still).errors[-1, 1] > 2.0
