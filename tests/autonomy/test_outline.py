"""Outlines and charts of any size: what is inside, how far, and what a water makes of them."""

import math
import time

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from autonomy.chart import CHARTS, Chart, ChartError, ChartShelf, DepthGrid, keep_chart, read_chart
from autonomy.outline import Outline, first_crossing
from autonomy.planner.check.clearance import clearance_m, nearest_m
from autonomy.planner.leg.waterway import CLOSED, usable_depth_m, waterway_of
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.site import LAKE, Area, Box, ChartSummary, Site


def wavy(corners=20_000, radius_m=40_000.0):
    angle = np.linspace(0.0, math.tau, corners, endpoint=False)
    radius = radius_m * (1.0 + 0.2 * np.sin(5.0 * angle) + 0.01 * np.sin(700.0 * angle))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


HOLE = wavy(200, 2_000.0)
COAST = Outline([wavy(), HOLE])
TRUTH = Polygon(wavy(), [HOLE])


def test_many_places_are_told_from_20_000_corners_as_another_library_does():
    generator = np.random.default_rng()
    places = generator.uniform(-50_000.0, 50_000.0, (5_000, 2))
    inside = COAST.contains(*places.T)
    assert (inside == shapely.contains_xy(TRUTH, *places.T)).all()
    exact = shapely.distance(TRUTH.boundary, shapely.points(places))
    signed = np.where(inside, -exact, exact)
    near = COAST.distance_m(*places.T, 700.0)
    assert near == pytest.approx(np.clip(signed, -700.0, 700.0), abs=1e-6)
    some = places[:150]
    assert COAST.distance_m(*some.T) == pytest.approx(signed[:150], abs=1e-6)


@given(
    st.lists(
        st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=4, max_size=12, unique=True
    )
)
def test_a_ring_that_crosses_itself_is_found_wherever_it_does(corners):
    ring = np.array(corners, dtype=float)
    crossing = first_crossing(ring)
    if crossing is not None:
        assert not Polygon(ring).is_valid
        i, j = crossing
        sides = [shapely.LineString([ring[k], ring[(k + 1) % len(ring)]]) for k in (i, j)]
        assert sides[0].intersects(sides[1])
    elif Polygon(ring).area > 0.0:
        # neighbours that fold back onto each other enclose nothing there
        along = ring - np.roll(ring, 1, axis=0)
        after = np.roll(along, -1, axis=0)
        is_fold = along[:, 0] * after[:, 1] == along[:, 1] * after[:, 0]
        assert Polygon(ring).is_valid or is_fold.any()


def test_20_000_corners_are_looked_at_in_well_under_a_second():
    began = time.thread_time()
    assert first_crossing(wavy()) is None
    crossed = wavy()
    crossed[[5_000, 5_001]] = crossed[[5_001, 5_000]]
    assert first_crossing(crossed) == (4_999, 5_001)
    assert time.thread_time() - began < 1.0


def test_ways_keep_the_distance_that_another_library_tells():
    generator = np.random.default_rng(5)
    for _ in range(40):
        way = generator.uniform(-35_000.0, 35_000.0, 2) + generator.uniform(-900.0, 900.0, (4, 2))
        line = shapely.LineString(way)
        exact = float(shapely.distance(TRUTH.boundary, line))
        assert clearance_m(COAST, way) == pytest.approx(exact, abs=1e-6)
        within = clearance_m(COAST, way, 500.0)
        assert within == pytest.approx(exact, abs=1e-6) if exact <= 500.0 else within > 500.0
        nearest = nearest_m(COAST, way, -1.0)
        if TRUTH.contains(line):
            assert nearest == pytest.approx(exact, abs=1e-6)
        else:
            assert nearest <= 0.0


def test_a_chart_comes_back_as_it_was_kept_and_a_changed_one_is_not_believed(tmp_path):
    axis = np.linspace(0.0, 100.0, 5)
    chart = Chart((wavy(50, 100.0),), DepthGrid(axis, axis, np.ones((5, 5), np.float32)))
    sha256 = keep_chart(tmp_path, chart)
    assert keep_chart(tmp_path, chart) == sha256
    shelf = ChartShelf()
    assert shelf.find(sha256) is None
    shelf.open(tmp_path)
    found = shelf.find(sha256)
    assert found is not None
    assert found.content() == chart.content()
    [place] = tmp_path.iterdir()
    place.write_bytes(place.read_bytes()[:-1] + b"x")
    other = ChartShelf()
    other.open(tmp_path)
    assert other.find(sha256) is None
    with pytest.raises(ChartError):
        read_chart(b"GRACE chart 1\n\x04\x00\x00\x00{}{}")


