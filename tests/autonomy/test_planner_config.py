import math
import subprocess
import sys

import pytest
from pydantic import BaseModel, ValidationError

from autonomy.planner.config import PlannerConfig, PrimitiveConfig, exploitation_at
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.site import LAKE, TANK, Box
from autonomy.vehicle.config import VEHICLES
from autonomy.vehicle.glide import glide_inputs
from autonomy.vehicle.steady import steady_glide

SITES = {"miniglider": TANK, "grace3": LAKE}


def models(model: type[BaseModel]):
    yield model
    for field in model.model_fields.values():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from models(field.annotation)


@pytest.mark.parametrize("key", PLANNER_PRESETS)
def test_a_preset_fits_its_site_and_survives_json(key):
    config = PLANNER_PRESETS[key]
    assert config.domain.is_inside(SITES[key].water)
    assert PlannerConfig.model_validate_json(config.model_dump_json()) == config


@pytest.mark.parametrize("key", PLANNER_PRESETS)
@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_the_vehicle_can_fly_every_glide_of_its_preset(key, direction):
    motion = PLANNER_PRESETS[key].primitives
    for angle in (motion.glide_angle_min_rad, motion.glide_angle_max_rad):
        m0, _ = glide_inputs(VEHICLES[key], direction * angle, motion.glide_speed_m_s)
        assert m0 * direction < 0.0


@pytest.mark.parametrize("key", PLANNER_PRESETS)
def test_actuators_change_over_within_half_of_the_shortest_glide(key):
    motion, vehicle = PLANNER_PRESETS[key].primitives, VEHICLES[key]
    shortest_s = motion.depth_change_min_m / motion.glide_speed_m_s
    flattest = motion.glide_angle_min_rad
    down = glide_inputs(vehicle, -flattest, motion.glide_speed_m_s)
    up = glide_inputs(vehicle, flattest, motion.glide_speed_m_s)
    pump_s = abs(down[0] - up[0]) / vehicle.limits.m0_rate_kg_s
    slide_s = abs(down[1] - up[1]) / vehicle.limits.rp1_rate_m_s
    assert max(pump_s, slide_s) < shortest_s / 2.0


@pytest.mark.parametrize("key", PLANNER_PRESETS)
def test_dives_are_as_fast_as_part_of_the_pump_allows(key):
    vehicle = VEHICLES[key]
    speed = PLANNER_PRESETS[key].primitives.dive_speed_m_s
    mass = 0.5 * min(vehicle.limits.m0_max_kg, -vehicle.limits.m0_min_kg)
    for net in (mass, -mass):
        motion = steady_glide(vehicle.parameters, net, 0.0, extended=True)
        assert abs(motion.vertical_speed_m_s) > speed


@pytest.mark.parametrize("key", PLANNER_PRESETS)
def test_spirals_are_those_of_the_tail_between_20_and_60_degrees(key):
    motion, vehicle = PLANNER_PRESETS[key].primitives, VEHICLES[key]
    m0, rp1 = glide_inputs(vehicle, math.radians(-45.0), motion.glide_speed_m_s)
    wide, tight = (
        steady_glide(vehicle.parameters, m0, rp1, math.radians(tail), extended=True)
        for tail in (20.0, 60.0)
    )
    low, high = motion.spiral_radius_min_m, motion.spiral_radius_max_m
    assert tight.turn_radius_m < low < high < wide.turn_radius_m
    rises = [abs(one.vertical_speed_m_s / one.turn_rate_rad_s) for one in (tight, wide)]
    assert rises[0] < motion.spiral_rise_min_m_rad < motion.spiral_rise_max_m_rad < rises[1]


@pytest.mark.parametrize("key", PLANNER_PRESETS)
def test_the_tail_servo_can_follow_the_swimming_gait(key):
    energy, vehicle = PLANNER_PRESETS[key].energy, VEHICLES[key]
    rate = 2.0 * math.pi * energy.tail_frequency_hz * energy.tail_amplitude_rad
    assert rate <= vehicle.limits.delta_rate_rad_s


