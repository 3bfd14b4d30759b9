"""Layered, moving and wavy water: its own laws, and what robots do in it."""

import dataclasses
import math

import numpy as np
import pytest

from autonomy.site import LAKE
from autonomy.vehicle import extended_kernel, water_kernel
from autonomy.vehicle.config import GRACE3, MINIGLIDER, VEHICLES
from autonomy.vehicle.reference import dynamics
from autonomy.vehicle.surroundings import Surroundings
from autonomy.vehicle.water import (
    CurrentGrid,
    CurrentProfile,
    WaterColumn,
    Wave,
    fresh_water_density,
)

STILL = [0.0] * 5


def some_water():
    rng = np.random.default_rng(11)
    shear = CurrentProfile(np.array([0.0, 0.3, 0.8, 1.5]), rng.normal(size=(4, 2)) * 0.1)
    axes = np.linspace(-2, 2, 5), np.linspace(-1.5, 1.5, 4), np.linspace(0, 2, 6)
    grid = CurrentGrid(*axes, rng.normal(size=(5, 4, 6, 3)) * 0.05)
    warm_above = WaterColumn.fresh(np.array([0.0, 0.5, 1, 2]), np.array([22.0, 21, 14, 9]))
    waves = (Wave(0.05, 1.2, 0.4, 0.3), Wave(0.02, 0.7, -2.0, 1.0))
    tank = Surroundings((0.1, -0.05, 0.01), -1.5, 1.5, -1.5, 1.5, 1.2, has_walls=True)
    return {
        "still": Surroundings(),
        "tank": tank,
        "shear": Surroundings(current_profile=shear),
        "grid": Surroundings(current_grid=grid),
        "layers": Surroundings(column=warm_above),
        "waves": Surroundings(waves=waves),
        "all": dataclasses.replace(
            tank, current_profile=shear, current_grid=grid, column=warm_above, waves=waves
        ),
    }


def soft(vehicle, compressibility_per_m):
    hull = vehicle.hull.model_copy(update={"compressibility_per_m": compressibility_per_m})
    return dataclasses.replace(vehicle, hull=hull)


def without_hydrodynamics(vehicle, **changes):
    """A vehicle with coefficients of 0, and with the same mass along every axis."""
    p = vehicle.parameters
    names = [
        name
        for name in type(p).model_fields
        if name.startswith(("drag_", "side_", "lift_", "roll_", "pitch_", "yaw_", "crossflow_"))
    ]
    none = dict.fromkeys(names, 0.0) | {"mass_2_kg": p.mass_1_kg, "mass_3_kg": p.mass_1_kg}
    return dataclasses.replace(vehicle, parameters=p.model_copy(update=none | changes))


def at(**values):
    names = ["x", "y", "z", "roll", "pitch", "heading", "v1", "v2", "v3", "w1", "w2", "w3"]
    state = np.zeros(15)
    for name, value in values.items():
        state[[*names, "m0", "rp1", "delta"].index(name)] = value
    return state


def run(vehicle, state, command, surroundings, seconds, start_s=0.0, dt=0.02):
    return extended_kernel.advance(
        state,
        np.array(command),
        vehicle.packed(),
        surroundings.packed(),
        start_s,
        dt,
        round(seconds / dt),
    )


@pytest.mark.parametrize("kind", some_water())
@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_compiled_rates_in_any_water_are_the_readable_ones(vehicle, kind):
    water = some_water()[kind]
    vehicle = soft(vehicle, 2e-5)
    rng = np.random.default_rng(12)
    scale = [2, 2, 2, 1.5, 1.5, 3, 0.15, 0.05, 0.15, 0.3, 0.3, 0.3, 0.02, 0.04, 1.5]
    packed, around = vehicle.packed(), water.packed()
    for state in rng.uniform(-1.0, 1.0, (300, 15)) * scale:
        actuator = rng.uniform(-1.0, 1.0, 4) * [0.002, 0.01, 1.9, 3.0]
        time_s = rng.uniform(0.0, 100.0)
        readable = dynamics.extended_state_derivative(state, actuator, vehicle, water, time_s)
        compiled = extended_kernel.extended_state_derivative(
            state, actuator, packed, around, time_s
        )
        error = np.linalg.norm(compiled - readable) / np.linalg.norm(readable)
        assert error < 1e-13


