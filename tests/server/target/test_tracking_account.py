"""What a plan to follow a target says that it costs, held against a robot that flies it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.estimation.energy_use import EnergyUse, Use
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.planner.work import powers_of_uses
from autonomy.tracking.config import TRACKING_PRESETS, TrackingConfig
from autonomy.vehicle.battery import BATTERY_PRESETS, swimming_power_w
from autonomy.vehicle.config import VEHICLES
from robot_link.messages import RobotMode
from robot_link.mission import Mission, MissionSettings
from robot_link.target_settings import TargetSettings
from server.battery.battery_use import Battery
from server.plan.battery import battery_of_target, battery_violations
from server.plan.target_account import dives_of, target_account
from tests.server.conftest import GRACE, MINI
from tests.server.fake_link import state_report
from tests.server.target.test_tracking_plan import draft, upload
from tests.simulator.flight import Life

RESERVE = BATTERY_PRESETS["grace3"].reserve
MINI_PLANNER = PLANNER_PRESETS["miniglider"]
MINI_MODEL, GRACE_MODEL = VEHICLES["miniglider"], VEHICLES["grace3"]


def changed(vehicle="miniglider", **groups):
    value = TRACKING_PRESETS[vehicle].model_dump()
    for group, fields in groups.items():
        value[group].update(fields)
    return TrackingConfig.model_validate(value)


def account(config, planner=MINI_PLANNER, vehicle=MINI_MODEL, state=None):
    return target_account(config, planner, vehicle, state, size=100, credits=3, battery=None)


@pytest.mark.parametrize("depth_m", [0.0, 0.4])
def test_energy_surfacings_and_battery_are_near_what_a_robot_takes_that_flies_it(depth_m):
    duration_s = 300.0
    config = changed(motion={"depth_m": depth_m, "duration_s": duration_s})
    planner = MINI_PLANNER.model_copy(update={"max_uncertainty_m": 0.15})
    promised = account(config, planner)
    life = Life()
    battery = life.robot.body.battery
    life.start(
        Mission.for_target(
            MissionSettings(2.0, planner.max_uncertainty_m, 80000.0, 0.5, 0.5),
            TargetSettings.of(config),
        )
    )
    full = battery.fraction
    life.live(duration_s)
    took = full - battery.fraction
    told = battery_of_target(config, planner, MINI_MODEL, by_model("miniglider", None))
    assert 0.8 * took < told.used < 2.5 * took
    assert 0.85 < promised.energy / life.executive.energy_used < 1.5
    modes = life.notebook.modes[life.notebook.modes.index(RobotMode.TRACKING) :]
    came_up = modes.count(RobotMode.SURFACED) + 1  # its end too
    assert abs(promised.surfacings - came_up) <= 1
    assert (promised.surfacings > 2) == (depth_m > 0.0)


def test_a_robot_that_knows_its_place_comes_up_once():
    day = {"duration_s": 86400.0}
    assert account(changed(motion=day)).surfacings == 1
    beacon = changed(target={"kind": "beacon"}, motion={**day, "depth_m": 0.4})
    assert account(beacon).surfacings == 1
    still = MINI_PLANNER.position_filter.model_copy(
        update={"drift_m_sqrt_s": 0.0, "steady_current_m_s": 0.0}
    )
    planner = MINI_PLANNER.model_copy(update={"position_filter": still})
    assert account(changed(motion={**day, "depth_m": 0.4}), planner).surfacings == 1


def test_each_surfacing_sends_its_bytes_and_bounds_the_uncertainty():
    deep = account(changed(motion={"duration_s": 3600.0, "depth_m": 0.4}))
    assert deep.surfacings > 10
    assert deep.satellite_bytes == deep.surfacings * MINI_PLANNER.mission.surfacing_bytes
    assert deep.worst_std_m == MINI_PLANNER.max_uncertainty_m
    lost = state_report(MINI, position_std_m=2.0)
    short = changed(motion={"duration_s": 10.0, "depth_m": 0.4})
    assert account(short, state=lost).worst_std_m == 2.0


def test_more_uncertainty_allowed_means_longer_dives():
    config = changed(motion={"depth_m": 0.4})
    wide = MINI_PLANNER.model_copy(update={"max_uncertainty_m": 0.5})
    narrow = MINI_PLANNER.model_copy(update={"max_uncertainty_m": 0.001})
    at_once = dives_of(config, narrow, MINI_MODEL).between_s
    longer = dives_of(config, wide, MINI_MODEL).between_s - at_once
    lost_m2 = (0.02**2 + 0.01**2 * longer) * longer
    assert lost_m2 == pytest.approx(0.5**2, rel=0.01), "0.02 m in a second, and 1 cm/s unknown"
    assert at_once > dives_of(config, narrow, None).between_s > 0.0


def test_the_beat_that_is_paid_for_is_the_vehicles_own():
    config = changed(motion={"duration_s": 100.0})
    gait = MINI_MODEL.swim.model_copy(update={"amplitude_rad": 0.2})
    slow = account(config, vehicle=replace(MINI_MODEL, swim=gait)).energy
    time = 100.0 * MINI_PLANNER.energy.time_factor
    assert slow - time == pytest.approx((account(config).energy - time) / 4.0)


def test_power_is_that_of_electronics_and_tail_and_under_water_of_the_pump_now_and_then():
    prices = GRACE_MODEL.energy
    gait, limits = GRACE_MODEL.swim, GRACE_MODEL.limits
    share = (2.0 * math.pi * gait.frequency_hz * gait.amplitude_rad / limits.delta_rate_rad_s) ** 2
    shallow = prices.electronics_w + 0.5 * share * prices.tail_full_w
    assert swimming_power_w(GRACE_MODEL, is_deep=False) == pytest.approx(shallow)
    deep_w = swimming_power_w(GRACE_MODEL, is_deep=True)
    assert 0.02 * prices.pump_full_w < deep_w - shallow < 0.1 * prices.pump_full_w


def by_model(vehicle, left):
    """Return the battery of a robot that has not flown yet."""
    use = EnergyUse.of_model(powers_of_uses(VEHICLES[vehicle], PLANNER_PRESETS[vehicle].primitives))
    return Battery(BATTERY_PRESETS[vehicle], use, np.zeros(len(Use)), left, None)


def told(duration_s, battery_fraction):
    config = changed("grace3", motion={"duration_s": duration_s})
    battery = by_model("grace3", battery_fraction)
    return battery_of_target(config, PLANNER_PRESETS["grace3"], GRACE_MODEL, battery)


def test_the_longest_mission_that_lasts_leaves_just_the_reserve():
    lasts_s = told(3600.0, 0.5).lasts_s
    assert battery_violations(GRACE, told(0.999 * lasts_s, 0.5)) == []
    (one,) = battery_violations(GRACE, told(1.001 * lasts_s, 0.5))
    assert one.field == "battery"
    assert "grace-1 has 50% left and must keep 10%" in one.message
    assert f"about {lasts_s:.0f} s" in one.message
    assert told(lasts_s, 0.5).used == pytest.approx(0.5 - RESERVE)


def test_a_battery_below_its_reserve_lasts_for_nothing():
    assert told(60.0, 0.03).lasts_s == 0.0


async def test_a_plan_that_outlasts_the_battery_is_not_sent_until_it_is_shorter(client, world):
    world.tell(state_report(MINI, (1.2, 0.6, 0.0), battery_fraction=0.5))
    long = await draft(client, {"motion": {"duration_s": 40000.0}})
    (one,) = long["violations"]
    assert one["field"] == "battery"
    battery = long["account"]["battery"]
    assert (battery["left"], battery["reserve"]) == (0.5, RESERVE)
    assert battery["used"] > 0.9
    assert (await upload(client, long["id"])).status_code == 409
    fits = await draft(client, {"motion": {"duration_s": 0.95 * battery["lasts_s"]}})
    assert fits["violations"] == []


async def test_what_the_battery_holds_is_a_setting_and_is_asked_again_at_the_check(client):
    plan = (await draft(client, {"motion": {"duration_s": 10000.0}}))["id"]
    assert (await client.post(f"/api/plans/{plan}/check")).json()["violations"] == []
    answer = await client.patch(
        "/api/config/battery", params={"robot": MINI}, json={"capacity_wh": 5.0}
    )
    assert answer.status_code == 200
    (one,) = (await client.post(f"/api/plans/{plan}/check")).json()["violations"]
    assert one["field"] == "battery"


async def test_account_says_what_sending_it_by_satellite_costs(client, workers):
    del workers
    legs = [{"kind": "dive", "end_ned": [0, 0, depth]} for depth in (0.4, 0.0)]
    body = {"kind": "primitives", "legs": legs}
    by_hand = (await client.post(f"/api/robots/{MINI}/plans", json=body)).json()["id"]
    for plan in ((await draft(client))["id"], by_hand):
        account = (await client.get(f"/api/plans/{plan}")).json()["account"]
        quote = (await client.get(f"/api/plans/{plan}/satellite")).json()
        assert account["credits"] == quote["credits"] > 0
