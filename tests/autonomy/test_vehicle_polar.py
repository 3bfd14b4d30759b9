"""Stability of steady motions, and the polar, against the published figures and real runs."""

import dataclasses
import math

import numpy as np
import pytest

from autonomy.vehicle import kernel
from autonomy.vehicle.config import GRACE3, MINIGLIDER, VEHICLES
from autonomy.vehicle.polar import polar
from autonomy.vehicle.stability import COORDINATES, stability
from autonomy.vehicle.steady import SteadyGlide, steady_glide

MODEL = MINIGLIDER.parameters
REST = SteadyGlide(0.0, 0.0, (0.0, 0.0, 0.0), 0.0)


def growth(m0_g, rp1_mm, tail_deg=0.0):
    inputs = m0_g / 1e3, rp1_mm / 1e3, math.radians(tail_deg)
    return stability(MODEL, steady_glide(MODEL, *inputs), *inputs)


@pytest.mark.parametrize(
    ("m0_g", "rp1_mm"),
    [(3, 10), (3, 30), (10, 20), (20, 30), (22.5, 44.5), (-10, -20), (-27.9, -55.5), (10, 0)],
)
def test_published_glides_are_stable(m0_g, rp1_mm):
    assert growth(m0_g, rp1_mm).is_stable


@pytest.mark.parametrize("tail_deg", [-110, -20, 20, 45, 90, 110])
def test_published_spirals_are_stable(tail_deg):
    assert growth(10, 20, tail_deg).is_stable


def test_sinking_with_the_mass_aft_is_unstable_as_published():
    found = growth(10, -20)
    assert not found.is_stable
    assert found.greatest_growth_per_s == pytest.approx(0.0014, abs=0.00005)


def test_a_resting_robot_swings_undamped_like_a_pendulum():
    eigenvalues = stability(MODEL, REST, 0.0, 0.0).eigenvalues
    assert eigenvalues.shape == (len(COORDINATES),)
    hang = MODEL.offset_mass_kg * MODEL.gravity_m_s2 * MODEL.offset_mass_depth_m
    for inertia in (MODEL.inertia_1_kg_m2, MODEL.inertia_2_kg_m2):
        nearest = np.abs(eigenvalues - 1j * math.sqrt(hang / inertia)).min()
        assert nearest < 1e-6
    assert math.sqrt(hang / MODEL.inertia_2_kg_m2) == pytest.approx(1.08, abs=0.005)


def test_eigenvalues_come_in_pairs_fastest_growth_first():
    eigenvalues = growth(10, 20, 30).eigenvalues
    assert np.all(np.diff(eigenvalues.real) <= 0.0)
    assert np.sort_complex(eigenvalues.conj()) == pytest.approx(np.sort_complex(eigenvalues))


