"""Equations of motion against golden vectors, laws of physics, and each other."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from autonomy.vehicle import extended_rates, kernel
from autonomy.vehicle.config import MINIGLIDER, VEHICLES, VehicleParameters
from autonomy.vehicle.reference import dynamics
from autonomy.vehicle.surroundings import Surroundings

GOLDEN = json.loads((Path(__file__).parent / "golden_vehicle.json").read_text())
PACKED = MINIGLIDER.packed()
MIRROR = np.array([1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1.0])


def relative_error(value, expected):
    return float(np.linalg.norm(value - expected) / np.linalg.norm(expected))


def random_states(rng, n, columns=12):
    scale = np.array([2, 2, 2, 1.5, 1.5, 3, 0.15, 0.05, 0.15, 0.3, 0.3, 0.3, 0.02, 0.04, 1.5])
    return rng.uniform(-1.0, 1.0, (n, columns)) * scale[:columns]


def random_inputs(rng, n):
    return rng.uniform(-1.0, 1.0, (n, 3)) * [0.025, 0.05, 1.9]


@pytest.mark.parametrize("case", GOLDEN["rhs"])
def test_rates_are_those_of_the_golden_vectors(case):
    state, inputs, rates = (np.array(case[key]) for key in ("X", "U", "dX"))
    assert kernel.state_derivative(state, inputs, PACKED) == pytest.approx(rates, rel=1e-12)
    readable = dynamics.state_derivative(state, inputs, MINIGLIDER.parameters)
    assert readable == pytest.approx(rates, rel=1e-12)


def test_compiled_rates_are_the_readable_ones():
    rng = np.random.default_rng(1)
    for state, inputs in zip(random_states(rng, 2000), random_inputs(rng, 2000), strict=True):
        readable = dynamics.state_derivative(state, inputs, MINIGLIDER.parameters)
        assert relative_error(kernel.state_derivative(state, inputs, PACKED), readable) < 1e-13


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_compiled_extended_rates_are_the_readable_ones(vehicle):
    rng = np.random.default_rng(2)
    tank = Surroundings((0.1, -0.05, 0.01), -1.5, 1.5, -1.5, 1.5, 1.2, has_walls=True)
    for state in random_states(rng, 2000, 15):
        actuator = rng.uniform(-1.0, 1.0, 4) * [0.002, 0.01, 1.9, 3.0]
        readable = dynamics.extended_state_derivative(state, actuator, vehicle, tank)
        compiled = extended_rates.extended_state_derivative(
            state, actuator, vehicle.packed(), tank.packed(), 0.0
        )
        assert relative_error(compiled, readable) < 1e-13


def test_water_without_walls_holds_nobody_back_sideways():
    far_away = np.array([1e4, -1e4, 3.0])
    lake = Surroundings(x_max_m=500.0, y_min_m=0.0, floor_m=20.0)
    force = dynamics.contact_force(far_away, np.zeros(3), lake, MINIGLIDER.parameters)
    assert force.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2, 1.5707])
def test_rates_stay_finite_where_euler_angles_are_singular(pitch):
    state = np.array([0, 0, 5, 0.1, pitch, 0.2, 0.1, 0.01, 0.01, 0.05, 0.1, 0.3])
    rates = kernel.state_derivative(state, np.array([0.01, 0.02, 0.3]), PACKED)
    assert np.all(np.abs(rates) < 0.4 / kernel.COS_PITCH_FLOOR)
    readable = dynamics.state_derivative(state, np.array([0.01, 0.02, 0.3]), MINIGLIDER.parameters)
    assert rates == pytest.approx(readable, rel=1e-12, abs=1e-15)


def test_rest_has_no_hydrodynamic_force():
    force, moment = dynamics.hydrodynamic_wrench(
        np.zeros(3), np.array([0.1, 0.2, 0.3]), 0.5, MINIGLIDER.parameters
    )
    assert force.tolist() == moment.tolist() == [0.0, 0.0, 0.0]


def test_flow_rotation_turns_the_speed_into_the_velocity():
    rng = np.random.default_rng(3)
    for velocity in rng.normal(size=(100, 3)):
        rotation = dynamics.flow_rotation(*dynamics.flow_angles(velocity))
        assert rotation @ [np.linalg.norm(velocity), 0, 0] == pytest.approx(velocity, abs=1e-14)


def test_hydrodynamic_forces_on_a_frozen_tail_take_energy():
    rng = np.random.default_rng(4)
    p = MINIGLIDER.parameters
    for velocity in rng.normal(size=(500, 3)) * [0.1, 0.01, 0.02] + [0.06, 0.0, 0.0]:
        force, _ = dynamics.hydrodynamic_wrench(velocity, np.zeros(3), 0.0, p)
        assert force @ velocity < 0.0


def without_water(parameters):
    """The same body in a vacuum: added mass stays, every coefficient is 0."""
    none = {
        name: 0.0
        for name in VehicleParameters.model_fields
        if name.startswith(("drag_", "side_", "lift_", "roll_", "pitch_", "yaw_"))
    }
    return parameters.model_copy(update=none)


def energy(state, inputs, p):
    mass = np.array([p.mass_1_kg, p.mass_2_kg, p.mass_3_kg])
    inertia = np.array([p.inertia_1_kg_m2, p.inertia_2_kg_m2, p.inertia_3_kg_m2])
    roll, pitch = state[3:5]
    kinetic = 0.5 * (mass @ state[6:9] ** 2 + inertia @ state[9:12] ** 2)
    hanging = p.offset_mass_kg * p.offset_mass_depth_m * math.cos(pitch) * math.cos(roll)
    sliding = -p.sliding_mass_kg * inputs[1] * math.sin(pitch)
    return kinetic - p.gravity_m_s2 * (inputs[0] * state[2] + hanging + sliding)


START = np.array([0, 0, 5, 0.2, -0.4, 0.3, 0.08, 0.01, 0.02, 0.1, 0.2, 0.05])


def tumbling_states(n):
    scale = [0, 0, 0, 0.3, 0.3, 1.0, 0.08, 0.02, 0.02, 0.1, 0.1, 0.1]
    return [START, *(np.random.default_rng(6).uniform(-1.0, 1.0, (n, 12)) * scale)]


@pytest.mark.parametrize("state", tumbling_states(8))
def test_a_body_without_hydrodynamics_keeps_its_energy(state):
    p = without_water(MINIGLIDER.parameters)
    inputs = np.array([0.01, 0.02, 0.5])
    later = kernel.rk4_step(state, inputs, p.packed(), 0.001, 20_000)
    exchanged = abs(0.01 * p.gravity_m_s2 * (later[2] - state[2]))
    assert exchanged > 0.01
    assert energy(later, inputs, p) == pytest.approx(energy(state, inputs, p), abs=1e-11)


def test_a_body_in_water_loses_the_energy_that_the_water_takes():
    p = MINIGLIDER.parameters
    inputs = np.array([0.01, 0.02, 0.5])
    states = [START]
    for _ in range(4000):
        states.append(kernel.rk4_step(states[-1], inputs, PACKED, 0.005, 1))
    powers = []
    for state in states:
        v, w = state[6:9], state[9:12]
        force, moment = dynamics.hydrodynamic_wrench(v, w, inputs[2], p)
        powers.append(force @ v + moment @ w)
    power = np.array(powers)
    work = 0.005 / 3.0 * (power[0] + 4 * power[1:-1:2].sum() + 2 * power[2:-1:2].sum() + power[-1])
    lost = energy(states[-1], inputs, p) - energy(START, inputs, p)
    assert lost < -0.05
    assert lost == pytest.approx(work, abs=1e-8)


def test_steps_converge_with_the_fourth_order():
    state = np.zeros(12)
    state[6] = 0.06
    inputs = np.array([0.01, 0.02, 0.4])
    exact = kernel.rk4_step(state, inputs, PACKED, 0.0025, 4000)
    errors = [
        np.linalg.norm(kernel.rk4_step(state, inputs, PACKED, dt, round(10 / dt)) - exact)
        for dt in (0.2, 0.1, 0.05)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 4.0) < 0.5)


@pytest.mark.parametrize(("dt", "error_m"), [(0.1, 1e-6), (0.02, 2e-9)])
def test_a_minute_of_gliding_is_exact_to_a_micrometre(dt, error_m):
    state = np.zeros(12)
    state[6] = 0.06
    inputs = np.array([0.01, 0.02, 0.3])
    exact = kernel.rk4_step(state, inputs, PACKED, 0.0025, 24_000)
    coarse = kernel.rk4_step(state, inputs, PACKED, dt, round(60 / dt))
    assert np.linalg.norm((coarse - exact)[:3]) < error_m


def test_a_long_run_mirrors_when_the_tail_does():
    state = np.array([0, 0, 5, 0.1, -0.3, 0.2, 0.06, 0.01, 0.0, 0.02, 0.01, -0.03])
    inputs = np.array([0.01, 0.02, 0.5])
    there = kernel.rk4_step(state, inputs, PACKED, 0.05, 2000)
    mirrored = kernel.rk4_step(state * MIRROR, inputs * [1, 1, -1], PACKED, 0.05, 2000)
    assert mirrored == pytest.approx(there * MIRROR, abs=1e-12)


def test_motion_does_not_depend_on_place_and_heading():
    state = np.array([0, 0, 5, 0.1, -0.3, 0.0, 0.06, 0.01, 0.0, 0.02, 0.01, -0.03])
    turned = state + np.array([7, -3, 2, 0, 0, 1.1, 0, 0, 0, 0, 0, 0])
    inputs = np.array([0.01, 0.02, 0.5])
    here = kernel.rk4_step(state, inputs, PACKED, 0.05, 400)
    there = kernel.rk4_step(turned, inputs, PACKED, 0.05, 400)
    assert there[6:] == pytest.approx(here[6:], abs=1e-13)
    way, turned_way = here[:2] - state[:2], there[:2] - turned[:2]
    c, s = math.cos(1.1), math.sin(1.1)
    assert turned_way == pytest.approx([c * way[0] - s * way[1], s * way[0] + c * way[1]])


def test_plain_python_runs_the_kernels_too():
    rng = np.random.default_rng(5)
    state, inputs = random_states(rng, 1)[0], random_inputs(rng, 1)[0]
    interpreted = kernel.state_derivative.py_func(state, inputs, PACKED)
    assert interpreted == pytest.approx(kernel.state_derivative(state, inputs, PACKED), rel=1e-13)
