import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from autonomy.planner.config import EnergyConfig
from autonomy.planner.leg import edge_kernel, leg_kernel, primitive
from autonomy.planner.leg.edge import (
    POINT_DOWN,
    POINT_NORTH,
    POINT_STD,
    POINT_TIME,
    planned_points,
    propose_edge,
    random_shape,
)
from autonomy.planner.leg.waterway import waterway_of
from autonomy.planner.limits import legs_max, limits_of, points_max
from autonomy.planner.plan import PrimitiveKind
from tests.autonomy.planner_problem import THESIS_TANK, TOLD

CONFIGS = {"thesis": THESIS_TANK, **TOLD}


def proposals(config, number, seed=0):
    """Shapes between random surface points no farther apart than the step."""
    rng = np.random.default_rng(seed)
    domain = config.domain
    low, high = (domain.x_min_m, domain.y_min_m), (domain.x_max_m, domain.y_max_m)
    for _ in range(number):
        start = rng.uniform(low, high)
        course = rng.uniform(0.0, 2.0 * math.pi)
        reach = config.search.step_m * math.sqrt(rng.random())
        goal = np.clip(start + reach * np.array([math.cos(course), math.sin(course)]), low, high)
        yield tuple(map(float, start)), tuple(map(float, goal)), random_shape(config, rng)


def test_energies_are_those_of_the_thesis():
    config = EnergyConfig()
    assert primitive.energy(PrimitiveKind.DIVE, 10.0, config) == pytest.approx(1.05)
    assert primitive.energy(PrimitiveKind.GLIDE, 10.0, config) == pytest.approx(1.55)
    assert primitive.energy(PrimitiveKind.SPIRAL, 10.0, config) == pytest.approx(1.55)


@pytest.mark.parametrize("duration_s", [0.3, 1.0, 7.3])
def test_swimming_costs_the_integral_of_the_squared_tail_rate(duration_s):
    config = EnergyConfig(time_factor=0.0)
    amplitude, omega = config.tail_amplitude_rad, 2.0 * math.pi * config.tail_frequency_hz
    work, _ = quad(
        lambda t: (amplitude * omega * math.cos(omega * t)) ** 2, 0.0, duration_s, limit=200
    )
    cost = primitive.energy(PrimitiveKind.SWIM, duration_s, config)
    assert cost == pytest.approx(config.swim_factor * work, rel=1e-9)


def test_a_positive_turn_goes_to_starboard():
    leg = primitive.spiral(THESIS_TANK, (1.0, 0.5, 0.0), 0.0, 0.2, math.pi / 2, 0.3)
    assert leg.end_ned == pytest.approx((1.2, 0.7, 0.3))
    assert leg.duration_s == pytest.approx(0.3 / 0.05)


def test_a_spiral_moves_along_its_heading_at_constant_rate():
    leg = primitive.spiral(THESIS_TANK, (1.0, 0.5, 0.1), 2.0, 0.25, -3.0, 0.6)
    h = 1e-6
    for fraction in np.linspace(0.05, 0.95, 7):
        before, after = (primitive.position_at(leg, fraction + s * h) for s in (-1, 1))
        heading = leg.heading_rad + fraction * leg.turn_rad
        north, east, down = (np.array(after) - before) / (2 * h)
        assert north == pytest.approx(0.25 * 3.0 * math.cos(heading), abs=1e-6)
        assert east == pytest.approx(0.25 * 3.0 * math.sin(heading), abs=1e-6)
        assert down == pytest.approx(0.5, abs=1e-6)


@settings(deadline=None)
@given(
    heading=st.floats(-10.0, 10.0),
    turn=st.floats(-12.0, 12.0).filter(lambda value: abs(value) > 1e-3),
)
def test_the_bounds_of_a_spiral_hold_all_of_it(heading, turn):
    leg = primitive.spiral(THESIS_TANK, (0.0, 0.0, 0.0), heading, 1.0, turn, 0.5)
    path = np.array([primitive.position_at(leg, part) for part in np.linspace(0.0, 1.0, 500)])
    low, high = (np.array(corner) for corner in primitive.bounds(leg))
    assert (path >= low - 1e-9).all()
    assert (path <= high + 1e-9).all()
    assert np.abs(path.max(axis=0) - high).max() < 1e-3
    assert np.abs(path.min(axis=0) - low).max() < 1e-3


