import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.estimation.energy_use import Use
from autonomy.planner.capability import energy_of, motion_of, swimming_speed_m_s, time_unit_j
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import primitive
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.planner.work import CONTROL_SHARE, joules_per_unit, work_of
from autonomy.site import LAKE, TANK
from autonomy.vehicle.config import GRACE3, MINIGLIDER, VEHICLES, Vehicle
from autonomy.vehicle.extended_kernel import advance
from autonomy.vehicle.glide import NoSteadyGlideError, glide_inputs
from autonomy.vehicle.stability import stability
from autonomy.vehicle.steady import steady_glide
from autonomy.vehicle.surroundings import Surroundings

OWN = replace(
    MINIGLIDER,
    key="own",
    title="Own",
    parameters=MINIGLIDER.parameters.model_copy(
        update={"drag_0": 1.4, "lift_alpha": 28.0, "area_m2": 0.02, "pitch_alpha_m": 0.35}
    ),
    limits=MINIGLIDER.limits.model_copy(update={"m0_max_kg": 0.03, "m0_rate_kg_s": 0.003}),
    hull=MINIGLIDER.hull.model_copy(update={"tail_to_nose_m": 0.8}),
)
FLEET = {**VEHICLES, "own": OWN}
DEPTHS = {"miniglider": TANK.domain.depth_max_m, "grace3": LAKE.domain.depth_max_m, "own": 5.0}
CASES = [(key, depth) for key in FLEET for depth in (None, DEPTHS[key])]


@pytest.mark.parametrize(("key", "depth"), CASES)
@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_steady_stable_glides_exist_at_the_promised_speed_and_angles(key, depth, direction):
    vehicle = FLEET[key]
    motion = motion_of(vehicle, depth)
    speed = motion.glide_speed_m_s
    for angle in np.linspace(motion.glide_angle_min_rad, motion.glide_angle_max_rad, 4):
        inputs = glide_inputs(vehicle, direction * angle, speed)
        flown = steady_glide(vehicle.parameters, *inputs, extended=True)
        assert flown.glide_angle_rad == pytest.approx(direction * angle, abs=1e-6)
        assert flown.vertical_speed_m_s == pytest.approx(-direction * speed, rel=1e-6)
        plain = steady_glide(vehicle.parameters, *inputs)
        assert stability(vehicle.parameters, plain, *inputs).is_stable
        assert abs(inputs[0]) <= 2.0 / 3.0 * max(
            vehicle.limits.m0_max_kg if direction < 0.0 else -vehicle.limits.m0_min_kg, 0.0
        ) * (1.0 + 1e-6)


@pytest.mark.parametrize(("key", "depth"), CASES)
def test_actuators_change_over_within_half_of_the_shortest_glide(key, depth):
    vehicle = FLEET[key]
    motion = motion_of(vehicle, depth)
    for angle in (motion.glide_angle_min_rad, motion.glide_angle_max_rad):
        down = glide_inputs(vehicle, -angle, motion.glide_speed_m_s)
        up = glide_inputs(vehicle, angle, motion.glide_speed_m_s)
        change_s = max(
            abs(down[0] - up[0]) / vehicle.limits.m0_rate_kg_s,
            abs(down[1] - up[1]) / vehicle.limits.rp1_rate_m_s,
        )
        shortest_s = motion.depth_change_min_m / motion.glide_speed_m_s
        # the steepest glides move the sliding mass farther than the flattest, which set the speed
        assert change_s <= 0.75 * shortest_s


