"""What a robot does in its surroundings over minutes."""

import math

import numpy as np
import pytest

from autonomy.site import LAKE, TANK
from autonomy.vehicle.config import MINIGLIDER, VEHICLES
from autonomy.vehicle.extended_kernel import advance, tail_reference
from autonomy.vehicle.surroundings import Surroundings

SITES = {"miniglider": TANK, "grace3": LAKE}


def run(vehicle, state, command, surroundings, seconds, start_s=0.0, dt=0.02):
    steps = round(seconds / dt)
    packed = vehicle.packed()
    return advance(state, np.array(command), packed, surroundings.packed(), start_s, dt, steps)


def floating(vehicle):
    state = np.zeros(15)
    state[12] = vehicle.limits.m0_min_kg / 2
    return state


def swim_command(vehicle, bias=0.0):
    swim = vehicle.swim
    m0 = vehicle.limits.m0_min_kg / 2
    return [m0, swim.rp1_m, bias, swim.amplitude_rad, swim.frequency_hz]


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_a_rising_robot_comes_to_rest_at_the_surface(vehicle):
    state = floating(vehicle)
    state[2], state[4] = 1.0, 0.8
    command = [vehicle.limits.m0_min_kg, 0.0, 0.0, 0.0, 0.0]
    highest = 1.0
    for _ in range(300):
        state = run(vehicle, state, command, Surroundings(), 1.0)
        highest = min(highest, state[2])
    assert highest > -0.05
    assert state[2] == pytest.approx(0.0, abs=0.002)
    assert np.all(np.abs(state[6:12]) < 0.005)
    assert abs(state[4]) < 0.05


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_a_sinking_robot_stays_above_the_floor_and_leaves_it_again(vehicle):
    water = Surroundings(floor_m=1.2)
    down = [vehicle.limits.m0_max_kg, 0.01, 0.0, 0.0, 0.0]
    lying = run(vehicle, floating(vehicle), down, water, 200.0)
    assert lying[2] == pytest.approx(1.2, abs=0.01)
    up = [vehicle.limits.m0_min_kg, 0.0, 0.0, 0.0, 0.0]
    assert run(vehicle, lying, up, water, 200.0)[2] == pytest.approx(0.0, abs=0.01)


def test_walls_hold_a_swimmer_in_the_tank():
    state = floating(MINIGLIDER)
    for heading in (0.3, 1.8, -2.0, 2.9):
        state[5] = heading
        for i in range(60):
            state = run(
                MINIGLIDER,
                state,
                swim_command(MINIGLIDER),
                Surroundings.of_site(TANK),
                2.0,
                2.0 * i,
            )
            assert TANK.water.contains(*state[:3], margin_m=0.02)


@pytest.mark.parametrize(
    ("key", "slowest", "fastest"), [("miniglider", 0.05, 0.10), ("grace3", 0.10, 0.18)]
)
def test_a_flapping_tail_swims_forward_at_the_surface(key, slowest, fastest):
    vehicle = VEHICLES[key]
    state = run(vehicle, floating(vehicle), swim_command(vehicle), Surroundings(), 60.0)
    later = run(vehicle, state, swim_command(vehicle), Surroundings(), 30.0, 60.0)
    assert slowest < np.linalg.norm((later - state)[:2]) / 30.0 < fastest
    assert later[6] > 0.0
    assert abs(later[2]) < 0.01
    assert abs(later[4]) < math.radians(6.0)


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_a_biased_flap_turns_to_the_side_of_the_bias(vehicle):
    turns = []
    for bias in (0.6, -0.6):
        state, turned = floating(vehicle), 0.0
        for i in range(120):
            later = run(vehicle, state, swim_command(vehicle, bias), Surroundings(), 0.5, 0.5 * i)
            turned += math.remainder(later[5] - state[5], 2 * math.pi)
            state = later
        turns.append(turned)
    assert turns[0] < -math.radians(90.0)
    assert turns[1] > math.radians(90.0)


def test_a_faster_flap_than_the_servo_can_follow_gives_no_more_thrust():
    swim = MINIGLIDER.swim
    feasible = swim_command(MINIGLIDER)
    frantic = [*feasible[:3], 0.35, 1.0]
    rate = MINIGLIDER.limits.delta_rate_rad_s
    accelerations = [
        tail_reference(np.array(frantic), t, MINIGLIDER.packed())[1] for t in np.arange(0, 1, 0.01)
    ]
    assert max(accelerations) == pytest.approx(2 * math.pi * rate, rel=0.01)
    state = run(MINIGLIDER, floating(MINIGLIDER), frantic, Surroundings(), 60.0)
    assert state[6] < 0.12
    assert swim.amplitude_rad * swim.frequency_hz * 2 * math.pi < rate


