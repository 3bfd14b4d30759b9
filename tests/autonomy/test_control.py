"""Control laws against golden vectors, derivatives, and each other."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from autonomy.control import config, kernel, law_number
from autonomy.control.controller import BacksteppingController, CompiledController
from autonomy.control.reference.backstepping import backstepping_inputs
from autonomy.control.reference.error import tracking_error
from autonomy.control.reference.pid import pid_inputs
from autonomy.control.trajectory import THESIS_REFERENCES, Reference, straight_glide
from autonomy.vehicle.config import MINIGLIDER, VEHICLES
from autonomy.vehicle.extended_kernel import advance
from autonomy.vehicle.glide import angle_of_attack
from autonomy.vehicle.reference.dynamics import state_derivative
from autonomy.vehicle.surroundings import Surroundings

GOLDEN = json.loads((Path(__file__).parent / "golden_vehicle.json").read_text())
GAINS = {"sim": config.BACKSTEPPING_SIMULATION, "exp": config.BACKSTEPPING_EXPERIMENT}
PACKED = MINIGLIDER.packed()
TRADE = math.pi / 9


def random_state(rng):
    scale = np.array([2, 2, 2, 0, 1.2, 3, 0.1, 0.01, 0.01, 0.1, 0.1, 0.1])
    state = rng.uniform(-1, 1, 12) * scale
    state[6] = abs(state[6]) + 0.01
    return state


def random_reference(rng, near=None):
    position = rng.uniform(-3, 3, 3) if near is None else near[:3] + rng.uniform(-0.02, 0.02, 3)
    numbers = rng.uniform(-0.05, 0.05, 9).tolist()
    return Reference(
        tuple(position.tolist()),
        float(rng.uniform(-0.8, 0.8)),
        tuple(numbers[:3]),
        numbers[3],
        tuple(numbers[4:7]),
        numbers[7],
    )


@pytest.mark.parametrize("case", GOLDEN["backstepping"])
def test_backstepping_gives_the_golden_inputs(case):
    gains = GAINS[case["gains"]].model_copy(update={"tail_effect_min": case["f23min"]})
    reference = THESIS_REFERENCES[case["reference"]](case["t"])
    state = np.array(case["X"])
    readable = backstepping_inputs(state, reference, gains, MINIGLIDER)
    assert readable == pytest.approx(case["u"], rel=1e-9)
    compiled = kernel.backstepping(state, reference.packed(), gains.packed(), PACKED)
    assert compiled == pytest.approx(case["u"], rel=1e-9)


def close(compiled, readable):
    """Agree to 1e-13 of the value, or of 1 in SI units where it is smaller."""
    return compiled == pytest.approx(readable, rel=1e-13, abs=1e-13)


def test_compiled_laws_are_the_readable_ones_far_and_near():
    rng = np.random.default_rng(1)
    backstepping, pid = config.BACKSTEPPING_SIMULATION, config.PID_EXPERIMENT
    literal = backstepping.model_copy(update={"is_tail_clipped_first": False})
    for n in range(2000):
        state = random_state(rng)
        reference = random_reference(rng, near=state if n % 2 else None)
        gains = backstepping if n % 3 else literal
        readable = backstepping_inputs(state, reference, gains, MINIGLIDER)
        compiled = kernel.backstepping(state, reference.packed(), gains.packed(), PACKED)
        assert close(compiled, readable)
        mode = ("none", "hold", "back_calculation")[n % 3]
        gains = pid.model_copy(update={"anti_windup": mode, "z_integral": 0.01})
        integrals = rng.normal(size=3)
        readable, added = pid_inputs(state, reference, integrals, gains, MINIGLIDER.limits, 0.1)
        compiled = kernel.pid(state, reference.packed(), gains.packed(), PACKED, integrals, 0.1)
        assert close(compiled, readable)
        assert close(integrals, added)


@pytest.mark.parametrize(("mode", "grows"), [("none", True), ("hold", False)])
def test_anti_windup_decides_whether_an_integral_grows_into_the_stop(mode, grows):
    gains = config.PID_EXPERIMENT.model_copy(update={"anti_windup": mode, "z_integral": 0.01})
    far_below = Reference((3.0, 0.0, 5.0), 0.0)
    integrals = np.zeros(3)
    for _ in range(100):
        wanted = kernel.pid(
            np.zeros(12), far_below.packed(), gains.packed(), PACKED, integrals, 0.1
        )
        assert wanted[0] > MINIGLIDER.limits.m0_max_kg
    assert (integrals[0] > 0.0) == grows
    near_above = Reference((3.0, 0.0, -0.01), 0.0)
    kernel.pid(np.zeros(12), near_above.packed(), gains.packed(), PACKED, integrals, 0.1)
    assert (integrals[0] < 0.0) != grows


def test_back_calculation_runs_an_integral_back_to_what_the_stop_allows():
    gains = config.PID_EXPERIMENT.model_copy(
        update={"anti_windup": "back_calculation", "z_integral": 0.01, "windup_recovery_s": 1.0}
    )
    far_below = Reference((3.0, 0.0, 5.0), 0.0)
    integrals = np.array([100.0, 0.0, 0.0])
    for _ in range(2000):
        wanted = kernel.pid(
            np.zeros(12), far_below.packed(), gains.packed(), PACKED, integrals, 0.1
        )
    # it rests where the growth by the error equals what is run back
    excess = 5.0 * gains.z_integral * gains.windup_recovery_s
    assert wanted[0] - MINIGLIDER.limits.m0_max_kg == pytest.approx(excess, rel=1e-2)


def test_a_robot_at_rest_gets_a_finite_command():
    state = np.zeros(12)
    reference = straight_glide((3.0, 1.0, 0.0), (0.02, 0.0, 0.03), -0.7, 0.0)
    readable = backstepping_inputs(state, reference, config.BACKSTEPPING_EXPERIMENT, MINIGLIDER)
    assert np.all(np.isfinite(readable))
    gains = config.BACKSTEPPING_EXPERIMENT.packed()
    compiled = kernel.backstepping(state, reference.packed(), gains, PACKED)
    assert compiled == pytest.approx(readable, rel=1e-9)


def test_the_literal_law_leaves_a_tail_without_effect_straight():
    literal = config.BACKSTEPPING_EXPERIMENT.model_copy(update={"tail_effect_min": 0.0})
    reference = straight_glide((3.0, 1.0, 0.0), (0.02, 0.0, 0.03), -0.7, 0.0)
    readable = backstepping_inputs(np.zeros(12), reference, literal, MINIGLIDER)
    assert readable[2] == 0.0
    compiled = kernel.backstepping(np.zeros(12), reference.packed(), literal.packed(), PACKED)
    assert compiled == pytest.approx(readable, rel=1e-9)


@pytest.mark.parametrize("model", [config.BacksteppingConfig, config.PidConfig])
def test_points_beside_the_target_must_lie_outside_the_nearness(model):
    assert model(near_m=0.15).near_offset_m == 0.15
    with pytest.raises(ValueError, match="near_offset_m must not be below near_m"):
        model(near_m=0.16)


@pytest.mark.parametrize("near", [False, True])
def test_error_rates_are_the_derivatives_of_the_errors(near):
    rng = np.random.default_rng(2)
    settings = {"pitch_trade_rad": TRADE, "near_m": 0.05, "near_offset_m": 0.15}
    h = 1e-6
    for _ in range(50):
        state = random_state(rng)
        state[9] = 0.0
        reference = random_reference(rng, near=state if near else None)
        # without roll, as the laws assume; position and attitude follow from the velocities
        rates = state_derivative(state, np.zeros(3), MINIGLIDER.parameters)
        rates[6:] = 0.0

        def at(dt, state=state, reference=reference, rates=rates):
            moved = state + rates * dt
            target = np.array(reference.position_ned) + np.array(reference.velocity_ned) * dt
            pitch = reference.pitch_rad + reference.pitch_rate_rad_s * dt
            ahead = Reference(
                tuple(target), pitch, reference.velocity_ned, reference.pitch_rate_rad_s
            )
            return tracking_error(moved, ahead, **settings)

        now, before, after = at(0.0), at(-h), at(h)
        for value in ("depth", "direction", "hybrid", "pitch", "along", "cross"):
            slope = (getattr(after, value) - getattr(before, value)) / (2 * h)
            assert getattr(now, value + "_rate") == pytest.approx(slope, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("trajectory", THESIS_REFERENCES)
def test_reference_derivatives_are_those_of_its_values(trajectory):
    h = 1e-3
    for time_s in (0.0, 17.3, 200.0):
        before, now, after = (trajectory(time_s + d).packed() for d in (-h, 0.0, h))
        assert now[4:8] == pytest.approx((after - before)[:4] / (2 * h), abs=1e-7)
        assert now[8:] == pytest.approx((after - before)[4:8] / (2 * h), abs=1e-7)


def test_backstepping_without_limits_gives_the_target_error_dynamics():
    """At level roll, with the tail's own effect known, depth error obeys its linear equation."""
    rng = np.random.default_rng(3)
    gains = config.BACKSTEPPING_SIMULATION
    p = MINIGLIDER.parameters
    for _ in range(50):
        state = random_state(rng)
        state[9] = state[11] = 0.0
        reference = random_reference(rng)
        inputs = backstepping_inputs(state, reference, gains, MINIGLIDER)
        inputs[2] = np.clip(inputs[2], -1.92, 1.92)
        rates = state_derivative(state, inputs, p)
        s, c = math.sin(state[4]), math.cos(state[4])
        sink = -s * rates[6] + c * rates[8] + rates[4] * (-c * state[6] - s * state[8])
        error = tracking_error(
            state, reference, pitch_trade_rad=TRADE, near_m=0.05, near_offset_m=0.15
        )
        wanted = -gains.k_1 * error.depth_rate - gains.k_z * error.depth
        assert reference.acceleration_ned[2] - sink == pytest.approx(wanted, abs=1e-9)


