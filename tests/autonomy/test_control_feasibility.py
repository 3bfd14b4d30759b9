"""References that a vehicle cannot follow are refused with the limit that they break."""

import math

import numpy as np
import pytest

from autonomy.control.feasibility import (
    InfeasibleReferenceError,
    check_reference,
    check_swim,
    glide_envelope,
)
from autonomy.control.reference.swimming import swimming_speed
from autonomy.control.trajectory import THESIS_REFERENCES, Reference, straight_glide
from autonomy.vehicle.config import MINIGLIDER, VEHICLES
from autonomy.vehicle.extended_kernel import advance
from autonomy.vehicle.steady import steady_glide
from autonomy.vehicle.surroundings import Surroundings
from autonomy.whatif.config import TRIAL_PRESETS
from autonomy.whatif.setting import reference_function


def glide(velocity, pitch):
    return lambda time_s: straight_glide((0.0, 0.0, 0.0), velocity, pitch, time_s)


@pytest.mark.parametrize("trajectory", THESIS_REFERENCES)
def test_the_trajectories_of_the_thesis_are_accepted(trajectory):
    check_reference(MINIGLIDER, trajectory, 540.0)


@pytest.mark.parametrize("key", VEHICLES)
def test_the_scenario_that_a_form_starts_with_is_accepted(key):
    config = TRIAL_PRESETS[key]
    check_reference(VEHICLES[key], reference_function(VEHICLES[key], config), config.duration_s)


@pytest.mark.parametrize(
    ("trajectory", "words"),
    [
        (glide((0.05, 0.0, 0.2), -0.7), r"sinks at 20\.0 cm/s; the buoyancy allows at most 8\."),
        (glide((0.05, 0.0, -0.3), 0.7), r"rises at 30\.0 cm/s"),
        (glide((0.2, 0.0, 0.05), -0.3), r"20\.0 cm/s ahead; a glide reaches at most 7\."),
        (glide((0.06, 0.0, 0.005), -0.05), r"glides no flatter than 3\d\.\d deg"),
        (glide((0.03, 0.0, 0.04), -1.2), r"sliding mass at \d+ mm; it reaches -5\d to 44 mm"),
        (glide((0.03, 0.0, 0.04), -1.5), r"pitches to 86 deg"),
        (
            lambda t: Reference(
                (0.03 * t, 0.0, 0.03 * t), -0.7, (0.03, 0.0, 0.03), 0.5 * math.cos(t)
            ),
            r"mm/s; it reaches 12\.5 mm/s",
        ),
        (lambda t: Reference((math.nan, 0.0, 0.0), 0.0), "not finite"),
    ],
)
def test_a_reference_beyond_a_limit_is_refused_by_its_name(trajectory, words):
    with pytest.raises(InfeasibleReferenceError, match=words):
        check_reference(MINIGLIDER, trajectory, 100.0)


def test_the_envelope_holds_every_steady_glide_and_its_fastest_dive():
    down = glide_envelope(MINIGLIDER, down=True)
    limits = MINIGLIDER.limits
    for net_mass in (0.005, limits.m0_max_kg):
        for sliding in (0.010, 0.030, limits.rp1_max_m):
            motion = steady_glide(MINIGLIDER.parameters, net_mass, sliding, extended=True)
            assert motion.vertical_speed_m_s <= 1.01 * down.vertical_m_s
            assert motion.horizontal_speed_m_s <= 1.01 * down.horizontal_m_s
    assert down.vertical_m_s == pytest.approx(motion.vertical_speed_m_s, rel=0.05)


@pytest.mark.parametrize("key", VEHICLES)
def test_the_swimming_speed_is_about_the_models(key):
    vehicle = VEHICLES[key]
    state, water = np.zeros(15), Surroundings().packed()
    state[2] = 5.0
    gait = vehicle.swim
    command = np.array([0.0, gait.rp1_m, 0.0, gait.amplitude_rad, gait.frequency_hz])
    settled = advance(state, command, vehicle.packed(), water, 0.0, 0.02, 10_000)
    later = advance(settled, command, vehicle.packed(), water, 200.0, 0.02, 2_500)
    speed = np.linalg.norm(later[:3] - settled[:3]) / 50.0
    assert swimming_speed(vehicle) == pytest.approx(speed, rel=0.15)


def test_a_swim_faster_than_the_gait_is_refused():
    check_swim(MINIGLIDER, glide((0.05, 0.05, 0.0), 0.0), 10.0)
    with pytest.raises(InfeasibleReferenceError, match=r"12\.0 cm/s; Miniglider swims at most 8"):
        check_swim(MINIGLIDER, glide((0.12, 0.0, 0.0), 0.0), 10.0)