@pytest.fixture
def bay(tmp_path):
    """A bay with an island, whose document alone knows less than its chart."""
    shore, island = wavy(2_000, 1_000.0), wavy(100, 60.0)
    axis = np.linspace(-1_300.0, 1_300.0, 400)
    north, east = np.meshgrid(axis, axis, indexing="ij")
    depth = (20.0 - np.hypot(north, east) / 80.0).astype(np.float32)
    sha256 = keep_chart(tmp_path, Chart((shore, island), DepthGrid(axis, axis, depth)))
    CHARTS.open(tmp_path)
    return LAKE.model_copy(
        update={
            "water": Box(x_min_m=-1300, x_max_m=1300, y_min_m=-1300, y_max_m=1300, depth_max_m=20),
            "shoreline": Area(name="Shore", corners_m=((-500, -500), (500, -500), (0, 500))),
            "islands": (
                Area(name="Island", corners_m=((-90, -90), (90, -90), (90, 90), (-90, 90))),
            ),
            "bathymetry": None,
            "chart": ChartSummary(
                sha256=sha256, corners=2100, islands=1, rows=400, columns=400, spacing_m=6.5
            ),
        }
    )


def test_planner_and_floor_look_at_the_chart_where_there_is_one(bay):
    preset = PLANNER_PRESETS["grace3"]
    domain = Box(x_min_m=-700, x_max_m=700, y_min_m=-700, y_max_m=700, depth_max_m=16.0)
    config = preset.model_copy(update={"domain": domain})
    places = np.array([(0.0, 0.0), (72.0, 72.0), (0.0, 650.0), (1250.0, 1250.0)])
    depth = usable_depth_m(config, bay, *places.T)
    assert depth[0] == CLOSED  # the island
    assert depth[1] == 16.0
    assert depth[2] > 5.0  # outside of the document's own outline
    assert depth[3] == CLOSED
    assert float(bay.floor_m(0.0, 800.0)) == pytest.approx(10.0, abs=0.05)
    raster = waterway_of(config, bay)
    generator = np.random.default_rng()
    at = generator.uniform(-690.0, 690.0, (3_000, 2))
    cell = np.floor((at - [raster.x_min, raster.y_min]) / raster.cell).astype(int)
    held = raster.depth[cell[:, 0], cell[:, 1]]
    assert (held <= usable_depth_m(config, bay, *at.T) + 1e-9).all()
    assert (held > 0.0).mean() > 0.8
    assert bay.clearance_m(0.0, 0.0) < 0.0
    assert bay.clearance_m(0.0, 300.0) == pytest.approx(235.0, abs=25.0)


def test_without_the_chart_the_document_alone_is_obeyed(bay):
    lost = bay.chart.model_copy(update={"sha256": "0" * 64})
    short = bay.model_copy(update={"chart": lost})
    assert short.clearance_m(0.0, 0.0) < 0.0
    assert short.clearance_m(72.0, 72.0) < 0.0
    assert short.clearance_m(0.0, 650.0) < 0.0
    assert short.shore is not None
    assert not short.shore.contains(0.0, 0.0)
    assert float(short.floor_m(0.0, 800.0)) == 20.0


def test_keep_outs_of_a_water_count_beside_those_of_a_survey():
    keep_out = Area(name="Swimmers", corners_m=((200, 200), (300, 200), (300, 300), (200, 300)))
    site = LAKE.model_copy(update={"keep_outs": (keep_out,)})
    config = PLANNER_PRESETS["grace3"]
    assert usable_depth_m(config, LAKE, 250.0, 250.0) > 0.0
    assert usable_depth_m(config, site, 250.0, 250.0) == CLOSED


def test_a_place_tells_its_other_position_and_two_that_differ_are_refused():
    document = LAKE.model_dump(mode="json")
    dock = {"name": "Dock", "kind": "dock", "north_m": 30.0, "east_m": 40.0}
    [place] = Site.model_validate({**document, "places": [dock]}).places
    assert place.latitude_deg == pytest.approx(
        LAKE.origin_latitude_deg + 30.0 / 111_090.0, abs=1e-6
    )
    globe = {"latitude_deg": place.latitude_deg, "longitude_deg": place.longitude_deg}
    [same] = Site.model_validate({**document, "places": [{"name": "Dock", **globe}]}).places
    assert (same.north_m, same.east_m) == (pytest.approx(30.0), pytest.approx(40.0))
    with pytest.raises(ValueError, match="is at two places"):
        Site.model_validate({**document, "places": [{**dock, **globe, "north_m": 33.0}]})
    with pytest.raises(ValueError, match="must have different names"):
        Site.model_validate({**document, "places": [dock, dock]})