def start():
    state = np.zeros(12)
    state[6] = 0.06
    return state


@pytest.mark.parametrize("key", VEHICLES)
@pytest.mark.parametrize("kind", ["backstepping", "pid"])
def test_a_robot_at_ten_hertz_follows_a_glide(key, kind):
    vehicle = VEHICLES[key]
    controller = (
        BacksteppingController(vehicle, config.BACKSTEPPING_PRESETS[key])
        if kind == "backstepping"
        else CompiledController(law_number.PID, vehicle, config.PID_PRESETS[key].packed())
    )
    path, sink = math.radians(-45), 0.04
    pitch = path + angle_of_attack(vehicle.parameters, path)
    state = np.zeros(15)
    state[5] = 0.4
    for n in range(1000):
        reference = straight_glide((0.3, 0.0, 0.0), (0.04, 0.0, sink), pitch, 0.1 * n)
        u = controller.command(state[:12], reference, 0.1)
        command = np.array([u.m0_kg, u.rp1_m, u.delta_rad, 0.0, 0.0])
        state = advance(state, command, vehicle.packed(), Surroundings().packed(), 0.1 * n, 0.02, 5)
    miss = np.array(reference.position_ned) - state[:3]
    assert np.hypot(*miss[:2]) < 1.0
    assert abs(miss[2]) < 0.5
    assert abs(state[4] - pitch) < 0.1