@pytest.mark.parametrize("kind", some_water())
def test_gradient_and_change_of_a_flow_are_those_of_its_velocity(kind):
    water = some_water()[kind]
    rng = np.random.default_rng(13)
    h = 1e-6
    for _ in range(50):
        place, time_s = rng.uniform([-2.2, -1.7, 0.01], [2.2, 1.7, 2.2]), rng.uniform(0, 10)
        flow = water.flow(place, time_s)
        for axis in range(3):
            step = h * np.eye(3)[axis]
            ahead, behind = (water.flow(place + s * step, time_s) for s in (1, -1))
            slope = (ahead.velocity_m_s - behind.velocity_m_s) / (2 * h)
            assert slope == pytest.approx(flow.gradient_per_s[:, axis], abs=2e-6)
        later, earlier = (water.flow(place, time_s + s * h) for s in (1, -1))
        change = (later.velocity_m_s - earlier.velocity_m_s) / (2 * h)
        assert change == pytest.approx(flow.change_m_s2, abs=2e-6)


def test_packed_water_without_more_stays_nine_numbers_long():
    assert Surroundings((0.1, 0.0, 0.0), floor_m=3.0).packed().shape == (water_kernel.PLAIN,)
    assert some_water()["all"].packed()[:9].tolist() == some_water()["tank"].packed().tolist()


def test_a_wave_neither_squeezes_nor_spins_the_water():
    wave = Wave(0.1, 2.0, 0.7)
    for place in np.random.default_rng(14).uniform(0, 3, (20, 3)):
        gradient = wave.flow(place, 1.3).gradient_per_s
        assert np.trace(gradient) == pytest.approx(0.0, abs=1e-15)
        assert gradient == pytest.approx(gradient.T, abs=1e-15)


def test_orbits_under_a_wave_shrink_with_depth():
    wave = Wave(0.1, 2.0)
    speeds = [
        np.linalg.norm(wave.flow(np.array([0.0, 0.0, depth]), 0.4).velocity_m_s)
        for depth in (0.0, wave.length_m / 2)
    ]
    assert speeds[0] == pytest.approx(0.05 * math.pi)
    assert speeds[1] == pytest.approx(speeds[0] * math.exp(-math.pi))


def test_a_neutral_robot_at_rest_is_carried_by_the_waves_like_the_water():
    wave = Wave(0.2, 2.5, 0.5, math.pi / 2)
    water = Surroundings(waves=(wave,))
    state = at(z=1.0, heading=0.8)
    places = []
    for i in range(125):
        state = run(MINIGLIDER, state, STILL, water, 0.02, 0.02 * i)
        places.append(state[:3].copy())
        assert np.abs(state[6:12]).max() < 1e-12
    radius = 0.1 * math.exp(-2 * math.pi / wave.length_m)
    rise = np.ptp(np.array(places)[:, 2])
    assert rise == pytest.approx(2 * radius, rel=0.02)


