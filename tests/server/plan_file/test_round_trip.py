"""Designs that are written and read again: what a format can express comes back.

Places to 1e-7 degrees, depths to 1 mm, in waters drawn over the globe.
"""

import itertools
import json
import math
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.mavwp import MAVWPLoader

from autonomy.design.document import (
    Design,
    Lawnmower,
    Manner,
    Mooring,
    Section,
    Spot,
    Star,
    StationKeep,
    SurfacingRules,
    Way,
    Waypoint,
)
from autonomy.site import LAKE, Area, Site
from server.plan_file.leg import WrittenLeg, written_legs
from server.plan_file.loss import Format
from server.plan_file.proposal import PlanFileProposal, ReadChoices
from server.plan_file.reading import read_plan_file
from server.plan_file.writing import NothingToWriteError, WrittenPlan, write_plan_file

FORMATS: tuple[Format, ...] = ("qgc_plan", "wpl", "kml", "geojson", "csv")
METRES = 1e-3
WHOLE = Manner(deep_m=12.0, glide_angle_rad=0.6)
"""What the robot does of which a design says nothing."""
PLACE_DEG = {"geojson": 1e-7, "six decimals": 6e-7}
"""RFC 7946 recommends no more decimals; the others come back to 1 mm."""
MILLIMETRE_DEG = 1e-3 / 111_320.0


def depth() -> st.SearchStrategy[float]:
    return st.floats(0.01, 900.0)


speed = st.none() | st.floats(0.01, 5.0).map(lambda value: round(value, 4))
waypoint = st.builds(
    Waypoint,
    north_m=st.floats(-20_000, 20_000),
    east_m=st.floats(-20_000, 20_000),
    name=st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), max_size=20),
    motion=st.sampled_from([None, "glide", "swim"]),
    deep_m=st.none() | depth(),
    shallow_m=st.none(),
    glide_angle_rad=st.none() | st.floats(0.05, 1.5),
    speed_m_s=speed,
    surfaces=st.sampled_from([None, True, False]),
)
manner = st.builds(
    Manner,
    motion=st.sampled_from(["glide", "swim"]),
    deep_m=st.none() | depth(),
    glide_angle_rad=st.none() | st.floats(0.05, 1.5),
    glide_speed_m_s=speed,
    swim_speed_m_s=speed,
)
design = st.builds(
    Design,
    content=st.builds(Way, waypoints=st.lists(waypoint, min_size=1, max_size=12).map(tuple)),
    manner=manner,
    surfacing=st.builds(
        SurfacingRules, at_waypoints=st.booleans(), every_s=st.none() | st.floats(60, 9e4)
    ),
)
water = st.builds(
    lambda latitude, longitude: LAKE.model_copy(
        update={"origin_latitude_deg": latitude, "origin_longitude_deg": longitude}
    ),
    st.floats(1, 80) | st.floats(-80, -1),
    st.floats(-170, 170),
)
"""Not where latitude 0, longitude 0 stands for no place."""


def whole(manner: Manner) -> Manner:
    """Return a manner with nothing left to the robot."""
    said = {name: value for name, value in manner if value is not None}
    return Manner(**(WHOLE.model_dump() | said))


def way_of(one: Design) -> Sequence[Waypoint]:
    assert isinstance(one.content, Way)
    return one.content.waypoints


def written(format: Format, one: Design, site: Site, way: Sequence[Waypoint] = ()) -> WrittenPlan:
    return write_plan_file(format, one, way or way_of(one), whole(one.manner), site, "North bay")


def read_again(file: WrittenPlan, site: Site, **choices: object) -> PlanFileProposal:
    chosen = ReadChoices.model_validate(choices)
    return read_plan_file(file.file_name, file.content, site, chosen)


def legs(one: Design, site: Site) -> list[WrittenLeg]:
    return written_legs(way_of(one), whole(one.manner), site)


def assert_same_way(format: str, first: list[WrittenLeg], second: list[WrittenLeg]) -> None:
    assert len(first) == len(second)
    nearness = PLACE_DEG.get(format, MILLIMETRE_DEG)
    for sent, back in zip(first, second, strict=True):
        assert back.place_deg[0] == pytest.approx(sent.place_deg[0], abs=nearness)
        beside = math.cos(math.radians(sent.place_deg[0]))
        across = nearness if format in PLACE_DEG else nearness / beside
        assert back.place_deg[1] == pytest.approx(sent.place_deg[1], abs=across)
        assert back.motion == sent.motion
        assert back.depth_m == pytest.approx(sent.depth_m, abs=METRES)


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(FORMATS), design, water)
def test_places_and_depths_come_back(format: Format, one: Design, site: Site):
    found = read_again(written(format, one, site), site)
    assert found.refused == ()
    assert found.is_ready
    assert_same_way(format, legs(one, site), legs(found.document, site))


@settings(deadline=None, max_examples=60)
@given(design, water)
def test_a_plan_of_qgroundcontrol_brings_the_whole_design_back(one: Design, site: Site):
    file = written("qgc_plan", one, site)
    assert read_again(file, site).document == one
    assert all(loss.is_kept for loss in file.losses)


