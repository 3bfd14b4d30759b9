import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import edge_kernel, leg_kernel, waterway_kernel
from autonomy.planner.leg.edge import propose_edge
from autonomy.planner.leg.waterway import (
    CLOSED,
    chords,
    depth_at,
    holds_line,
    usable_depth_m,
    waterway_of,
)
from autonomy.planner.limits import legs_max, limits_of, points_max
from autonomy.planner.plan import PrimitiveKind
from autonomy.site import LAKE, TANK, Area, Box, Site
from tests.autonomy.planner_problem import THESIS_TANK, TOLD
from tests.autonomy.planner_water import (
    BUOY,
    POOL,
    leaves_water_by_m,
    pool_config,
    proposals,
    true_track,
)

CURRENTS = {"still": (0.0, 0.0), "slow": (0.004, -0.003), "strong": (-0.02, 0.015)}
WATERS = {
    f"{water} {name}": (site, current)
    for water, site in (("pool", POOL), ("tank", None))
    for name, current in CURRENTS.items()
}


def points_of(domain: Box, count: int, seed: int = 0) -> np.ndarray:
    low = (domain.x_min_m, domain.y_min_m, 0.0)
    high = (domain.x_max_m, domain.y_max_m, domain.depth_max_m)
    return np.random.default_rng(seed).uniform(low, high, (count, 3))


def test_where_only_the_domain_limits_plans_there_is_no_raster():
    assert waterway_of(THESIS_TANK, None).depth.shape == (0, 0)
    assert waterway_of(THESIS_TANK, TANK).depth.shape == (0, 0)
    assert waterway_of(THESIS_TANK, TANK).is_everywhere


def test_the_raster_is_never_deeper_than_the_water_and_hardly_shallower():
    config = pool_config()
    waterway = waterway_of(config, POOL)
    points = points_of(config.domain, 20_000)
    exact = usable_depth_m(config, POOL, points[:, 0], points[:, 1])
    raster = np.array([depth_at(waterway, x, y) for x, y, _ in points])
    assert (raster <= exact).all()
    assert (raster == CLOSED).sum() > 1000
    assert (raster > 0.0).sum() > 5000
    both = (raster > 0.0) & (exact > 0.0)
    steepest = 1.5
    assert (exact - raster)[both].max() < 2.0 * waterway.cell * steepest
    assert ((raster == CLOSED) & (exact > 0.0)).mean() < 0.06


def test_a_depth_holds_around_its_cell_by_the_slack():
    config = pool_config()
    waterway = waterway_of(config, POOL)
    for x, y, _ in points_of(config.domain, 3000, seed=1):
        around = waterway.slack * np.array([(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)])
        exact = usable_depth_m(config, POOL, x + around[:, 0], y + around[:, 1])
        assert depth_at(waterway, x, y) <= exact.min()


def test_compiled_and_readable_ways_are_the_same():
    config = pool_config()
    waterway = waterway_of(config, POOL)
    starts = points_of(config.domain, 1500, seed=2)
    ends = starts + np.random.default_rng(3).normal(0.0, 0.15, starts.shape)
    ends[::7, 0] = starts[::7, 0]
    ends[::5, 1] = starts[::5, 1]
    verdicts = []
    for start, end in zip(starts.tolist(), np.abs(ends).tolist(), strict=True):
        verdicts.append(holds_line(waterway, tuple(start), tuple(end)))
        assert waterway_kernel.holds_line(waterway, tuple(start), tuple(end)) == verdicts[-1]
        is_open = depth_at(waterway, start[0], start[1]) >= 0.0
        assert waterway_kernel.is_open(waterway, start[0], start[1]) == is_open
    assert 100 < sum(verdicts) < 1400


@settings(deadline=None)
@given(
    radius=st.floats(0.01, 50.0),
    turn=st.floats(-30.0, 30.0).filter(lambda turn: abs(turn) > 1e-3),
)
def test_chords_are_nowhere_farther_off_an_arc_than_the_slack(radius, turn):
    waterway = waterway_of(THESIS_TANK, None)._replace(slack=0.004)
    count = chords(waterway, radius, turn)
    assert count == waterway_kernel.chords(waterway, radius, turn)
    assert radius * (1.0 - math.cos(0.5 * turn / count)) <= waterway.slack * (1.0 + 1e-9)


@pytest.mark.parametrize("name", WATERS)
def test_compiled_and_readable_edges_among_keep_outs_are_the_same(name):
    site, current = WATERS[name]
    config = pool_config(*current)
    waterway = waterway_of(config, site)
    limits = limits_of(config, 20.0)
    legs = np.empty((legs_max(config), leg_kernel.LEG_COLUMNS))
    points = np.empty((points_max(config), 5))
    feasible = 0
    for start, goal, shape in proposals(config, 250):
        edge = propose_edge(config, start, goal, 20.0, shape, waterway)
        count = edge_kernel.propose(limits, waterway, start, goal, shape, legs, 0.0)
        placed = edge_kernel.place_points(limits, legs, count, points, 0.0) if count else 0
        assert (edge is None) == (placed == 0)
        if edge is not None:
            feasible += 1
            for leg, row in zip(edge.legs, legs[:count], strict=True):
                made = leg_kernel.leg_of(row)
                assert made.kind is leg.kind
                assert made.start_ned == pytest.approx(leg.start_ned, abs=1e-9)
                assert made.end_ned == pytest.approx(leg.end_ned, abs=1e-9)
                assert made.duration_s == pytest.approx(leg.duration_s, abs=1e-9)
                assert made.energy == pytest.approx(leg.energy, abs=1e-9)
            np.testing.assert_allclose(points[:placed], edge.points, rtol=1e-9, atol=1e-9)
    assert feasible > 5


@settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    current=st.tuples(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02)),
    margin=st.floats(0.0, 0.12),
)
def test_no_accepted_edge_leaves_the_water(seed, current, margin):
    config = pool_config(*current).model_copy(update={"margin_m": margin})
    limits = limits_of(config, 20.0)
    waterway = waterway_of(config, POOL)
    legs = np.empty((legs_max(config), leg_kernel.LEG_COLUMNS))
    for start, goal, shape in proposals(config, 150, seed):
        count = edge_kernel.propose(limits, waterway, start, goal, shape, legs, 0.0)
        if count:
            flown = tuple(leg_kernel.leg_of(row) for row in legs[:count])
            track = true_track(config, flown)
            assert leaves_water_by_m(config, POOL, track) <= 1e-9
            assert math.dist(track[-1, :2], goal) < 2e-6
            assert config.domain.contains(*track.min(axis=0), margin_m=1e-6)
            assert config.domain.contains(*track.max(axis=0), margin_m=1e-6)


def test_spirals_are_judged_all_along_their_bend():
    """A keep-out that only the bend of spirals meets, not their ends."""
    config = pool_config()
    limits = limits_of(config, 20.0)
    waterway = waterway_of(config, None)
    legs = np.empty((legs_max(config), leg_kernel.LEG_COLUMNS))
    spirals = 0
    for start, goal, shape in proposals(config, 1500, seed=5):
        count = edge_kernel.propose(limits, waterway, start, goal, shape, legs, 0.0)
        for leg in (leg_kernel.leg_of(row) for row in legs[:count]):
            if leg.kind is PrimitiveKind.SPIRAL:
                spirals += 1
                track = true_track(config, (leg,), per_leg=400)
                assert BUOY.distance_m(track[:, 0], track[:, 1]).min() >= config.margin_m
    assert spirals > 50


def test_nothing_surfaces_on_land_or_in_a_keep_out():
    config = pool_config()
    limits = limits_of(config, 20.0)
    waterway = waterway_of(config, POOL)
    assert not waterway_kernel.is_open(waterway, 1.45, 0.65)
    assert not waterway_kernel.is_open(waterway, 2.74, 0.1)
    assert waterway_kernel.is_open(waterway, 1.0, 0.5)
    legs = np.empty((legs_max(config), leg_kernel.LEG_COLUMNS))
    for goal in ((1.45, 0.65), (2.74, 0.1)):
        for _, _, shape in proposals(config, 200):
            assert edge_kernel.propose(limits, waterway, (1.0, 0.5), goal, shape, legs, 0.0) == 0


def test_margins_shrink_what_may_be_used():
    sizes = []
    for margin, floor_margin in ((0.0, 0.0), (0.05, 0.0), (0.05, 0.1), (0.2, 0.1)):
        config = pool_config().model_copy(
            update={"margin_m": margin, "floor_margin_m": floor_margin}
        )
        sizes.append(float(np.maximum(waterway_of(config, POOL).depth, 0.0).mean()))
    assert sizes == sorted(sizes, reverse=True)
    assert len(set(sizes)) == 4


def test_most_of_the_lake_can_be_surveyed():
    config = TOLD["grace3"]
    depth = waterway_of(config, LAKE).depth
    assert (depth > 0.0).mean() > 0.85
    assert (depth >= 10.0).mean() > 0.6
    assert (depth < config.domain.depth_max_m).any()


def test_a_raster_of_many_keep_outs_is_ready_soon_and_a_long_domain_has_square_cells():
    corners = np.array([(0.0, 0.0), (6.0, 1.0), (4.0, 5.0)])
    areas = tuple(
        Area(
            name=str(i),
            corners_m=tuple(map(tuple, (corners + np.array([90.0 * i, 20.0])).tolist())),
        )
        for i in range(32)
    )
    domain = Box(x_min_m=-10.0, x_max_m=3000.0, y_min_m=0.0, y_max_m=100.0, depth_max_m=16.0)
    config = PlannerConfig.model_validate(
        TOLD["grace3"].model_dump() | {"domain": domain, "keep_outs": areas}
    )
    waterway = waterway_of(config, None)
    assert waterway.depth.shape[0] == 256
    assert waterway.depth.shape[1] == math.ceil(100.0 / waterway.cell)
    for area in areas:
        assert depth_at(waterway, *np.mean(area.corners_m, axis=0)) == CLOSED
    assert (waterway.depth > 0.0).mean() > 0.5


def test_a_floor_surveyed_more_finely_than_the_raster_is_met_at_its_highest():
    north = tuple(np.linspace(0.0, 2.75, 250))
    depths = np.full((250, 2), 0.6)
    depths[123] = 0.3
    site = Site.model_validate(
        TANK.model_dump()
        | {"bathymetry": {"north_m": north, "east_m": (0.0, 1.37), "depth_m": depths.tolist()}}
    )
    config = THESIS_TANK.model_copy(update={"domain": Box(x_max_m=27.5)})
    assert waterway_of(config, site).depth.min() == pytest.approx(0.3)
