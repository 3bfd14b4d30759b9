"""Plans in a current that differs from place to place and from time to time."""

import base64
import math
import pickle

import numpy as np
import pytest

from autonomy.current.table import FlowRecord, flow_at, is_uniform
from autonomy.planner.check.check import violations
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import drift, edge_kernel, flow_kernel
from autonomy.planner.leg.edge import (
    legs_duration_s,
    planned_points,
    propose_edge,
    random_shape,
    refitted,
)
from autonomy.planner.leg.leg_kernel import LEG_COLUMNS, leg_of
from autonomy.planner.leg.waterway import waterway_of
from autonomy.planner.limits import legs_max, limits_of, points_max
from autonomy.planner.preset import GRACE3, planner_preset
from autonomy.site import LAKE

LAKE_PLANNER = planner_preset("grace3", "lake")


def flow_record(values: np.ndarray, duration_s: float = 7200.0) -> FlowRecord:
    """Keep values of shape (nx, ny, nz, nt, 2) over the lake's domain."""
    domain = GRACE3.domain
    nx, ny, nz, nt, _ = values.shape
    return FlowRecord(
        shape=(nx, ny, nz, nt),
        low=(domain.x_min_m, domain.y_min_m, 0.0),
        high=(domain.x_max_m, domain.y_max_m, domain.depth_max_m),
        from_s=0.0,
        duration_s=duration_s,
        dives=9,
        values=base64.b64encode(values.astype("<f4").tobytes()).decode(),
    )


def in_current(**current: object) -> PlannerConfig:
    said = LAKE_PLANNER.current.model_copy(update=current)
    return LAKE_PLANNER.model_copy(update={"current": said})


def moving(seed: int = 0, size: float = 0.04) -> PlannerConfig:
    """Return settings in a smooth random current that a robot cannot know."""
    rng = np.random.default_rng(seed)
    coarse = rng.normal(0.0, size, (3, 3, 2, 3, 2))
    return in_current(source="map", flow=flow_record(coarse))


def edges(config: PlannerConfig, count: int, seed: int = 0, begin_s: float = 0.0):
    rng = np.random.default_rng(seed)
    water = waterway_of(config, LAKE)
    found = []
    while len(found) < count:
        start = tuple(rng.uniform(120.0, 380.0, 2).tolist())
        goal = tuple((np.array(start) + rng.uniform(-40.0, 40.0, 2)).tolist())
        shape = random_shape(config, rng)
        edge = propose_edge(config, start, goal, 100.0, shape, water, begin_s)
        if edge is not None:
            found.append((start, goal, shape, edge))
    return found


def test_compiled_current_is_the_readable_one() -> None:
    config = moving(1)
    table = config.current.table
    rng = np.random.default_rng(2)
    for x, y, z, t in rng.uniform((-50, -50, -1, -100), (600, 600, 25, 9000), (200, 4)):
        found = flow_kernel.flow_at(table, x, y, z, t)
        np.testing.assert_allclose(found, flow_at(table, x, y, z, t), atol=1e-15)
    assert not is_uniform(table)


def test_still_table_plans_as_the_typed_current_does() -> None:
    north, east = float(np.float32(0.02)), float(np.float32(-0.013))
    typed = in_current(north_m_s=north, east_m_s=east)
    values = np.broadcast_to(np.array([north, east]), (3, 2, 2, 4, 2))
    tabled = in_current(source="map", flow=flow_record(values))
    for start, goal, shape, edge in edges(typed, 20):
        other = propose_edge(tabled, start, goal, 100.0, shape, waterway_of(tabled, LAKE))
        assert other is not None
        for one, two in zip(edge.legs, other.legs, strict=True):
            assert one.kind == two.kind
            np.testing.assert_allclose(one.end_ned, two.end_ned, atol=1e-9)
            np.testing.assert_allclose(one.start_ned, two.start_ned, atol=1e-9)
        np.testing.assert_allclose(edge.points, other.points, atol=1e-9)


@pytest.mark.parametrize("begin_s", [0.0, 3000.0])
def test_compiled_edges_are_the_readable_ones_in_a_moving_current(begin_s: float) -> None:
    config = moving()
    limits, water = limits_of(config, 100.0), waterway_of(config, LAKE)
    legs = np.empty((legs_max(config), LEG_COLUMNS))
    points = np.empty((points_max(config), 5))
    for start, goal, shape, edge in edges(config, 25, begin_s=begin_s):
        count = edge_kernel.propose(limits, water, start, goal, shape, legs, begin_s)
        assert count == len(edge.legs)
        for row, leg in zip(legs[:count], edge.legs, strict=True):
            np.testing.assert_allclose(leg_of(row).end_ned, leg.end_ned, atol=1e-8)
        placed = edge_kernel.place_points(limits, legs, count, points, begin_s)
        np.testing.assert_allclose(points[:placed], edge.points, atol=1e-8)


def test_dives_come_up_where_they_are_meant_to() -> None:
    config = moving(3)
    for _, goal, _, edge in edges(config, 20, seed=1, begin_s=1000.0):
        assert math.dist(edge.points[-1, 1:3], goal) < 0.1
        (course, *_) = drift.courses(config, edge.legs, 1000.0)
        assert course.begin.time_s == 1000.0 + config.mission.turn_time_s


def test_legs_made_for_another_time_are_aimed_anew() -> None:
    config = moving(4)
    legs, here, ends = [], None, []
    rng, water = np.random.default_rng(5), waterway_of(config, LAKE)
    while len(ends) < 4:
        start = here or (200.0, 220.0)
        goal = tuple((np.array(start) + rng.uniform(-30.0, 30.0, 2)).tolist())
        edge = propose_edge(config, start, goal, 100.0, random_shape(config, rng), water)
        if edge is not None:
            legs += edge.legs
            here = goal
            ends.append(goal)
    off = refitted(config, legs)
    before = violations(tuple(legs), config, LAKE)
    after = violations(off, config, LAKE)
    assert any("begins" in one.message for one in before)
    assert not any("begins" in one.message for one in after)
    points = planned_points(config, off)
    for goal in ends[:-1]:
        assert np.hypot(*(points[:, 1:3] - goal).T).min() < 0.2
    assert legs_duration_s(config, off) == pytest.approx(legs_duration_s(config, legs), rel=0.2)
    still = in_current(north_m_s=0.02)
    assert refitted(still, legs) == tuple(legs)


def test_settings_keep_their_flow_and_hide_it_from_forms() -> None:
    config = moving()
    assert PlannerConfig.model_validate(config.model_dump(mode="json")) == config
    again = pickle.loads(pickle.dumps(config))
    np.testing.assert_array_equal(again.current.table.values, config.current.table.values)
    schema = PlannerConfig.model_json_schema()
    assert "source" in str(schema)
    assert "FlowRecord" not in str(schema)
