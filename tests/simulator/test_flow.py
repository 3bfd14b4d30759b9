"""Flows of the simulated water."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.site import LAKE, TANK
from onboard.flight.hardware import SetPoints
from simulator.fleet import MINI_1
from simulator.flow import Gyre, Modelled, Shear, Sum, Tide, Uniform, read_flow
from simulator.robot import SimulatedBody
from tests.autonomy.ocean import EPOCH_S, ORIGIN, ocean, rate


def points(north_m=0.0, east_m=0.0, depth_m=3.0, time_s=0.0) -> np.ndarray:
    """Return points as flows take them, as many as the longest of the four."""
    return np.column_stack(np.broadcast_arrays(*np.atleast_1d(north_m, east_m, depth_m, time_s)))


def test_gyre_has_no_divergence_and_leaves_no_box() -> None:
    gyre = read_flow("double:0.1", LAKE)
    rng = np.random.default_rng(0)
    north, east = rng.uniform(0.0, 500.0, (2, 50))
    step = 1e-3
    du = gyre.velocity_ne_m_s(points(north + step, east))
    du = du - gyre.velocity_ne_m_s(points(north - step, east))
    dv = gyre.velocity_ne_m_s(points(north, east + step))
    dv = dv - gyre.velocity_ne_m_s(points(north, east - step))
    assert np.abs(du[:, 0] + dv[:, 1]).max() < 1e-9
    walls = gyre.velocity_ne_m_s(points([0.0, 500.0], [70.0, 333.0]))
    assert np.abs(walls[:, 0]).max() < 1e-15
    everywhere = points(*np.mgrid[0:500:5.0, 0:500:5.0].reshape(2, -1))
    speed = np.hypot(*gyre.velocity_ne_m_s(everywhere).T)
    assert speed.max() == pytest.approx(0.1, rel=0.01)


def test_shear_returns_at_depth_what_it_takes_at_the_surface() -> None:
    shear = read_flow("shear:0.1@90", LAKE)
    depth = (np.arange(2000) + 0.5) * 0.01
    flow = shear.velocity_ne_m_s(points(depth_m=depth))
    assert flow[0, 1] == pytest.approx(0.1, rel=0.01)
    assert np.abs(flow.mean(axis=0)).max() < 1e-6


def test_tide_comes_back_and_has_no_mean() -> None:
    tide = read_flow("tide:0.08@30/2", LAKE)
    time = np.linspace(0.0, 7200.0, 721)
    flow = tide.velocity_ne_m_s(points(time_s=time))
    np.testing.assert_allclose(flow[0], flow[-1], atol=1e-12)
    np.testing.assert_allclose(flow[0], 0.08 * np.array([math.cos(0.5236), math.sin(0.5236)]), 1e-4)
    assert np.abs(flow[:-1].mean(axis=0)).max() < 1e-12


def test_flows_add_up_and_speed_is_that_of_the_water() -> None:
    both = read_flow("uniform:0.02@0 + uniform:0.03@90", TANK)
    flow = both.velocity_ne_m_s(points(1.0, 1.0, 0.1, 5.0))
    np.testing.assert_allclose(flow, [[0.02, 0.03]], atol=1e-12)
    assert isinstance(both, Sum)
    assert read_flow("uniform@0", TANK) == Uniform(0.02, 0.0)
    assert read_flow("uniform@0", LAKE) == Uniform(0.05, 0.0)
    assert isinstance(read_flow("gyre", TANK), Gyre)
    assert isinstance(read_flow("tide", TANK), Tide)
    assert isinstance(read_flow("shear", TANK), Shear)


@pytest.mark.parametrize(
    "text", ["", "flood", "gyre:fast", "gyre:3", "gyre/2", "tide/0", "uniform:nan", "gyre+"]
)
def test_what_is_no_flow_says_what_is(text: str) -> None:
    with pytest.raises(ValueError, match="is no flow: KIND"):
        read_flow(text, LAKE)


def test_flow_carries_a_robot_at_its_own_time() -> None:
    tide = Tide(0.05, 0.0, 0.0, 1000.0)
    still = replace(MINI_1, drift_m_sqrt_s=0.0, flow=tide)
    ways = []
    for water_s in (0.0, 500.0):
        body = SimulatedBody(still, 0, water_s=water_s)
        for _ in range(100):
            body.plant.advance(SetPoints(-0.002, 0.0), 0.1)
        ways.append(body.plant.position_ned[0] - MINI_1.start_ne_m[0])
    assert ways[0] > 0.3
    assert ways[1] == pytest.approx(-ways[0], abs=0.02)


def test_an_ocean_model_flows_where_and_when_it_tells(tmp_path) -> None:
    path = ocean(tmp_path / "model.nc")
    flow = read_flow(f"{path}+uniform:0.01@0", LAKE)
    assert isinstance(flow, Sum)
    assert isinstance(flow.parts[0], Modelled)
    here = np.array([[0.0, 0.0, 5.0, EPOCH_S + 3600.0]])
    north, east = rate(*ORIGIN, 5.0, 1.0)
    np.testing.assert_allclose(flow.velocity_ne_m_s(here), [[north + 0.01, east]], atol=1e-6)
    # farther on it is another one, and after its end the water is still
    there = here + np.array([500.0, 0.0, 0.0, 0.0])
    assert abs(flow.velocity_ne_m_s(there)[0, 0] - north - 0.01) > 1e-3
    late = here + np.array([0.0, 0.0, 0.0, 1e6])
    np.testing.assert_allclose(flow.velocity_ne_m_s(late), [[0.01, 0.0]], atol=1e-9)
    # another water is not flooded by it, and a broken file is refused
    elsewhere = LAKE.model_copy(update={"origin_latitude_deg": 10.0})
    assert read_flow(str(path), elsewhere) == Uniform(0.0, 0.0)
    path.write_bytes(b"CDF")
    with pytest.raises(ValueError, match=r"model\.nc: no NetCDF file"):
        read_flow(str(path), LAKE)
