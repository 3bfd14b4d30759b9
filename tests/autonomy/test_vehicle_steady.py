import json
import math
from pathlib import Path

import numpy as np
import pytest

from autonomy.vehicle import extended_kernel
from autonomy.vehicle.config import MINIGLIDER, VEHICLES
from autonomy.vehicle.glide import NoSteadyGlideError, angle_of_attack, glide_inputs
from autonomy.vehicle.steady import steady_glide
from autonomy.vehicle.surroundings import Surroundings

GOLDEN = json.loads((Path(__file__).parent / "golden_vehicle.json").read_text())
MODEL = MINIGLIDER.parameters


@pytest.mark.parametrize("case", GOLDEN["glide"])
def test_steady_glides_are_those_of_the_golden_vectors(case):
    glide = steady_glide(MODEL, *case["U"])
    assert glide.velocity_m_s == pytest.approx(case["v"], rel=1e-6, abs=1e-12)
    assert glide.roll_rad == pytest.approx(case["phi"], rel=1e-6, abs=1e-12)
    assert glide.pitch_rad == pytest.approx(case["theta"], rel=1e-6)
    assert glide.vertical_speed_m_s == pytest.approx(case["zdot"], rel=1e-6)
    assert glide.turn_rate_rad_s == pytest.approx(case["psidot"], rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(
    ("m0_g", "rp1_mm", "pitch", "path", "alpha", "speed_cm_s", "down_cm_s"),
    [
        (3, 10, -17.5, -34.9, 17.4, 2.15, 1.23),
        (20, 30, -36.6, -41.2, 4.6, 9.47, 6.24),
        (22.5, 44.5, -46.3, -49.1, 2.8, 11.16, 8.43),
        (-10, -20, 38.6, 45.9, -7.3, 6.46, -4.64),
        (-27.9, -55.5, 75.3, 77.7, -2.4, 14.21, -13.89),
        (10, 0, 0.2, -59.7, 59.9, 1.71, 1.47),
    ],
)
def test_polar_is_the_published_one(m0_g, rp1_mm, pitch, path, alpha, speed_cm_s, down_cm_s):
    glide = steady_glide(MODEL, m0_g / 1e3, rp1_mm / 1e3)
    assert math.degrees(glide.pitch_rad) == pytest.approx(pitch, abs=0.06)
    assert math.degrees(glide.glide_angle_rad) == pytest.approx(path, abs=0.06)
    assert math.degrees(glide.alpha_rad) == pytest.approx(alpha, abs=0.06)
    assert glide.speed_m_s * 100 == pytest.approx(speed_cm_s, abs=0.006)
    assert glide.vertical_speed_m_s * 100 == pytest.approx(down_cm_s, abs=0.006)
    assert glide.turn_radius_m == math.inf


@pytest.mark.parametrize(
    ("tail_deg", "turn_deg_s", "radius_m"),
    [(20, -1.43, 1.65), (45, -2.47, 0.60), (90, -3.25, 0.20), (110, -3.41, 0.15)],
)
def test_spirals_turn_to_port_with_positive_tail_and_mirror(tail_deg, turn_deg_s, radius_m):
    port = steady_glide(MODEL, 0.010, 0.020, math.radians(tail_deg))
    assert math.degrees(port.turn_rate_rad_s) == pytest.approx(turn_deg_s, abs=0.006)
    assert port.turn_radius_m == pytest.approx(radius_m, abs=0.006)
    starboard = steady_glide(MODEL, 0.010, 0.020, -math.radians(tail_deg))
    assert starboard.turn_rate_rad_s == pytest.approx(-port.turn_rate_rad_s, rel=1e-9)
    assert starboard.pitch_rad == pytest.approx(port.pitch_rad, rel=1e-9)
    assert starboard.vertical_speed_m_s == pytest.approx(port.vertical_speed_m_s, rel=1e-9)


def test_net_mass_says_up_or_down():
    assert steady_glide(MODEL, 0.01, 0.02).vertical_speed_m_s > 0.0
    assert steady_glide(MODEL, -0.01, -0.02).vertical_speed_m_s < 0.0


def test_a_neutral_vehicle_does_not_glide():
    with pytest.raises(NoSteadyGlideError, match="neutrally buoyant"):
        steady_glide(MODEL, 0.0, 0.02)


def test_a_model_that_runs_away_has_no_steady_glide():
    absurd = MODEL.model_copy(update={"inertia_2_kg_m2": 1e-9, "pitch_damping_m_s": 1e3})
    with pytest.raises(NoSteadyGlideError, match="grows without bound"):
        steady_glide(absurd, 0.01, 0.02)


def test_straight_down_needs_no_lift():
    alpha = angle_of_attack(MODEL, -math.pi / 2)
    assert alpha == pytest.approx(-MODEL.lift_0 / MODEL.lift_alpha, abs=1e-12)


def test_sinking_tail_first_with_the_tail_turned_settles_nowhere():
    with pytest.raises(NoSteadyGlideError, match=r"net mass 15\.0 g, sliding mass -12\.6 mm"):
        steady_glide(MODEL, 0.015, -0.0126, math.radians(104))


@pytest.mark.parametrize(
    ("key", "path_deg", "down_m_s"),
    [
        ("miniglider", -40, 0.03),
        ("miniglider", -50, 0.02),
        ("miniglider", 55, 0.05),
        ("grace3", -45, 0.08),
        ("grace3", 50, 0.06),
    ],
)
def test_glide_inputs_give_the_glide_that_was_asked_for(key, path_deg, down_m_s):
    vehicle = VEHICLES[key]
    m0, rp1 = glide_inputs(vehicle, math.radians(path_deg), down_m_s)
    glide = steady_glide(vehicle.parameters, m0, rp1, extended=True)
    assert math.degrees(glide.glide_angle_rad) == pytest.approx(path_deg, abs=1e-6)
    assert abs(glide.vertical_speed_m_s) == pytest.approx(down_m_s, rel=1e-9)
    alpha = angle_of_attack(vehicle.parameters, math.radians(path_deg))
    assert glide.alpha_rad == pytest.approx(alpha, abs=1e-9)


@pytest.mark.parametrize(("key", "path_deg"), [("miniglider", -45), ("grace3", 50)])
def test_a_robot_given_glide_inputs_flies_that_glide(key, path_deg):
    vehicle = VEHICLES[key]
    m0, rp1 = glide_inputs(vehicle, math.radians(path_deg), 0.03)
    command = np.array([m0, rp1, 0.0, 0.0, 0.0])
    state = np.zeros(15)
    state[2] = 500.0
    water = Surroundings().packed()
    settled = extended_kernel.advance(state, command, vehicle.packed(), water, 0.0, 0.05, 12_000)
    later = extended_kernel.advance(settled, command, vehicle.packed(), water, 0.0, 0.05, 200)
    north, _, down = (later - settled)[:3] / 10.0
    assert abs(down) == pytest.approx(0.03, rel=1e-3)
    assert math.degrees(math.atan2(-down, north)) == pytest.approx(path_deg, abs=0.1)


@pytest.mark.parametrize(
    ("path_deg", "down_m_s", "words"),
    [
        (-25, 0.02, "flatter than this vehicle glides"),
        (-45, 0.08, "net mass of 25.5 g; the pump reaches -27.9 to 22.5 g"),
        (-60, 0.02, "sliding mass at 52.3 mm; it reaches -55.5 to 44.5 mm"),
    ],
)
def test_impossible_glides_are_refused_with_the_reason(path_deg, down_m_s, words):
    with pytest.raises(NoSteadyGlideError, match=words):
        glide_inputs(MINIGLIDER, math.radians(path_deg), down_m_s)