@pytest.mark.parametrize("name", CONFIGS)
def test_compiled_and_readable_edges_are_the_same(name):
    config = CONFIGS[name]
    limits = limits_of(config, 20.0)
    legs = np.empty((legs_max(config), leg_kernel.LEG_COLUMNS))
    points = np.empty((points_max(config), 5))
    feasible = 0
    for start, goal, shape in proposals(config, 300):
        edge = propose_edge(config, start, goal, 20.0, shape)
        count = edge_kernel.propose(
            limits, waterway_of(config, None), start, goal, shape, legs, 0.0
        )
        placed = edge_kernel.place_points(limits, legs, count, points, 0.0) if count else 0
        assert (edge is None) == (placed == 0)
        if edge is not None:
            feasible += 1
            for leg, row in zip(edge.legs, legs[:count], strict=True):
                made = leg_kernel.leg_of(row)
                assert made.kind is leg.kind
                assert made.end_ned == pytest.approx(leg.end_ned, abs=1e-9)
                assert made.energy == pytest.approx(leg.energy, abs=1e-12)
                assert made.heading_rad == pytest.approx(leg.heading_rad, abs=1e-12)
            np.testing.assert_allclose(points[:placed], edge.points, rtol=1e-9, atol=1e-12)
    assert feasible > 20


@pytest.mark.parametrize("name", CONFIGS)
def test_an_edge_joins_its_surfacings_and_keeps_every_limit(name):
    config = CONFIGS[name]
    limits = config.primitives
    feasible = 0
    for start, goal, shape in proposals(config, 300, seed=1):
        edge = propose_edge(config, start, goal, 20.0, shape)
        if edge is None:
            continue
        feasible += 1
        assert edge.legs[0].start_ned == (*start, 0.0)
        assert edge.legs[-1].end_ned == pytest.approx((*goal, 0.0), abs=2e-6)
        assert edge.energy <= 20.0
        for before, after in zip(edge.legs, edge.legs[1:], strict=False):
            assert before.end_ned == after.start_ned
        for leg in edge.legs:
            assert primitive.is_inside(leg, config.domain)
            change = abs(leg.end_ned[2] - leg.start_ned[2])
            if leg.kind is PrimitiveKind.SWIM:
                length = math.dist(leg.start_ned, leg.end_ned)
                low, high = limits.swim_length_min_m, limits.swim_length_max_m
                assert low - 1e-9 <= length <= high + 1e-9
                assert limits.swims_under_water or leg.start_ned[2] == 0.0
            else:
                assert change >= limits.depth_change_min_m - 1e-9
    assert feasible > 20


def test_points_lie_one_interval_apart_and_end_at_the_surface():
    feasible = 0
    joined = 0
    for start, goal, shape in proposals(THESIS_TANK, 100, seed=2):
        edge = propose_edge(THESIS_TANK, start, goal, 20.0, shape)
        if edge is None:
            continue
        feasible += 1
        times = edge.points[:, POINT_TIME]
        surfaced_s = np.cumsum([leg.duration_s for leg in edge.legs])[
            [leg.end_ned[2] == 0.0 for leg in edge.legs]
        ]
        joined += len(surfaced_s) > 1
        for begin_s, end_s in zip((0.0, *surfaced_s), surfaced_s, strict=False):
            of_dive = times[(times > begin_s + 1e-9) & (times <= end_s + 1e-9)]
            np.testing.assert_allclose(np.diff(of_dive[:-1]), 2.0)
            assert begin_s < of_dive[0] <= begin_s + 2.0 + 1e-9
            assert of_dive[-1] == pytest.approx(end_s)
        assert times[-1] == pytest.approx(sum(leg.duration_s for leg in edge.legs))
        np.testing.assert_allclose(
            edge.points[-1, POINT_NORTH : POINT_DOWN + 1], edge.legs[-1].end_ned, atol=1e-9
        )
    assert feasible > 5
    assert joined > 2


def test_points_are_the_same_however_legs_are_cut_into_edges():
    edges = [
        propose_edge(THESIS_TANK, start, goal, 20.0, shape)
        for start, goal, shape in proposals(THESIS_TANK, 60, seed=2)
    ]
    found = [edge for edge in edges if edge is not None]
    whole = planned_points(THESIS_TANK, tuple(leg for edge in found for leg in edge.legs))
    parts = np.concatenate([edge.points for edge in found])
    np.testing.assert_allclose(whole[:, POINT_NORTH:], parts[:, POINT_NORTH:], atol=1e-12)


def test_a_surfacing_restores_the_position():
    legs = (
        primitive.dive(THESIS_TANK, (1.0, 1.0, 0.0), 0.6),
        primitive.dive(THESIS_TANK, (1.0, 1.0, 0.6), 0.0),
    )
    std = planned_points(THESIS_TANK, legs)[:, POINT_STD]
    assert std[-1] < 0.011 < std[-2]
    assert (np.diff(std[:-1]) > 0).all()
