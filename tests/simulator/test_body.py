"""Water, hull, sensors and battery of a simulated robot."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from pydantic import ValidationError

from autonomy.field.synthetic import measurement_noise, truth
from autonomy.vehicle.surroundings import Surroundings
from onboard.flight.hardware import SetPoints
from simulator.battery import Battery
from simulator.conditions import WaterConditions
from simulator.current import DriftingCurrent
from simulator.fleet import FLEET, GRACE_1, MINI_1
from simulator.plant import Plant
from simulator.robot import SimulatedBody
from simulator.sensor import Sensors
from simulator.settings import SimulatorSettings

STILL = replace(MINI_1, drift_m_sqrt_s=0.0)
STILL_LAKE = replace(GRACE_1, drift_m_sqrt_s=0.0)
ROUGH = WaterConditions(temperature_drop_c=12.0, wave_height_m=0.2, wave_period_s=2.0)


def body(definition=STILL, seed: int = 0) -> SimulatedBody:
    return SimulatedBody(definition, seed)


def drift(drift_m_sqrt_s: float, seconds: int, seed: int) -> float:
    current = DriftingCurrent(drift_m_sqrt_s, 3.0, np.random.default_rng(seed))
    north = 0.0
    for _ in range(2 * seconds):
        current.advance(0.5)
        north += 0.5 * float(current.velocity_ne_m_s[0])
    return north


def test_unaware_robot_drifts_with_the_root_of_time():
    for seconds in (100, 400):
        displaced = [drift(0.02, seconds, seed) for seed in range(250)]
        assert np.std(displaced) == pytest.approx(0.02 * math.sqrt(seconds), rel=0.12)


def test_hull_under_water_is_carried_by_the_current():
    plant = Plant(
        MINI_1.vehicle,
        Surroundings.of_site(MINI_1.site),
        DriftingCurrent(0.05, 3.0, np.random.default_rng(1)),
        (1.0, 0.5),
        0.0,
    )
    still = body().plant
    for _ in range(300):
        plant.advance(SetPoints(0.004, 0.0), 0.1)
        still.advance(SetPoints(0.004, 0.0), 0.1)
    assert math.dist(plant.position_ned[:2], still.position_ned[:2]) > 0.02


def test_heavy_robot_sinks_to_the_floor_and_no_deeper():
    robot = body()
    robot.actuate(SetPoints(0.02, 0.0))
    robot.advance(120.0)
    assert robot.plant.position_ned[2] == pytest.approx(1.2, abs=0.01)


def test_walls_of_the_tank_stop_a_swimmer_and_the_lake_has_none():
    gait = MINI_1.vehicle.swim
    for definition, is_stopped in ((STILL, True), (replace(GRACE_1, drift_m_sqrt_s=0.0), False)):
        robot = body(definition)
        north_edge = definition.site.water.x_max_m
        robot.plant.state[0] = north_edge - 0.5
        robot.plant.state[5] = 0.0
        limits = definition.vehicle.limits
        robot.actuate(
            SetPoints(0.3 * limits.m0_min_kg, 0.0, 0.0, gait.amplitude_rad, gait.frequency_hz)
        )
        robot.advance(60.0)
        beyond = robot.plant.position_ned[0] - north_edge
        assert (beyond < 0.02) is is_stopped


def test_fix_comes_at_the_surface_only_and_not_too_often():
    robot = body(replace(GRACE_1, drift_m_sqrt_s=0.0))
    fixes = 0
    for _ in range(50):
        robot.advance(0.1)
        fixes += robot.read().fix_ne_m is not None
    assert fixes == 5
    robot.plant.state[2] = 1.0
    assert robot.read().fix_ne_m is None


def test_readings_scatter_about_the_truth_as_the_model_says():
    robot = body()
    robot.plant.state[2] = 0.02
    robot.plant.state[5] = 0.5
    readings = [robot.read() for _ in range(2000)]
    model = MINI_1.sensors
    depths = np.array([reading.depth_m for reading in readings])
    headings = np.array([reading.heading_rad for reading in readings])
    assert depths.mean() == pytest.approx(0.02, abs=3e-4)
    assert depths.std() == pytest.approx(model.depth_std_m, rel=0.1)
    assert headings.std() == pytest.approx(model.heading_std_rad, rel=0.1)


def test_field_is_measured_where_the_robot_truly_is():
    robot = body()
    robot.plant.state[:3] = (0.62, 0.48, 0.5)
    exact = float(truth("blue_light", np.array([[0.62, 0.48, 0.5]]))[0])
    logs = np.log([robot.measure_field() for _ in range(400)])
    assert logs.mean() == pytest.approx(math.log(exact), abs=0.01)
    assert logs.std() == pytest.approx(measurement_noise("blue_light"), rel=0.15)


def test_noise_of_the_sensors_does_not_depend_on_the_plant():
    sensors = Sensors(MINI_1.sensors, "blue_light", np.random.default_rng(3))
    same = Sensors(MINI_1.sensors, "blue_light", np.random.default_rng(3))
    battery = body().battery
    low, high = np.zeros(15), np.full(15, 0.01)
    deeper, higher = sensors.read(0.0, high, battery), same.read(0.0, low, battery)
    assert deeper.depth_m - higher.depth_m == pytest.approx(0.01)


def test_battery_pays_for_electronics_and_more_for_moving_actuators():
    resting, pumping = body(), body()
    pumping.actuate(SetPoints(MINI_1.vehicle.limits.m0_min_kg, 0.0))
    begin = pumping.plant.state[12]
    for one in (resting, pumping):
        one.advance(5.0)
    prices, limits = MINI_1.vehicle.energy, MINI_1.vehicle.limits
    pumped_s = abs(pumping.plant.state[12] - begin) / limits.m0_rate_kg_s
    used_j = 5.0 * prices.electronics_w + pumped_s * prices.pump_full_w
    assert pumped_s > 1.0
    expected = 1.0 - used_j / 3600.0 / MINI_1.battery.capacity_wh
    assert pumping.battery.fraction == pytest.approx(expected, abs=1e-6)
    assert pumping.battery.fraction < resting.battery.fraction < 1.0
    assert MINI_1.battery.empty_v < pumping.battery.voltage_v < resting.battery.voltage_v


def test_battery_is_never_less_than_empty():
    battery = Battery(MINI_1.battery)
    battery.use(1e9)
    assert battery.fraction == 0.0
    assert battery.voltage_v == MINI_1.battery.empty_v


def test_a_lake_may_be_layered_and_wavy_but_a_tank_is_not():
    rough = WaterConditions(temperature_drop_c=8.0, wave_height_m=0.2)
    lake = rough.surroundings(GRACE_1.site)
    assert lake.column is not None
    temperature_c = np.interp([2.0, 18.0], lake.column.depth_m, lake.column.temperature_c)
    assert temperature_c.tolist() == [22.0, 14.0]
    assert [wave.height_m for wave in lake.waves] == [0.2]
    assert rough.surroundings(MINI_1.site) == Surroundings.of_site(MINI_1.site)
    assert WaterConditions().surroundings(GRACE_1.site) == Surroundings.of_site(GRACE_1.site)


def test_settings_describe_the_water_and_refuse_breaking_waves(tmp_path):
    now = datetime(2024, 5, 1, 12, tzinfo=UTC)
    anchors = {"link_folder": tmp_path, "wall_anchor": now, "time_anchor": now}
    assert SimulatorSettings(**anchors).conditions() == WaterConditions()
    rough = SimulatorSettings(**anchors, temperature_drop_c=12.0, wave_height_m=0.2)
    assert rough.conditions() == ROUGH
    with pytest.raises(ValidationError, match=r"breaks at 0\.223 m"):
        SimulatorSettings(**anchors, wave_height_m=0.5, wave_period_s=1.0)


def test_a_robot_sinks_slower_into_colder_water_and_rolls_on_waves():
    calm, rough = SimulatedBody(STILL_LAKE, 0), SimulatedBody(STILL_LAKE, 0, ROUGH)
    for one in (calm, rough):
        one.advance(20.0)
    assert abs(calm.plant.state[2]) < 0.02
    heights = []
    for _ in range(40):
        rough.advance(0.1)
        heights.append(rough.plant.state[2])
    assert np.ptp(heights) == pytest.approx(ROUGH.wave_height_m, rel=0.3)
    for one in (calm, rough):
        one.actuate(SetPoints(0.05, 0.05))
        one.advance(300.0)
    assert rough.plant.position_ned[2] < calm.plant.position_ned[2] - 1.0


def test_robots_of_the_fleet_differ_in_all_that_names_them():
    robots = FLEET.values()
    for names in (
        [robot.system_id for robot in robots],
        [robot.radio_address for robot in robots],
        [robot.link_name for robot in robots],
    ):
        assert len(set(names)) == len(FLEET)
    assert all(
        robot.site.domain.contains(*robot.start_ne_m, 0.0) and robot.site.domain.depth_max_m > 0.0
        for robot in robots
    )