def test_a_steering_step_does_not_kick_a_resting_robot():
    state = floating(MINIGLIDER)
    later = run(MINIGLIDER, state, [state[12], 0.0, 1.0, 0.0, 0.0], Surroundings(), 5.0)
    assert later[14] == pytest.approx(1.0, abs=1e-6)
    assert abs(later[5]) < 1e-3


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_actuators_keep_end_stops_and_rates(vehicle):
    limits = vehicle.limits
    rng = np.random.default_rng(7)
    state = np.zeros(15)
    state[2] = 5.0
    greatest = np.array([limits.m0_rate_kg_s, limits.rp1_rate_m_s, limits.delta_rate_rad_s])
    for i in range(200):
        command = rng.uniform(-1, 1, 5) * [1.0, 1.0, 6.0, 3.0, 2.0]
        later = run(vehicle, state, command, Surroundings(floor_m=10.0), 0.5, 0.5 * i)
        assert np.all(np.abs((later - state)[12:]) <= greatest * 0.5 * (1 + 1e-9))
        state = later
        assert limits.m0_min_kg <= state[12] <= limits.m0_max_kg
        assert limits.rp1_min_m <= state[13] <= limits.rp1_max_m
        assert abs(state[14]) <= limits.delta_max_rad
        assert np.all(np.isfinite(state))


def test_a_drifting_robot_goes_where_the_current_goes():
    water = Surroundings(current_ned_m_s=(0.03, -0.02, 0.0), floor_m=50.0)
    state = np.zeros(15)
    state[2] = 10.0
    later = run(MINIGLIDER, state, [0.0] * 5, water, 100.0)
    assert later[:3] == pytest.approx([3.0, -2.0, 10.0], abs=1e-6)


def test_a_tumbling_robot_keeps_its_attitude_in_range():
    state = np.zeros(15)
    state[2], state[4], state[10] = 20.0, 1.2, 3.0
    for i in range(200):
        state = run(MINIGLIDER, state, [-0.0279, -0.0555, 0.5, 0, 0], Surroundings(), 0.1, 0.1 * i)
        assert np.all(np.isfinite(state))
        assert abs(state[4]) <= math.pi / 2
        assert -math.pi <= state[3] < math.pi
        assert -math.pi <= state[5] < math.pi


def test_a_robot_thrown_through_the_water_slows_down_however_long_the_steps():
    state = np.zeros(15)
    state[2], state[6], state[8], state[10] = 50.0, 2.0, -1.0, 2.0
    for dt in (0.1, 0.02):
        slowed = run(MINIGLIDER, state, [0.0] * 5, Surroundings(), 10.0, dt=dt)
        assert np.linalg.norm(slowed[6:9]) < 0.2


def test_a_wall_that_pushes_a_robot_does_not_throw_it_however_long_the_steps():
    """The water's damping grows with the speed that a wall gives a robot within one step."""
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    rng = np.random.default_rng(seed)
    fastest = [0.15, 0.1, 0.05, 0.3, 0.3, 0.3]
    speeds = []
    for _ in range(2000):
        east, north = rng.uniform(-0.1, 0.1, 2)
        tank = Surroundings((north, east, 0.0), -1.5, 1.5, -1.5, 1.5, 1.2, has_walls=True)
        state = np.zeros(15)
        state[:3] = rng.uniform([1.2, 1.4, 0.0], [1.5, 1.515, 1.21])
        state[3:6] = rng.uniform(-1.0, 1.0, 3) * [0.3, 0.6, math.pi]
        state[6:12] = rng.uniform(-1.0, 1.0, 6) * fastest
        state[12:] = rng.uniform([-0.02, -0.05, -1.7], [0.02, 0.04, 1.7])
        command = [*state[12:], 0.0, 0.0]
        speeds.append(np.linalg.norm(run(MINIGLIDER, state, command, tank, 2.0, dt=0.1)[6:9]))
    assert max(speeds) < 1.0, seed


def test_splitting_a_run_changes_nothing():
    state = floating(MINIGLIDER)
    command = swim_command(MINIGLIDER, 0.2)
    whole = run(MINIGLIDER, state, command, Surroundings(), 4.0)
    half = run(MINIGLIDER, state, command, Surroundings(), 2.0)
    assert run(MINIGLIDER, half, command, Surroundings(), 2.0, 2.0) == pytest.approx(
        whole, abs=1e-12
    )


def test_the_given_state_is_left_alone():
    state = floating(MINIGLIDER)
    before = state.copy()
    run(MINIGLIDER, state, swim_command(MINIGLIDER), Surroundings(), 1.0)
    assert np.array_equal(state, before)