def test_commands_stay_within_the_end_stops_and_nonsense_becomes_neutral():
    controller = BacksteppingController(MINIGLIDER, config.BACKSTEPPING_SIMULATION)
    far = Reference((50.0, 80.0, 90.0), 1.0)
    command = controller.command(np.zeros(12), far, 0.1)
    assert command.m0_kg == MINIGLIDER.limits.m0_max_kg
    assert abs(command.delta_rad) <= 1.92
    lost = np.full(12, np.nan)
    neutral = controller.command(lost, far, 0.1)
    assert (neutral.m0_kg, neutral.rp1_m, neutral.delta_rad) == (0.0, 0.0, 0.0)


def test_pid_forgets_when_reset():
    gains = config.PID_EXPERIMENT.packed()
    controller = CompiledController(law_number.PID, MINIGLIDER, gains)
    reference = straight_glide((1.0, 0.0, 0.5), (0.02, 0.0, 0.02), -0.01, 0.0)
    state = start()
    first = controller.command(state, reference, 0.1)
    assert controller.command(state, reference, 0.1) != first
    controller.reset()
    assert controller.command(state, reference, 0.1) == first


def test_backstepping_has_no_memory():
    controller = BacksteppingController(MINIGLIDER, config.BACKSTEPPING_EXPERIMENT)
    reference = straight_glide((1.0, 0.0, 0.5), (0.02, 0.0, 0.02), -0.01, 0.0)
    first = controller.command(start(), reference, 0.1)
    controller.reset()
    assert controller.command(start(), reference, 0.1) == first


def test_packed_gains_stand_in_the_order_that_the_kernel_reads():
    names = list(config.BacksteppingConfig.model_fields)
    assert names[kernel.PITCH_TRADE] == "pitch_trade_rad"
    assert names[kernel.NEAR_OFFSET] == "near_offset_m"
    assert names[kernel.TAIL_CLIPPED_FIRST] == "is_tail_clipped_first"
    assert len(names) == config.BACKSTEPPING_EXPERIMENT.packed().size
    names = list(config.PidConfig.model_fields)
    assert names[kernel.PID_NEAR] == "near_m"
    assert names[kernel.PID_NEAR_OFFSET] == "near_offset_m"
    assert names[kernel.PID_ANTI_WINDUP] == "anti_windup"
    assert names[kernel.PID_WINDUP_RECOVERY] == "windup_recovery_s"
    assert names[3] == "pitch_proportional"