@pytest.mark.parametrize(("m0_g", "rp1_mm", "tail_deg"), [(10, 20, 0), (10, 20, 45), (10, -20, 0)])
def test_a_small_push_grows_or_decays_as_the_eigenvalues_say(m0_g, rp1_mm, tail_deg):
    inputs = np.array([m0_g / 1e3, rp1_mm / 1e3, math.radians(tail_deg)])
    motion = steady_glide(MODEL, *inputs)
    found = stability(MODEL, motion, *inputs)
    sr, cr = math.sin(motion.roll_rad), math.cos(motion.roll_rad)
    sp, cp = math.sin(motion.pitch_rad), math.cos(motion.pitch_rad)
    turning = motion.turn_rate_rad_s * np.array([-sp, sr * cp, cr * cp])
    angles = [motion.roll_rad, motion.pitch_rad, 0.0]
    steady = np.array([0.0, 0.0, 5.0, *angles, *motion.velocity_m_s, *turning])
    deviations = []
    pushed = steady.copy()
    pushed[[3, 4, 7]] += 1e-7
    slowest = found.eigenvalues[0]
    # whole turns of the slowest pair, so that its phase is the same at both looks
    wait = 5.0 / abs(slowest.real) if slowest.imag == 0.0 else 2 * math.pi / slowest.imag
    wait *= max(1, round(5.0 / (abs(slowest.real) * wait)))
    for seconds in (wait, 2.0 * wait):
        steps = round(seconds / 0.05)
        dt = seconds / steps
        away = kernel.rk4_step(pushed, inputs, MODEL.packed(), dt, steps)
        straight = kernel.rk4_step(steady, inputs, MODEL.packed(), dt, steps)
        deviations.append(np.linalg.norm((away - straight)[[3, 4, 6, 7, 8, 9, 10, 11]]))
    measured = math.log(deviations[1] / deviations[0]) / wait
    assert measured == pytest.approx(found.greatest_growth_per_s, rel=0.05)


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_the_polar_holds_the_steady_glides(vehicle):
    limits = vehicle.limits
    m0 = np.array([0.9 * limits.m0_min_kg, 0.2 * limits.m0_max_kg, limits.m0_max_kg])
    rp1 = np.linspace(limits.rp1_min_m, limits.rp1_max_m, 4)
    whole = polar(vehicle, m0, rp1)
    for i, one_m0 in enumerate(m0):
        for k, one_rp1 in enumerate(rp1):
            glide = steady_glide(vehicle.parameters, one_m0, one_rp1)
            assert whole.speed_m_s[i, k] == pytest.approx(glide.speed_m_s, rel=1e-6)
            assert whole.pitch_rad[i, k] == pytest.approx(glide.pitch_rad, rel=1e-6)
            assert whole.angle_of_attack_rad[i, k] == pytest.approx(glide.alpha_rad, rel=1e-6)
            assert whole.glide_angle_rad[i, k] == pytest.approx(glide.glide_angle_rad, rel=1e-6)
            down, across = glide.vertical_speed_m_s, glide.horizontal_speed_m_s
            assert whole.vertical_speed_m_s[i, k] == pytest.approx(down, rel=1e-6)
            assert whole.horizontal_speed_m_s[i, k] == pytest.approx(across, rel=1e-6)
            found = stability(vehicle.parameters, glide, one_m0, one_rp1)
            assert whole.greatest_growth_per_s[i, k] == pytest.approx(
                found.greatest_growth_per_s, abs=1e-7
            )


def test_the_whole_polar_reaches_from_end_stop_to_end_stop():
    whole = polar(GRACE3)
    limits = GRACE3.limits
    assert whole.speed_m_s.shape == (21, 21)
    assert whole.m0_kg[[0, -1]].tolist() == [limits.m0_min_kg, limits.m0_max_kg]
    assert whole.rp1_m[[0, -1]].tolist() == [limits.rp1_min_m, limits.rp1_max_m]
    assert np.all(np.isfinite(whole.speed_m_s))


def test_pairs_of_opposite_sign_are_unstable_and_pairs_of_one_sign_stable():
    whole = polar(MINIGLIDER)
    m0, rp1 = np.meshgrid(whole.m0_kg, whole.rp1_m, indexing="ij")
    strong = np.abs(rp1) > 0.02
    same = np.sign(m0) == np.sign(rp1)
    assert np.all(whole.stable[strong & same])
    assert not np.any(whole.stable[strong & ~same])


def test_a_neutral_robot_has_no_glide():
    whole = polar(MINIGLIDER, np.array([-0.01, 0.0, 0.01]), np.array([0.02]))
    assert np.isfinite(whole.speed_m_s[:, 0]).tolist() == [True, False, True]
    assert np.isnan(whole.greatest_growth_per_s[1, 0])
    assert not whole.stable[1, 0]


def test_water_that_pushes_instead_of_drags_has_no_glide():
    odd = dataclasses.replace(
        MINIGLIDER, parameters=MODEL.model_copy(update={"drag_0": -1e6, "drag_alpha": 0.0})
    )
    assert np.all(np.isnan(polar(odd).speed_m_s))


def test_a_model_without_lift_and_drag_at_the_bow_warns_of_nothing():
    bare = {"drag_0": 0.0, "lift_0": 0.0}
    odd = dataclasses.replace(MINIGLIDER, parameters=MODEL.model_copy(update=bare))
    assert polar(odd, np.array([0.01]), np.array([0.0, 0.02])).speed_m_s.shape == (1, 2)
