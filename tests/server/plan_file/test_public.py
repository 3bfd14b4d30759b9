"""Public plan files: the figures that they must come to (see ``public.py`` for the sources)."""

import itertools
import math

import pytest

from autonomy.design.document import Lawnmower, Way
from autonomy.frames import wgs84_from_ned
from autonomy.site import LAKE, Box, Site
from server.plan_file.proposal import PlanFileProposal, ReadChoices
from server.plan_file.reading import read_plan_file
from server.water.proposal import ReadingError
from tests.server.plan_file import public

SHARE = 1e-4
"""Tolerance of areas and ways."""
ALL = Box(x_min_m=-5e3, x_max_m=5e3, y_min_m=-5e3, y_max_m=5e3, depth_max_m=100.0)


def sea(latitude: float, longitude: float) -> Site:
    return Site(
        name="Sea",
        kind="sea",
        water=ALL,
        domain=ALL,
        origin_latitude_deg=latitude,
        origin_longitude_deg=longitude,
        radio_under_water=False,
        variable="temperature",
    )


CALIFORNIA, AUSTRALIA = sea(33.81, -118.394), sea(-35.36, 149.16)


def read(name: str, content: bytes, site: Site, **choices: float | bool | None) -> PlanFileProposal:
    return read_plan_file(name, content, site, ReadChoices.model_validate(choices))


def places(found: PlanFileProposal) -> list[tuple[float, float]]:
    assert isinstance(found.document.content, Way)
    return [waypoint.ne_m for waypoint in found.document.content.waypoints]


def depths(found: PlanFileProposal) -> list[float]:
    assert isinstance(found.document.content, Way)
    usual = found.document.manner
    manners = [waypoint.manner(usual) for waypoint in found.document.content.waypoints]
    return [0.0 if manner.motion == "swim" else manner.deep_m for manner in manners]


def keys(found: PlanFileProposal) -> set[str]:
    return {question.key for question in found.needs}


def test_a_dive_mission_of_ardupilot():
    found = read("sub_mission.txt", public.dive_mission(), CALIFORNIA)
    way = [math.dist(a, b) for a, b in itertools.pairwise(places(found))]
    assert way == pytest.approx([41.67, 58.79], abs=0.005)
    assert depths(found) == [50.0, 50.0, 50.0]
    (home,) = found.marks
    assert home.kind == "home"
    assert math.hypot(*home.place_m) == pytest.approx(13_000e3, rel=0.1)
    assert "584" not in home.name
    assert "583.97 m" in home.note
    assert [(one.place, one.value) for one in found.refused] == [
        ("item 4", "command 18 (loiter turns)"),
        ("item 5", "command 21 (land)"),
    ]
    assert not found.is_ready
    assert keys(found) >= {"imports_rest", "land_surfaces"}
    rest = read("sub_mission.txt", public.dive_mission(), CALIFORNIA, imports_rest=True)
    assert rest.is_ready
    assert rest.document == found.document


def test_the_way_to_the_refused_loiter_is_the_known_one():
    moved = public.dive_mission().replace(b"\t3\t18\t", b"\t3\t16\t")
    third, fourth = places(read("sub.txt", moved, CALIFORNIA))[2:4]
    assert math.dist(third, fourth) == pytest.approx(54.44, abs=0.005)
    slope = math.atan2(25.0, math.dist(third, fourth))
    assert math.degrees(slope) == pytest.approx(24.66, abs=0.005)


def test_a_landing_becomes_a_surfacing_only_when_that_is_confirmed():
    found = read("sub.txt", public.dive_mission(), CALIFORNIA, land_surfaces=True)
    content = found.document.content
    assert isinstance(content, Way)
    assert [waypoint.surfaces for waypoint in content.waypoints] == [None, None, None, True]
    assert [one.place for one in found.refused] == ["item 4"]


def test_a_terrain_mission_of_ardupilot():
    found = read("terrain_mission.txt", public.terrain_mission(), CALIFORNIA)
    assert depths(found) == [25.0]
    assert [one.place for one in found.refused] == ["item 2", "item 3", "item 4"]
    assert all("above the floor cannot be planned" in one.reason for one in found.refused)
    assert [one.value for one in found.refused] == ["-25 m", "10 m", "15 m"]


def test_heights_above_a_charted_floor_become_depths():
    north, east = 200.0, 250.0
    latitude, longitude = wgs84_from_ned(
        (north, east), LAKE.origin_latitude_deg, LAKE.origin_longitude_deg
    ).tolist()
    rows = [public.flown(3, 42.76, -84.38, 0.0), public.flown(10, latitude, longitude, 7.0)]
    found = read("lake.waypoints", public.wpl(rows), LAKE)
    assert depths(found) == pytest.approx([float(LAKE.floor_m(north, east)) - 7.0], abs=1e-6)