@settings(deadline=None, max_examples=60)
@given(design, water)
def test_csv_brings_names_manners_speeds_and_surfacings_back(one: Design, site: Site):
    back = legs(read_again(written("csv", one, site), site).document, site)
    for sent, again in zip(legs(one, site), back, strict=True):
        assert (again.name, again.surfaces) == (sent.name, sent.surfaces)
        assert again.speed_m_s == sent.speed_m_s
        if sent.motion == "glide":
            if sent.glide_angle_rad is not None:
                assert again.glide_angle_rad == pytest.approx(sent.glide_angle_rad, abs=1e-7)
            assert again.shallow_m == pytest.approx(sent.shallow_m, abs=METRES)


@settings(deadline=None, max_examples=60)
@given(design, water)
def test_items_alone_bring_the_speeds_back(one: Design, site: Site):
    plan = json.loads(written("qgc_plan", one, site).content)
    del plan["grace"]
    found = read_plan_file("a.plan", json.dumps(plan).encode(), site, ReadChoices())
    lines = read_again(written("wpl", one, site), site)
    for back in (found, lines):
        sent = legs(one, site)
        assert_same_way("qgc_plan", sent, legs(back.document, site))
        told = [leg.speed_m_s for leg in legs(back.document, site)]
        if one.manner.swim_speed_m_s is None and back is found:
            # QGroundControl needs a speed, so it is told one
            told = [s if leg.speed_m_s or leg.motion == "glide" else None
                    for s, leg in zip(told, sent, strict=True)]  # fmt: skip
        assert told == [leg.speed_m_s for leg in sent]


@settings(deadline=None, max_examples=60)
@given(one=design, site=water)
def test_pymavlink_reads_the_same_items_from_our_lines(one: Design, site: Site, tmp_path_factory):
    file = written("wpl", one, site)
    path = tmp_path_factory.mktemp("wpl") / file.file_name
    path.write_bytes(file.content)
    loader = MAVWPLoader()
    loader.load(str(path))
    items = [loader.wp(number) for number in range(loader.count())]
    assert (items[0].x, items[0].y) == pytest.approx(
        (site.origin_latitude_deg, site.origin_longitude_deg), abs=1e-8
    )
    flown = [item for item in items[1:] if item.command == 16]
    for sent, item in zip(legs(one, site), flown, strict=True):
        assert (item.x, item.y) == pytest.approx(sent.place_deg, abs=1e-8)
        assert item.z == pytest.approx(-sent.depth_m, abs=METRES)
        assert item.frame == 3


@settings(deadline=None, max_examples=60)
@given(one=design, site=water)
def test_we_read_what_pymavlink_writes_of_our_lines(one: Design, site: Site, tmp_path_factory):
    folder = tmp_path_factory.mktemp("wpl")
    (folder / "ours.txt").write_bytes(written("wpl", one, site).content)
    loader = MAVWPLoader()
    loader.load(str(folder / "ours.txt"))
    loader.save(str(folder / "theirs.txt"))
    found = read_plan_file("theirs.txt", (folder / "theirs.txt").read_bytes(), site, ReadChoices())
    assert_same_way("six decimals", legs(one, site), legs(found.document, site))


SQUARE = tuple(Spot(north_m=n, east_m=e) for n, e in ((0, 0), (100, 0), (100, 80), (0, 80)))
PATTERNS = {
    "lawnmower": Lawnmower(area=SQUARE, spacing_m=20.0),
    "star": Star(centre=SQUARE[0], radius_m=40.0),
    "section": Section(line=SQUARE[:2], repeats=3),
    "virtual mooring": Mooring(place=SQUARE[0], duration_s=3600.0),
    "stay at the surface within 9 m": StationKeep(place=SQUARE[0], radius_m=9.0, duration_s=3600.0),
}
LAID_OUT = tuple(Waypoint(north_m=spot.north_m, east_m=spot.east_m) for spot in SQUARE)


@pytest.mark.parametrize("word", PATTERNS)
@pytest.mark.parametrize("format", FORMATS)
def test_a_pattern_is_written_as_its_waypoints_and_that_is_told(format: Format, word: str):
    one = Design(content=PATTERNS[word])
    file = written(format, one, LAKE, LAID_OUT)
    assert any(word in loss.text for loss in file.losses)
    again = read_again(file, LAKE).document
    if format == "qgc_plan":
        assert again == one
    else:
        assert [at.ne_m for at in way_of(again)] == [
            pytest.approx(spot.ne_m, abs=0.02) for spot in SQUARE
        ]