def test_a_body_that_sinks_through_shear_keeps_its_way_over_ground():
    vehicle = without_hydrodynamics(MINIGLIDER)
    shear = CurrentProfile(np.array([0.0, 20.0]), np.array([[0.0, 0.0], [2.0, 1.0]]))
    water = Surroundings(current_profile=shear)
    start = at(z=1.0, m0=0.02, v1=-0.1, v2=-0.05)
    later = run(vehicle, start, [0.02, 0, 0, 0, 0], water, 30.0)
    assert later[2] > 3.0
    assert later[:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert later[6:8] == pytest.approx([-0.1 * later[2], -0.05 * later[2]], rel=1e-9)


def test_a_glider_drifts_with_the_current_of_its_layer():
    layers = CurrentProfile(np.array([2.0, 2.1]), np.array([[0.1, 0.0], [-0.1, 0.0]]))
    water = Surroundings(current_profile=layers, floor_m=50.0)
    for depth, drift in ((1.0, 0.1), (5.0, -0.1)):
        later = run(MINIGLIDER, at(z=depth), STILL, water, 50.0)
        assert later[0] == pytest.approx(drift * 50.0, abs=1e-9)


def test_a_current_on_a_grid_carries_a_robot_along_its_stream_lines():
    axis = np.linspace(-3.0, 3.0, 31)
    x, y, _ = np.meshgrid(axis, axis, [0.0, 10.0], indexing="ij")
    swirl = CurrentGrid(
        axis, axis, np.array([0.0, 10.0]), np.stack([-0.05 * y, 0.05 * x, 0 * x], axis=-1)
    )
    water = Surroundings(current_grid=swirl)
    flow = water.flow(np.array([0.33, -1.17, 4.2]), 0.0)
    assert flow.velocity_m_s == pytest.approx([0.05 * 1.17, 0.05 * 0.33, 0.0], abs=1e-15)
    assert flow.gradient_per_s[0, 1] == pytest.approx(-0.05)
    centripetal = -(0.05**2) * np.array([0.33, -1.17])
    assert flow.acceleration_m_s2[:2] == pytest.approx(centripetal)
    outside = water.flow(np.array([9.0, 0.0, -1.0]), 0.0)
    assert outside.velocity_m_s == pytest.approx([0.0, 0.15, 0.0])
    assert outside.gradient_per_s[:, 0].tolist() == [0.0, 0.0, 0.0]
    later = run(MINIGLIDER, at(x=1.5, z=4.0), STILL, water, 10.0)
    assert math.hypot(*later[:2]) == pytest.approx(1.5, rel=1e-4)
    assert math.atan2(later[1], later[0]) == pytest.approx(0.5, rel=1e-4)


def test_a_heavy_robot_stops_sinking_where_denser_water_carries_it():
    vehicle = GRACE3
    column = WaterColumn(np.array([0.0, 10.0]), np.array([998.0, 999.0]))
    water = Surroundings(column=column)
    m0 = 0.0165
    balance = m0 / vehicle.hull.displaced_mass_kg * 998.0 * 10.0
    assert 0.0 < balance < 10.0
    state = at(z=1.0, m0=m0)
    state = run(vehicle, state, [m0, 0, 0, 0, 0], water, 3000.0, dt=0.05)
    assert state[2] == pytest.approx(balance, abs=0.05)


def test_a_soft_hull_below_its_depth_cannot_rise_with_the_pump_alone():
    limits, mass = MINIGLIDER.limits, MINIGLIDER.hull.displaced_mass_kg
    vehicle = soft(MINIGLIDER, 1e-3)
    lost = -limits.m0_min_kg / mass / 1e-3
    command = [limits.m0_min_kg, 0.0, 0.0, 0.0, 0.0]
    for start, rises in ((lost - 1.0, True), (lost + 1.0, False)):
        later = run(vehicle, at(z=start, m0=limits.m0_min_kg), command, Surroundings(), 60.0)
        assert (later[2] < start) == rises


def test_denser_water_slows_a_glide():
    dense = WaterColumn(np.array([0.0, 100.0]), np.full(2, 1100.0))
    command = [0.01, 0.02, 0, 0, 0]
    depths = [
        run(MINIGLIDER, at(z=5.0, m0=0.01, rp1=0.02), command, water, 200.0)[2] - 5.0
        for water in (Surroundings(), Surroundings(column=dense))
    ]
    expected = math.sqrt(MINIGLIDER.parameters.water_density_kg_m3 / 1100.0)
    assert depths[1] / depths[0] == pytest.approx(expected, rel=0.02)


def test_a_floating_robot_rides_the_waves():
    wave = Wave(0.2, 3.0, 0.3)
    water = Surroundings(waves=(wave,))
    state = at(m0=-0.014)
    state = run(MINIGLIDER, state, [-0.014, 0, 0, 0, 0], water, 30.0)
    rises = []
    for i in range(300):
        time_s = 30.0 + 0.02 * (i + 1)
        state = run(MINIGLIDER, state, [-0.014, 0, 0, 0, 0], water, 0.02, time_s - 0.02)
        surface = -wave.elevation_m(state[:3], time_s)
        rises.append(state[2])
        assert state[2] == pytest.approx(surface, abs=0.02)
    assert np.ptp(rises) == pytest.approx(0.2, rel=0.1)


@pytest.mark.parametrize(
    ("temperature_c", "density"),
    [(0.0, 999.843), (3.983035, 999.975), (10.0, 999.703), (20.0, 998.207), (30.0, 995.649)],
)
def test_density_of_fresh_water_is_the_recommended_one(temperature_c, density):
    assert fresh_water_density(temperature_c) == pytest.approx(density, abs=0.001)


def test_a_column_tells_density_in_between_and_beyond():
    column = WaterColumn.fresh(np.array([0.0, 10.0]), np.array([20.0, 10.0]))
    assert column.density_at(-1.0) == pytest.approx(998.207, abs=0.001)
    assert column.ballast_kg_m3 == column.density_at(0.0)


def test_surroundings_can_be_compared_whatever_they_hold():
    everything = some_water()["all"]
    assert everything == dataclasses.replace(everything)
    assert everything != some_water()["all"]


def test_a_site_takes_the_water_it_is_given():
    column = WaterColumn.fresh(np.array([0.0, 10.0]), np.array([20.0, 10.0]))
    lake = Surroundings.of_site(LAKE, column=column, waves=(Wave(0.1, 2.0),))
    assert lake.column is column
    assert lake.floor_m == LAKE.water.depth_max_m
    assert len(lake.packed()) == 9 + 7 + 4 + 6


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: CurrentProfile(np.array([0.0]), np.zeros((1, 2))), "at least two"),
        (lambda: CurrentProfile(np.array([0.0, 0.0]), np.zeros((2, 2))), "must increase"),
        (lambda: CurrentProfile(np.array([0.0, math.nan]), np.zeros((2, 2))), "finite"),
        (lambda: CurrentProfile(np.array([0.0, 1.0]), np.zeros((2, 3))), r"\(2, 2\)"),
        (lambda: CurrentProfile(np.array([0.0, 1.0]), np.full((2, 2), np.inf)), "finite"),
        (lambda: CurrentGrid(*[np.array([0.0, 1.0])] * 3, np.zeros((2, 2, 2))), "shape"),
        (lambda: WaterColumn(np.array([0.0, 1.0]), np.array([998.0, -1.0])), "above 0"),
        (lambda: WaterColumn(np.array([0, 1.0]), np.full(2, 998.0), None, 0.0), "above 0"),
        (lambda: WaterColumn(np.array([0, 1.0]), np.full(2, 998.0), np.zeros(3)), "shape"),
        (lambda: WaterColumn.fresh(np.array([0.0, 1.0]), np.array([20.0, -5.0])), "0 to 40 C"),
        (lambda: Wave(-0.1, 2.0), "height of at least 0"),
        (lambda: Wave(0.1, 0.0), "period above 0"),
        (lambda: Wave(math.nan, 2.0), "height"),
        (lambda: Wave(0.5, 1.0), r"breaks at 0\.223 m; 0\.5 m is higher"),
    ],
)
def test_impossible_water_is_refused_with_the_reason(make, words):
    with pytest.raises(ValueError, match=words):
        make()