@pytest.mark.parametrize("key", FLEET)
def test_spirals_of_the_promised_sizes_exist_and_are_stable(key):
    vehicle = FLEET[key]
    motion = motion_of(vehicle, DEPTHS[key])
    inputs = glide_inputs(vehicle, math.radians(-45.0), motion.spiral_speed_m_s)
    for tail_deg, radius, rise in (
        (25.0, motion.spiral_radius_max_m, motion.spiral_rise_max_m_rad),
        (45.0, motion.spiral_radius_min_m, motion.spiral_rise_min_m_rad),
    ):
        tail = math.radians(tail_deg)
        flown = steady_glide(vehicle.parameters, *inputs, tail, extended=True)
        assert flown.turn_radius_m == pytest.approx(radius)
        assert abs(flown.vertical_speed_m_s / flown.turn_rate_rad_s) == pytest.approx(rise)
        plain = steady_glide(vehicle.parameters, *inputs, tail)
        assert stability(vehicle.parameters, plain, *inputs, tail).is_stable


@pytest.mark.parametrize("key", VEHICLES)
def test_flat_dives_and_swims_are_slower_than_the_robot_can(key):
    vehicle = FLEET[key]
    motion = motion_of(vehicle, DEPTHS[key])
    half = 0.5 * min(vehicle.limits.m0_max_kg, -vehicle.limits.m0_min_kg)
    for net in (half, -half):
        dive = steady_glide(vehicle.parameters, net, 0.0, extended=True)
        assert motion.dive_speed_m_s == pytest.approx(0.9 * abs(dive.vertical_speed_m_s), rel=0.01)
    assert motion.swim_speed_m_s == pytest.approx(0.75 * swimming_speed_m_s(vehicle))


@pytest.mark.parametrize("key", VEHICLES)
def test_the_presets_agree_with_what_the_vehicles_can_fly(key):
    made = motion_of(VEHICLES[key], DEPTHS[key])
    preset = PLANNER_PRESETS[key].primitives
    for name, tolerance in (
        ("glide_speed_m_s", 0.15),
        ("spiral_speed_m_s", 0.15),
        ("dive_speed_m_s", 0.05),
        ("swim_speed_m_s", 0.15),
        ("depth_change_min_m", 0.2),
        ("swim_length_min_m", 0.3),
        ("swim_length_max_m", 0.3),
        ("point_interval_s", 0.4),
    ):
        assert getattr(made, name) == pytest.approx(getattr(preset, name), rel=tolerance), name
    for name in ("glide_angle_min_rad", "glide_angle_max_rad"):
        assert getattr(made, name) == pytest.approx(getattr(preset, name), abs=math.radians(2.0))
    for name in ("spiral_radius", "spiral_rise"):
        unit = "m" if name == "spiral_radius" else "m_rad"
        low = max(getattr(one, f"{name}_min_{unit}") for one in (made, preset))
        high = min(getattr(one, f"{name}_max_{unit}") for one in (made, preset))
        assert low < high


@pytest.mark.parametrize("key", FLEET)
def test_what_a_vehicle_can_fly_makes_valid_settings(key):
    vehicle, site = FLEET[key], LAKE if key != "miniglider" else TANK
    motion = motion_of(vehicle, site.domain.depth_max_m)
    config = PlannerConfig(domain=site.domain, primitives=motion, energy=energy_of(vehicle, motion))
    assert PlannerConfig.model_validate_json(config.model_dump_json()) == config


def test_deeper_water_allows_faster_glides():
    shallow, deep = (motion_of(MINIGLIDER, depth) for depth in (0.5, 5.0))
    assert shallow.glide_speed_m_s < deep.glide_speed_m_s
    assert shallow.depth_change_min_m < deep.depth_change_min_m


def metered_j(vehicle: Vehicle, state, command, duration_s: float) -> float:
    """Energy that the full dynamics count, J."""
    flown = advance(
        np.append(state, 0.0), np.array(command), vehicle.packed(), Surroundings().packed(),
        0.0, 0.02, round(duration_s / 0.02),
    )  # fmt: skip
    return float(flown[15])


