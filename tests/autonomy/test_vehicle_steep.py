"""Robots on their heads and tails, where Euler angles are singular."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autonomy.frames import rotation_ned_from_body
from autonomy.vehicle import steep_kernel
from autonomy.vehicle.config import GRACE3, MINIGLIDER, VEHICLES
from autonomy.vehicle.extended_kernel import STEEP_COS_PITCH, advance
from autonomy.vehicle.steady import steady_glide
from autonomy.vehicle.surroundings import Surroundings

OPEN = Surroundings().packed()
MASSES = ("mass_1_kg", "mass_2_kg", "mass_3_kg")
INERTIAS = ("inertia_1_kg_m2", "inertia_2_kg_m2", "inertia_3_kg_m2")


def without_water(vehicle):
    groups = ("drag_", "side_", "lift_", "roll_", "pitch_", "yaw_", "crossflow_")
    fields = type(vehicle.parameters).model_fields
    none = dict.fromkeys([name for name in fields if name.startswith(groups)], 0.0)
    return dataclasses.replace(vehicle, parameters=vehicle.parameters.model_copy(update=none))


def momentum_ned(state, p):
    mass = np.array([getattr(p, name) for name in MASSES])
    return rotation_ned_from_body(*state[3:6]) @ (mass * state[6:9])


def energy(state, p):
    mass, inertia = (np.array([getattr(p, n) for n in names]) for names in (MASSES, INERTIAS))
    kinetic = 0.5 * (mass @ state[6:9] ** 2 + inertia @ state[9:12] ** 2)
    hanging = p.offset_mass_kg * p.offset_mass_depth_m * math.cos(state[4]) * math.cos(state[3])
    return kinetic - p.gravity_m_s2 * hanging


@pytest.mark.parametrize(
    "turning",
    [(0.0, 3.0, 0.0), (0.01, 3.0, 0.0), (0.05, 3.0, 0.02), (0.3, 4.0, 0.2), (1.0, -3.0, 1.0)],
)
@pytest.mark.parametrize("pitch", [0.0, math.pi / 2, -math.pi / 2, 1.5])
def test_a_looping_body_keeps_momentum_and_energy(turning, pitch):
    vehicle = without_water(MINIGLIDER)
    p = vehicle.parameters
    state = np.zeros(15)
    state[2], state[3], state[4] = 50.0, 1e-4, pitch
    state[6:9], state[9:12] = (0.05, 0.02, 0.01), turning
    momentum, start = momentum_ned(state, p), energy(state, p)
    steepest = math.inf
    for _ in range(200):
        state = advance(state, np.zeros(5), vehicle.packed(), OPEN, 0.0, 0.005, 4)
        steepest = min(steepest, abs(math.cos(state[4])))
        assert abs(state[4]) <= math.pi / 2
        assert np.all(np.isfinite(state))
    assert steepest < STEEP_COS_PITCH or turning[0] == 1.0
    assert momentum_ned(state, p) == pytest.approx(momentum, abs=1e-7)
    assert energy(state, p) == pytest.approx(start, abs=1e-7)


def test_turning_an_attitude_is_a_rotation_in_body_axes():
    rng = np.random.default_rng(31)
    for _ in range(300):
        roll, pitch, heading = rng.uniform(-1, 1, 3) * [math.pi, math.pi / 2, math.pi]
        if rng.random() < 0.3:
            pitch = math.copysign(math.pi / 2, pitch)
        turn = rng.normal(size=3) * rng.choice([0.0, 1e-12, 1e-3, 1.0])
        start = steep_kernel.attitude_quaternion(roll, pitch, heading)
        found = rotation_ned_from_body(*steep_kernel.turn_attitude(start, *turn))
        before = rotation_ned_from_body(roll, pitch, heading)
        expected = before @ Rotation.from_rotvec(turn).as_matrix()
        assert found == pytest.approx(expected, abs=2e-6)
        level = np.hypot(*expected[:2, 0])
        if level > 1e-3:
            assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_an_ascent_at_full_limits_settles_steeply(vehicle):
    limits = vehicle.limits
    command = np.array([limits.m0_min_kg, limits.rp1_min_m, 0.0, 0.0, 0.0])
    state = np.zeros(15)
    state[2] = 500.0
    settled = advance(state, command, vehicle.packed(), OPEN, 0.0, 0.05, 12_000)
    glide = steady_glide(vehicle.parameters, *command[:2], extended=True)
    assert math.degrees(settled[4]) > 75.0
    assert settled[4] == pytest.approx(glide.pitch_rad, abs=1e-6)
    assert settled[6:9] == pytest.approx(glide.velocity_m_s, abs=1e-6)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_glide_that_needs_no_euler_angles_settles_like_any_other(way):
    limits = GRACE3.limits.model_copy(update={"rp1_min_m": -0.6, "rp1_max_m": 0.6})
    vehicle = dataclasses.replace(GRACE3, limits=limits)
    m0, rp1 = -0.15 * way, -0.55 * way
    state = np.zeros(15)
    state[2] = 1000.0
    command = np.array([m0, rp1, 0.0, 0.0, 0.0])
    settled = advance(state, command, vehicle.packed(), OPEN, 0.0, 0.05, 12_000)
    glide = steady_glide(vehicle.parameters, m0, rp1, extended=True)
    assert math.cos(glide.pitch_rad) < STEEP_COS_PITCH
    assert settled[4] == pytest.approx(glide.pitch_rad, abs=1e-6)
    assert settled[6:9] == pytest.approx(glide.velocity_m_s, abs=1e-6)


def test_a_flapping_robot_on_its_tail_counts_its_energy_and_stays_finite():
    state = np.zeros(16)
    state[2], state[4] = 20.0, 1.56
    state[9:12] = (0.5, 0.0, 0.7)
    command = np.array([-0.0279, -0.0555, 0.5, 0.4, 0.4])
    packed = MINIGLIDER.packed()
    for i in range(100):
        state = advance(state, command, packed, OPEN, 0.1 * i, 0.02, 5)
        assert np.all(np.isfinite(state))
    assert state[15] > 10.0 * MINIGLIDER.energy.electronics_w
