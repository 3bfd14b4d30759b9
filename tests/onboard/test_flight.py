"""Parts of the onboard program by themselves: course, account, aim, attitude."""

import ast
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import onboard
import onboard.node
from autonomy.planner.leg import primitive
from autonomy.vehicle.config import VEHICLES
from onboard.flight.account import EnergyAccount
from onboard.flight.course import anchored_end, dive_ends
from onboard.flight.depth_change import DepthProfile
from onboard.flight.hardware import Readings, SetPoints
from onboard.flight.navigation import Navigator
from onboard.flight.pitch_aim import GlidePolar
from simulator.fleet import MINI_1
from tests.simulator.flight import TANK_PLANNER, horizontal, vee

offsets = st.floats(min_value=-1.0, max_value=1.0)


def test_dives_end_at_each_surfacing_and_at_the_last_leg():
    down, up = vee()
    swim = primitive.swim(TANK_PLANNER, up.end_ned, (2.0, 1.0, 0.0))
    sink = primitive.dive(TANK_PLANNER, swim.end_ned, 0.4)
    assert dive_ends((down, up, swim, sink)) == (1, 1, 2, 3)


@given(north=offsets, east=offsets)
def test_error_of_the_start_is_taken_back_until_the_last_leg_ends_as_planned(north, east):
    legs = vee()
    start = (legs[0].start_ned[0] + north, legs[0].start_ned[1] + east)
    middle = anchored_end(legs, *start)
    end = anchored_end(legs[1:], *middle[:2])
    assert end == pytest.approx(legs[1].end_ned)
    assert horizontal(middle, legs[0].end_ned) == pytest.approx(0.5 * math.hypot(north, east))


def test_leg_that_cannot_steer_keeps_the_error_for_those_that_can():
    sink = primitive.dive(TANK_PLANNER, (0.5, 0.5, 0.0), 0.4)
    rise = primitive.glide(TANK_PLANNER, sink.end_ned, (0.9, 0.5, 0.0))
    assert anchored_end((sink, rise), 0.6, 0.3)[:2] == pytest.approx((0.6, 0.3))
    assert anchored_end((rise,), 0.6, 0.3) == rise.end_ned


def test_legs_flown_as_planned_cost_what_was_planned():
    account = EnergyAccount(TANK_PLANNER.energy)
    legs = vee()
    for leg in legs:
        account.begin_leg(leg)
        for share in (0.2, 0.1, 0.7, 1.0):
            account.fly_leg(share)
            account.pass_time(leg.duration_s / 4.0)
    account.end_leg()
    assert account.used == pytest.approx(sum(leg.energy for leg in legs))


def test_broken_off_leg_costs_the_part_that_was_flown():
    account = EnergyAccount(TANK_PLANNER.energy)
    account.begin_leg(vee()[0])
    account.fly_leg(0.4)
    account.end_leg()
    account.fly_leg(1.0)
    assert account.used == pytest.approx(0.4 * TANK_PLANNER.energy.glide)


def test_rate_that_the_pump_cannot_hold_is_lowered():
    polar = GlidePolar(VEHICLES["grace3"], 0.3)
    assert 0.05 < polar.rate_m_s < 0.12
    assert GlidePolar(VEHICLES["grace3"], 0.05).rate_m_s == 0.05
    assert GlidePolar(VEHICLES["miniglider"], -0.02).rate_m_s == -0.02


def test_nose_points_down_on_the_way_down_and_steeper_on_steeper_paths():
    down, up = (GlidePolar(VEHICLES["miniglider"], rate) for rate in (0.02, -0.02))
    gentle, steep = math.radians(42.0), math.radians(52.0)
    assert down.pitch_rad(steep) < down.pitch_rad(gentle) < 0.0
    assert up.pitch_rad(steep) > up.pitch_rad(gentle) > 0.0
    assert down.pitch_rad(0.1) == down.pitch_rad(math.radians(30.0))


def test_depth_reference_ramps_and_waits_for_a_robot_that_cannot_follow():
    profile = DepthProfile(0.0, 0.0, 0.02, 0.004, 0.06)
    references = [profile.step(0.0, 0.1) for _ in range(200)]
    assert references[0].rate_m_s == pytest.approx(0.0004)
    assert references[-1].rate_m_s == pytest.approx(0.02)
    assert references[-1].depth_m == pytest.approx(0.06)
    assert max(abs(reference.acceleration_m_s2) for reference in references) <= 0.004


STILL = Readings(
    depth_m=0.0,
    roll_rad=0.0,
    pitch_rad=0.05,
    heading_rad=3.1,
    gyro_rad_s=(0.0, 0.0, 0.0),
    net_buoyancy_kg=-0.004,
    mass_position_m=0.0,
    tail_rad=0.0,
    battery_fraction=1.0,
    battery_v=10.0,
    fix_ne_m=(1.0, 0.5),
)


def navigator(readings: Readings) -> Navigator:
    return Navigator(MINI_1.estimator, MINI_1.vehicle, MINI_1.site, readings, 0.1)


def test_heading_is_averaged_across_south():
    filters = navigator(STILL)
    rng = np.random.default_rng(2)
    for step in range(100):
        noisy = replace(STILL, heading_rad=math.pi + 0.035 * float(rng.standard_normal()))
        estimate = filters.step(noisy, SetPoints(-0.004, 0.0), 0.1 * step)
    assert abs(math.remainder(estimate.course_heading_rad - math.pi, math.tau)) < 0.02
    assert abs(math.remainder(estimate.heading_rad - math.pi, math.tau)) < 0.04


def test_floating_robot_does_not_believe_that_it_moves():
    filters, rng = navigator(STILL), np.random.default_rng(0)
    for step in range(300):
        fix = None
        if step % 5 == 0:
            north_m, east_m = 0.01 * rng.standard_normal(2)
            fix = (1.0 + north_m, 0.5 + east_m)
        seen = replace(STILL, fix_ne_m=fix)
        estimate = filters.step(seen, SetPoints(-0.004, 0.0), 0.1 * step)
    assert math.hypot(*estimate.velocity_ned) < 0.015
    assert math.dist(estimate.position_ned, (1.0, 0.5, 0.0)) < 0.03


def test_robot_that_never_had_a_fix_does_not_claim_a_position():
    filters = navigator(replace(STILL, fix_ne_m=None))
    lost = filters.step(replace(STILL, fix_ne_m=None), SetPoints(-0.004, 0.0), 0.0)
    assert lost.position_std_m > 1.0
    assert not lost.has_fix
    found = filters.step(STILL, SetPoints(-0.004, 0.0), 0.1)
    assert found.position_std_m < 0.05
    assert found.has_fix


def test_onboard_program_and_nodes_know_nothing_of_the_truth():
    for path in Path(onboard.__file__).parent.rglob("*.py"):
        nodes = list(ast.walk(ast.parse(path.read_text())))
        imported = [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
        for node in nodes:
            if isinstance(node, ast.Import):
                imported += [alias.name for alias in node.names]
        for name in imported:
            assert not name.startswith("simulator")
            assert name != "autonomy.field.synthetic"