def test_a_drone_plan_is_above_the_water_until_its_sign_is_turned():
    found = read("simple.plan", public.canberra(), AUSTRALIA)
    assert places(found) == []
    assert [one.place for one in found.refused] == [f"item {n}" for n in range(1, 10)]
    assert found.refused[0].value == "command 22 (takeoff)"
    assert found.refused[1].value == "50 m"
    assert "50.0 m above the water" in found.refused[1].reason
    assert "turns_sign" in keys(found)
    turned = read("simple.plan", public.canberra(), AUSTRALIA, turns_sign=True)
    assert [one.place for one in turned.refused] == ["item 1"]
    assert depths(turned) == [50.0] * 8
    assert turned.distance_m == pytest.approx(2640.9, rel=SHARE)
    assert isinstance(turned.document.content, Way)
    assert turned.document.content.returns
    fence, circle = turned.areas
    assert (fence.role, len(fence.corners_deg)) == ("outline", 4)
    assert fence.area_m2 == pytest.approx(1_592_095.0, rel=SHARE)
    assert "463.71 m" in circle.note
    assert len(circle.corners_deg) == 64
    chord = 2.0 * 463.7075269143206 * math.sin(math.pi / 64.0)
    assert circle.circumference_m == pytest.approx(64.0 * chord, rel=SHARE)
    assert [mark.kind for mark in turned.marks] == ["home", "rally", "rally", "rally"]
    assert any("15 m/s" in note for note in turned.notes)


def test_a_file_of_fences_alone_brings_its_areas():
    found = read("ce_geofence_rd_2.plan", public.fences_alone(), sea(38.7508, -77.4971))
    assert places(found) == []
    assert found.refused == ()
    assert [(area.role, area.area_m2) for area in found.areas] == [
        ("outline", pytest.approx(931.15, rel=SHARE)),
        ("keep_out", pytest.approx(465.35, rel=SHARE)),
    ]
    covered = read("ce.plan", public.fences_alone(), sea(38.7508, -77.4971), area=1)
    assert isinstance(covered.document.content, Lawnmower)
    assert len(covered.document.content.area) == 4


def test_the_polygon_of_a_survey_of_an_unknown_version_is_taken_with_a_warning():
    site = sea(47.3977, 8.546)
    found = read("survey.plan", public.zurich_survey(), site)
    assert [one.place for one in found.refused] == ["item 1"]
    assert found.refused[0].value == "command 530 (set camera mode)"
    (area,) = found.areas
    assert (area.role, len(area.corners_m)) == ("survey", 4)
    assert area.area_m2 == pytest.approx(1863.52, rel=SHARE)
    assert any("version 9" in note for note in found.notes)
    assert any("50 m above the water" in note for note in found.notes)
    content = found.document.content
    assert isinstance(content, Lawnmower)
    assert (content.spacing_m, math.degrees(content.heading_rad)) == (25.0, pytest.approx(90.0))
    points = read("survey.plan", public.zurich_survey(), site, takes_transects=True)
    assert places(points) == []
    assert [one.place for one in points.refused][1] == "item 2, point 1"
    turned = read(
        "survey.plan", public.zurich_survey(), site, takes_transects=True, turns_sign=True
    )
    assert depths(turned) == [50.0] * 8
    assert any("8 points" in question.text for question in found.needs)
    bare = read("survey.plan", public.zurich_survey().replace(b"VisualTransectPoints", b"-"), site)
    assert not any("transects" in question.text for question in bare.needs)


def test_a_polygon_of_kml():
    found = read("PolygonGood.kml", public.polygon_kml(), sea(47.66, -122.105))
    (area,) = found.areas
    assert (area.name, area.role, len(area.corners_deg)) == ("Untitled Polygon", "outline", 4)
    assert area.area_m2 == pytest.approx(4633.24, rel=SHARE)
    assert area.circumference_m == pytest.approx(311.58, rel=SHARE)


def test_broken_kml_is_refused_with_its_line():
    text = "Incorrectly formed XML test file\n"
    with pytest.raises(ReadingError) as refusal:
        read("PolygonBad.kml", public.polygon_kml(before=text, has_ring=False), CALIFORNIA)
    assert refusal.value.faults[0][0] == "line 1"
    with pytest.raises(ReadingError, match=r"LinearRing \(line 8\)") as refusal:
        read("PolygonBad.kml", public.polygon_kml(has_ring=False), CALIFORNIA)
    assert refusal.value.faults[0][0] == "feature 1"


def test_a_file_of_elsewhere_comes_here_when_it_is_asked_to():
    far = read("simple.plan", public.canberra(), LAKE, turns_sign=True)
    assert places(far) == []
    assert "is_moved" in keys(far)
    assert any(" km from Practice lake" in one.reason for one in far.refused)
    near = read("simple.plan", public.canberra(), LAKE, turns_sign=True, is_moved=True)
    home = read("simple.plan", public.canberra(), AUSTRALIA, turns_sign=True)
    assert near.distance_m == pytest.approx(home.distance_m, rel=1e-5)
    norths, easts = zip(*places(near), strict=True)
    middle = (0.5 * (min(norths) + max(norths)), 0.5 * (min(easts) + max(easts)))
    assert middle == pytest.approx((250.0, 250.0), abs=0.5)