def test_every_field_says_what_it_is():
    for model in models(PlannerConfig):
        for name, field in model.model_json_schema()["properties"].items():
            assert field.get("title"), f"{model.__name__}.{name} has no title"
            assert field.get("description"), f"{model.__name__}.{name} has no help"


def test_an_operator_meets_few_fields_first():
    fields = PlannerConfig.model_fields
    first = [name for name in fields if not fields[name].json_schema_extra["advanced"]]
    assert first == [
        "domain",
        "area",
        "total_budget",
        "round_budget",
        "time_budget_s",
        "objective",
        "max_uncertainty_m",
        "planning_time_s",
        "fidelity_thresholds_m",
        "keep_outs",
        "current",
    ]


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"round_budget": 90.0}, "round_budget must not exceed total_budget"),
        ({"fidelity_thresholds_m": (0.2, 0.1)}, "ascend strictly"),
        ({"fidelity_thresholds_m": (0.0, 0.1)}, "must be positive"),
        ({"domain": Box(depth_max_m=0.05)}, "depth_change_min_m"),
        ({"search": {"near_radius_m": 2.0}}, "near_radius_m must not exceed step_m"),
        ({"primitives": {"swim_length_min_m": 2.0}}, "swim_length_max_m must not be less"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(values, reason):
    with pytest.raises(ValidationError, match=reason):
        PlannerConfig.model_validate(values)


TRIANGLE = {"name": "Moorings", "corners_m": ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))}


@pytest.mark.parametrize(
    ("corners", "reason"),
    [
        (((0.0, 0.0), (1.0, 1.0)), "3 to 256 corners, not 2"),
        (((0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)), "corners_m crosses itself"),
        (((0.0, 0.0), (1.0, 1.0), (2.0, 2.0)), "encloses no area"),
        (((0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (0.0, 1.0)), "same corner twice"),
        (((0.0, 0.0), (1.0, math.nan), (0.0, 1.0)), "finite"),
    ],
)
def test_a_keep_out_that_is_no_area_is_refused_by_its_place_in_the_settings(corners, reason):
    with pytest.raises(ValidationError, match=reason) as refusal:
        PlannerConfig.model_validate({"keep_outs": [{"name": "Nets", "corners_m": corners}]})
    assert refusal.value.errors()[0]["loc"][:3] == ("keep_outs", 0, "corners_m")


def test_two_keep_outs_of_one_name_are_refused():
    with pytest.raises(ValidationError, match="different names"):
        PlannerConfig.model_validate({"keep_outs": [TRIANGLE, TRIANGLE]})


def test_settings_stored_before_there_were_keep_outs_and_currents_are_still_valid():
    stored = PLANNER_PRESETS["grace3"].model_dump()
    for name in ("keep_outs", "current", "margin_m", "floor_margin_m", "adaptive", "target_std"):
        del stored[name]
    for name in ("time_budget_s", "satellite_bytes", "information_weight"):
        del stored[name]
    del stored["mission"]["surfacing_bytes"]
    del stored["ergodic"]["schedule"], stored["ergodic"]["exploitation_end"]
    config = PlannerConfig.model_validate(stored)
    assert config.keep_outs == ()
    assert (config.current.north_m_s, config.current.east_m_s) == (0.0, 0.0)


def test_exploitation_follows_its_schedule_over_the_budget():
    def over(schedule, end=0.8):
        ergodic = {"exploitation": 0.2, "exploitation_end": end, "schedule": schedule}
        config = PlannerConfig.model_validate({"ergodic": ergodic})
        return [exploitation_at(config, share) for share in (0.0, 0.25, 0.5, 1.0, 1.2)]

    assert over("constant") == [0.2] * 5
    assert over("switch") == [0.2, 0.2, 0.8, 0.8, 0.8]
    assert over("linear") == pytest.approx([0.2, 0.35, 0.5, 0.8, 0.8])
    assert over("linear", end=None) == [0.2] * 5


def test_unknown_settings_are_refused():
    with pytest.raises(ValidationError, match="extra"):
        PrimitiveConfig.model_validate({"glide_speed": 0.1})


def test_settings_load_without_the_compiler():
    code = "import autonomy.planner.preset, sys; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=240).returncode == 0