@pytest.mark.parametrize("format", FORMATS)
def test_what_is_lost_is_told_and_nothing_else(format: Format):
    plain = Design(
        content=Way(waypoints=LAID_OUT), manner=Manner(motion="swim"), surfacing=SurfacingRules()
    )
    assert written(format, plain, LAKE).losses == ()
    rules = SurfacingRules(every_s=600.0, max_uncertainty_m=3.0, at_waypoints=False)
    rich = Design(
        content=Way(waypoints=(LAID_OUT[0].model_copy(update={"name": "A", "surfaces": True}),)),
        manner=Manner(
            shallow_m=0.2, glide_speed_m_s=0.1, floor_clearance_m=1.0, glide_angle_rad=0.5
        ),
        surfacing=rules,
    )
    told = " ".join(loss.text for loss in written(format, rich, LAKE).losses)
    assert "600 s" in told
    assert "less certain than 3 m" in told
    assert "12 m are written" in told
    assert "clearance above the floor" in told
    assert ("glide angle" in told) is (format != "csv")
    assert ("name of a waypoint" in told) is (format != "csv")
    assert ("the speeds" in told) is (format in ("kml", "geojson"))


@pytest.mark.parametrize("format", ["kml", "geojson", "csv"])
def test_what_is_lost_stands_in_the_file_too(format: Format):
    one = Design(content=Way(waypoints=LAID_OUT), surfacing=SurfacingRules(every_s=600.0))
    file = written(format, one, LAKE)
    assert "comes up at least every 600 s" in file.content.decode()


def test_a_plan_whose_items_were_changed_gives_up_what_was_kept():
    file = written("qgc_plan", Design(content=PATTERNS["star"]), LAKE, LAID_OUT)
    changed = json.loads(file.content)
    changed["mission"]["items"][1]["params"][4] += 2e-5
    found = read_plan_file("a.plan", json.dumps(changed).encode(), LAKE, ReadChoices())
    assert isinstance(found.document.content, Way)
    assert any("were changed by another program" in note for note in found.notes)
    reordered = json.loads(file.content)
    reordered["mission"]["items"].reverse()
    found = read_plan_file("a.plan", json.dumps(reordered).encode(), LAKE, ReadChoices())
    assert isinstance(found.document.content, Way)


@pytest.mark.parametrize(
    ("part", "why"),
    [
        ({"version": 2}, "another version"),
        ("text", "another version"),
        ({"design": {"content": {"kind": "rocket"}}}, "holds no design: content"),
        ({"origin": None}, "names no origin"),
    ],
)
def test_a_kept_part_of_another_shape_is_left_out_with_a_word(part: object, why: str):
    document = json.loads(written("qgc_plan", Design(content=PATTERNS["star"]), LAKE, LAID_OUT)
                          .content)  # fmt: skip
    document["grace"] = {**document["grace"], **part} if isinstance(part, dict) else part
    found = read_plan_file("a.plan", json.dumps(document).encode(), LAKE, ReadChoices())
    assert isinstance(found.document.content, Way)
    assert any(why in note for note in found.notes)


def test_a_kept_design_comes_to_another_origin_of_the_same_water():
    one = Design(content=PATTERNS["lawnmower"])
    file = written("qgc_plan", one, LAKE, LAID_OUT)
    other = LAKE.model_copy(update={"origin_latitude_deg": LAKE.origin_latitude_deg - 0.001})
    content = read_again(file, other).document.content
    assert isinstance(content, Lawnmower)
    assert [at.ne_m for at in content.area] == [
        pytest.approx((spot.north_m + 111.08, spot.east_m), abs=0.1) for spot in SQUARE
    ]
    moved = read_again(file, LAKE, is_moved=True).document.content
    assert isinstance(moved, Lawnmower)
    assert moved.area[0].ne_m == pytest.approx((200.0, 210.0), abs=0.1)


def test_fences_and_keep_outs_of_the_water_go_along_as_areas():
    site = LAKE.model_copy(
        update={
            "keep_outs": (Area(name="Wreck", corners_m=((90, 90), (120, 90), (120, 130))),),
            "islands": (Area(name="Isle", corners_m=((290, 290), (320, 290), (320, 330))),),
        }
    )
    one = Design(content=Way(waypoints=LAID_OUT))
    found = read_again(written("qgc_plan", one, site), site)
    assert [(area.name, area.role) for area in found.areas] == [
        (LAKE.name, "outline"),
        ("Isle", "keep_out"),
        ("Wreck", "keep_out"),
    ]
    assert found.areas[2].corners_m == tuple(
        pytest.approx(corner, abs=METRES) for corner in ((90, 90), (120, 90), (120, 130))
    )


def test_polygons_of_geojson_turn_to_the_left():
    file = written("geojson", Design(content=PATTERNS["lawnmower"]), LAKE, LAID_OUT)
    (_, area) = json.loads(file.content)["features"]
    ring = area["geometry"]["coordinates"][0]
    assert ring[0] == ring[-1]
    turned = sum(a[0] * b[1] - b[0] * a[1] for a, b in itertools.pairwise(ring))
    assert turned > 0.0


@pytest.mark.parametrize("format", FORMATS)
def test_a_design_without_waypoints_is_not_written(format: Format):
    with pytest.raises(NothingToWriteError, match="no waypoint"):
        write_plan_file(format, Design(), (), WHOLE, LAKE, "Empty")