@pytest.mark.parametrize("key", VEHICLES)
def test_a_glide_takes_the_energy_that_the_dynamics_meter(key):
    vehicle = VEHICLES[key]
    motion = PLANNER_PRESETS[key].primitives
    middle = 0.5 * (motion.glide_angle_min_rad + motion.glide_angle_max_rad)
    down = glide_inputs(vehicle, -middle, motion.glide_speed_m_s)
    up = glide_inputs(vehicle, middle, motion.glide_speed_m_s)
    state = np.zeros(15)
    state[2], state[12:14] = 5.0, down
    took_j = metered_j(vehicle, state, (*up, 0.0, 0.0, 0.0), 200.0)
    work = work_of(vehicle, motion)
    assert took_j == pytest.approx(work.glide_j + 200.0 * work.electronics_w, rel=0.01)


def joules_of(vehicle, config, legs):
    """Electrical energy that legs take, without the surfacings between dives."""
    work, energy = work_of(vehicle, config.primitives), config.energy
    once = {"glide": work.glide_j, "swim": 0.0}
    tail_rate = 2.0 * math.pi * energy.tail_frequency_hz * energy.tail_amplitude_rad
    swims_s = sum(leg.duration_s for leg in legs if leg.kind == "swim")
    rest_j = sum(once[leg.kind] + work.electronics_w * leg.duration_s for leg in legs)
    return rest_j + work.tail_j_s_rad2 * 0.5 * tail_rate**2 * swims_s


@pytest.mark.parametrize("key", VEHICLES)
def test_a_swim_takes_the_energy_that_the_dynamics_meter(key):
    vehicle, config = VEHICLES[key], PLANNER_PRESETS[key]
    state = np.zeros(15)
    state[12] = 0.3 * vehicle.limits.m0_min_kg
    gait = vehicle.swim
    command = (state[12], 0.0, 0.0, gait.amplitude_rad, gait.frequency_hz)
    leg = primitive.swim(config, (0.0, 0.0, 0.0), (config.primitives.swim_speed_m_s * 200.0, 0, 0))
    expected = joules_of(vehicle, config, (leg,))
    # the servo lags behind its reference and so moves a little less
    assert metered_j(vehicle, state, command, 200.0) == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("key", VEHICLES)
def test_units_of_energy_stand_for_joules(key):
    vehicle, config = VEHICLES[key], PLANNER_PRESETS[key]
    depth = 3.0 * config.primitives.depth_change_min_m
    reach = depth / math.tan(math.radians(45.0))
    legs = (
        primitive.glide(config, (0.0, 0.0, 0.0), (reach, 0.0, depth)),
        primitive.glide(config, (reach, 0.0, depth), (2.0 * reach, 0.0, 0.0)),
    )
    control_w = CONTROL_SHARE[Use.GLIDE] * vehicle.energy.pump_full_w
    control_j = control_w * sum(leg.duration_s for leg in legs)
    joules = joules_of(vehicle, config, legs) + control_j
    per_unit = joules_per_unit(vehicle, config.primitives, config.energy)
    assert per_unit * sum(leg.energy for leg in legs) == pytest.approx(joules, rel=1e-6)


@pytest.mark.parametrize("key", VEHICLES)
def test_honest_prices_count_time_as_the_thesis_does_and_the_gait_as_it_is(key):
    vehicle, preset = VEHICLES[key], PLANNER_PRESETS[key].energy
    prices = energy_of(vehicle)
    assert prices.time_factor == preset.time_factor
    assert prices.time_factor * time_unit_j(vehicle) == pytest.approx(vehicle.energy.electronics_w)
    assert prices.tail_amplitude_rad == preset.tail_amplitude_rad
    assert prices.tail_frequency_hz == pytest.approx(preset.tail_frequency_hz, rel=0.02)
    assert prices.glide < preset.glide


def test_a_vehicle_that_cannot_glide_is_refused_with_the_reason():
    stuck = GRACE3.limits.model_copy(update={"rp1_min_m": -0.001, "rp1_max_m": 0.001})
    with pytest.raises(NoSteadyGlideError, match="sliding mass of this vehicle"):
        motion_of(replace(GRACE3, limits=stuck))
