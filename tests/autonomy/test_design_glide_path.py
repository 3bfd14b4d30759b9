"""Legs of designs, in waters, currents and manners that are drawn at run time."""

import math
from itertools import pairwise

import numpy as np
import pytest
from pydantic import ValidationError

from autonomy.control.trajectory import diagonal, figure_eight
from autonomy.design.document import (
    Design,
    Manner,
    Mooring,
    Reference,
    StationKeep,
    SurfacingRules,
    Way,
    Waypoint,
)
from autonomy.design.glide_path import lay_out, rules_of, way_there
from autonomy.design.way import waypoints_of
from autonomy.design.yo_yo import Line, turning_depths
from autonomy.planner.check.check import violations
from autonomy.planner.leg import drift
from autonomy.planner.leg.edge import (
    POINT_STD,
    dives_of,
    doubts,
    expected_points,
    planned_points,
    surfacings,
)
from autonomy.planner.plan import PrimitiveKind
from autonomy.planner.preset import GRACE3
from autonomy.site import LAKE
from server.design.moving import design_of_legs


@pytest.fixture
def rng():
    return np.random.default_rng()


def drawn_way(rng, count=5):
    """Return waypoints in the deep middle of the lake, at least 40 m apart."""
    places = [rng.uniform(170.0, 330.0, 2)]
    while len(places) < count:
        place = rng.uniform(170.0, 330.0, 2)
        if math.dist(place, places[-1]) > 40.0:
            places.append(place)
    return tuple(Waypoint(north_m=p[0], east_m=p[1]) for p in places)


def drawn_manner(rng):
    motion = GRACE3.primitives
    shallow = float(rng.choice([0.0, rng.uniform(0.5, 2.0)]))
    return Manner(
        shallow_m=shallow,
        deep_m=shallow + rng.uniform(2.0 * motion.depth_change_min_m, 11.5),
        glide_angle_rad=rng.uniform(motion.glide_angle_min_rad, motion.glide_angle_max_rad),
    )


def laid(design, config=None):
    rules = config or rules_of(GRACE3, design, LAKE)
    waypoints = waypoints_of(design, LAKE, 50.0)
    return lay_out(design, waypoints, rules, LAKE, usual_deep_m=8.0), rules


def in_current(rules, north_m_s, east_m_s):
    current = rules.current.model_copy(update={"north_m_s": north_m_s, "east_m_s": east_m_s})
    return rules.model_copy(update={"current": current})


def test_turns_take_just_the_travel_that_a_line_needs(rng):
    for _ in range(300):
        begin, shallow = rng.choice([0.0, 1.0]), rng.uniform(0.0, 2.0)
        deepest = shallow + rng.uniform(2.0, 9.0)
        line = Line(
            length_m=100.0,
            travel_m=(travel := rng.uniform(8.0, 90.0)),
            steepest_m=travel,
            begin_m=begin,
            shallow_m=shallow,
            ends_up=bool(rng.integers(2)),
            depth_change_min_m=0.5,
            deep_at=lambda _, deep=deepest: deep,
            comes_up=lambda _: False,
        )
        depths = turning_depths(line)
        assert depths is not None
        changes = [b - a for a, b in pairwise(depths)]
        assert depths[0] == begin
        assert max(depths) <= deepest + 1e-9
        assert all(a * b < 0 for a, b in pairwise(changes))
        assert all(abs(change) >= 0.5 - 1e-9 for change in changes)
        if line.ends_up:
            assert depths[-1] == 0.0
        # one descent and climb less is the most that it may be flown flatter
        travel = sum(map(abs, changes))
        assert travel == pytest.approx(line.travel_m) or (
            line.travel_m - 2.0 * deepest - 0.5 <= travel < line.travel_m
        )


def test_turns_that_would_lie_too_close_are_glided_steeper_if_the_vehicle_can(rng):
    motion = GRACE3.primitives
    asked = math.tan(0.5 * (motion.glide_angle_min_rad + motion.glide_angle_max_rad))
    steepest = math.tan(motion.glide_angle_max_rad)
    for _ in range(300):
        length, deep = rng.uniform(12.0, 80.0), rng.uniform(1.05, 2.0) * motion.depth_change_min_m
        line = Line(
            length_m=length,
            travel_m=asked * length,
            steepest_m=steepest * length,
            begin_m=0.0,
            shallow_m=0.0,
            ends_up=True,
            depth_change_min_m=motion.depth_change_min_m,
            deep_at=lambda _, deep=deep: deep,
            comes_up=lambda _: False,
        )
        depths = turning_depths(line)
        slopes = 1 if depths is None else sum(abs(b - a) for a, b in pairwise(depths)) / length
        least = 2.0 * motion.depth_change_min_m
        if any(asked * length <= n * least <= steepest * length for n in range(1, 20)):
            assert depths is not None
            assert slopes <= steepest + 1e-9
        if depths is not None and slopes > asked + 1e-6:
            shortest = min(abs(b - a) for a, b in pairwise(depths))
            assert shortest == pytest.approx(motion.depth_change_min_m)


def test_a_line_too_short_for_a_glide_is_swum_and_said_so(rng):
    design = Design(
        content=Way(
            waypoints=(Waypoint(north_m=200, east_m=200), Waypoint(north_m=202, east_m=200))
        )
    )
    found, _ = laid(design)
    assert [leg.kind for leg in found.legs] == [PrimitiveKind.SWIM]
    assert "too short" in found.remarks[0].text


def test_in_still_water_legs_lie_on_the_lines_with_the_angle_that_was_asked(rng):
    for _ in range(30):
        design = Design(content=Way(waypoints=drawn_way(rng)), manner=drawn_manner(rng))
        found, rules = laid(design)
        assert violations(tuple(found.legs), rules, LAKE) == () or all(
            "uncertain" in one.message for one in violations(tuple(found.legs), rules, LAKE)
        )
        glides = [leg for leg in found.legs if leg.kind is PrimitiveKind.GLIDE]
        angles = [
            math.atan2(
                abs(g.end_ned[2] - g.start_ned[2]), math.dist(g.start_ned[:2], g.end_ned[:2])
            )
            for g in glides
        ]
        assert len(glides) >= 8
        assert np.median(angles) == pytest.approx(design.manner.glide_angle_rad, abs=1e-6)
        ends = [leg.end_ned for leg in found.legs if leg.end_ned[2] == 0.0]
        for waypoint in design.content.waypoints[1:]:
            assert min(math.dist(end[:2], waypoint.ne_m) for end in ends) < 1e-6


def test_in_a_current_the_robot_really_comes_up_at_the_waypoints(rng):
    for _ in range(30):
        design = Design(content=Way(waypoints=drawn_way(rng)), manner=drawn_manner(rng))
        speed, course = rng.uniform(0.005, 0.04), rng.uniform(0.0, 2.0 * math.pi)
        rules = in_current(
            rules_of(GRACE3, design, LAKE), speed * math.cos(course), speed * math.sin(course)
        )
        found, _ = laid(design, rules)
        legs = tuple(found.legs)
        courses = drift.courses(rules, legs)
        for number, waypoint in enumerate(design.content.waypoints[1:], start=1):
            last = max(k for k, one in enumerate(found.waypoint) if one == number)
            there = drift.position_at(legs[last], courses[last], 1.0)
            assert math.dist(there[:2], waypoint.ne_m) < 0.02
        assert not [one for one in violations(legs, rules, LAKE) if "angle" in one.message]


def test_a_current_too_strong_for_a_glide_is_refused_by_its_waypoint(rng):
    design = Design(content=Way(waypoints=drawn_way(rng)), manner=drawn_manner(rng))
    rules = in_current(rules_of(GRACE3, design, LAKE), 0.9, 0.0)
    with pytest.raises(ValueError, match=r"^waypoints\.1: the current is too strong"):
        laid(design, rules)


def test_a_robot_is_never_under_water_longer_than_the_rule_allows(rng):
    for _ in range(20):
        manner = drawn_manner(rng)
        deepest_s = 2.0 * manner.deep_m / GRACE3.primitives.glide_speed_m_s
        every_s = rng.uniform(1.2, 4.0) * deepest_s + deepest_s
        design = Design(
            content=Way(
                waypoints=(Waypoint(north_m=150, east_m=250), Waypoint(north_m=350, east_m=250))
            ),
            manner=manner,
            surfacing=SurfacingRules(at_waypoints=False, every_s=every_s),
        )
        found, _ = laid(design)
        under_s = longest_s = 0.0
        for leg in found.legs:
            under_s += leg.duration_s
            longest_s = max(longest_s, under_s)
            under_s = 0.0 if leg.end_ned[2] == 0.0 else under_s
        assert longest_s <= every_s


def test_waypoints_are_passed_under_water_where_the_rules_say_so(rng):
    way = drawn_way(rng)
    rules = SurfacingRules(at_waypoints=False)
    design = Design(
        content=Way(waypoints=way), manner=Manner(shallow_m=1.0, deep_m=8.0), surfacing=rules
    )
    found, _ = laid(design)
    assert surfacings(found.legs) == 1
    named = [*way[:2], way[2].model_copy(update={"surfaces": True}), *way[3:]]
    again = design.model_copy(update={"content": Way(waypoints=tuple(named))})
    assert surfacings(laid(again)[0].legs) == 2


def test_deep_turns_keep_clear_of_the_floor(rng):
    for _ in range(10):
        clearance = rng.uniform(0.5, 3.0)
        manner = Manner(shallow_m=0.5, deep_m=18.0, floor_clearance_m=clearance)
        found, _ = laid(Design(content=Way(waypoints=drawn_way(rng)), manner=manner))
        for leg in found.legs:
            north, east, depth = leg.end_ned
            if depth > 0.0:
                assert float(LAKE.floor_m(north, east)) - depth >= clearance - 0.2


def test_a_mooring_profiles_at_its_place_for_its_time(rng):
    north, east = rng.uniform(220.0, 280.0, 2)
    hours = rng.uniform(0.5, 2.0)
    mooring = Mooring(place={"north_m": north, "east_m": east}, duration_s=hours * 3600.0)
    found, rules = laid(Design(content=mooring, manner=Manner(deep_m=6.0)))
    assert {leg.kind for leg in found.legs} == {PrimitiveKind.SPIRAL}
    assert violations(tuple(found.legs), rules, LAKE) == ()
    assert math.dist(found.legs[-1].end_ned[:2], (north, east)) < 1e-6


def test_a_stay_is_one_leg_at_its_place_that_may_be_flown(rng):
    north, east = rng.uniform(220.0, 280.0, 2)
    radius, duration = rng.uniform(6.0, 40.0), rng.uniform(60.0, 604_800.0)
    stay = StationKeep(
        place={"north_m": north, "east_m": east}, radius_m=radius, duration_s=duration
    )
    found, rules = laid(Design(content=stay))
    (leg,) = found.legs
    assert (leg.kind, leg.end_ned) == (PrimitiveKind.KEEP, (north, east, 0.0))
    assert (leg.radius_m, leg.duration_s) == (radius, duration)
    assert violations((leg,), rules, LAKE) == ()
    again = design_of_legs(found.legs)
    assert again.content == stay


def test_legs_that_become_a_design_again_are_flown_as_before(rng):
    steep_rad, deep_m = rng.uniform(0.5, 0.9), rng.uniform(6.0, 10.0)
    places = [(220.0, 220.0), (220.0, 290.0), (280.0, 290.0)]
    way = Way(waypoints=tuple(Waypoint(north_m=n, east_m=e) for n, e in places))
    manner = Manner(deep_m=deep_m, glide_angle_rad=steep_rad)
    before, _ = laid(Design(content=way, manner=manner))
    again, _ = laid(design_of_legs(before.legs))
    ends = [np.array([leg.end_ned for leg in found.legs]) for found in (before, again)]
    np.testing.assert_allclose(*ends, atol=1e-6)


def test_a_stay_in_a_current_that_is_too_strong_names_its_place():
    stay = StationKeep(place={"north_m": 250.0, "east_m": 250.0}, radius_m=10.0, duration_s=60.0)
    design = Design(content=stay)
    with pytest.raises(ValueError, match=r"content\.place: the current of 0\.3 m/s is too strong"):
        laid(design, in_current(rules_of(GRACE3, design, LAKE), 0.3, 0.0))


def test_a_document_whose_stay_has_no_radius_or_lasts_too_long_is_refused_by_field():
    place = {"north_m": 0.0, "east_m": 0.0}
    for wrong in ({"radius_m": 0.0}, {"duration_s": 604_801.0}, {"place": None}):
        with pytest.raises(ValidationError) as caught:
            StationKeep(**({"place": place, "radius_m": 10.0, "duration_s": 60.0} | wrong))
        assert caught.value.errors()[0]["loc"][0] in wrong


def test_the_way_there_begins_wherever_the_robot_is(rng):
    way = drawn_way(rng)
    here = tuple(rng.uniform(170.0, 330.0, 2))
    leg = way_there(GRACE3, here, way)
    assert leg is not None
    assert (leg.start_ned[:2], leg.end_ned[:2]) == (here, way[0].ne_m)
    assert way_there(GRACE3, way[0].ne_m, way) is None


@pytest.mark.parametrize(
    ("shape", "truth"), [("diagonal", diagonal), ("figure_of_eight", figure_eight)]
)
def test_a_reference_of_the_thesis_is_flown_through_its_turns_in_its_time(rng, shape, truth):
    north, east = rng.uniform(240.0, 260.0, 2)
    origin = {"north_m": north, "east_m": east}
    found, _ = laid(Design(content=Reference(shape=shape, origin=origin, duration_s=300.0)))
    ends_s = np.cumsum([leg.duration_s for leg in found.legs])
    assert np.allclose(ends_s, 37.5 * np.arange(1, 9))
    for leg, end_s in zip(found.legs[:-1], ends_s[:-1], strict=True):
        place = np.add(truth(end_s).position_ned, (north, east, 0.0))
        assert np.allclose(leg.end_ned, place)
    assert found.legs[-1].end_ned[2] == 0.0


def test_a_reference_that_stays_at_a_depth_is_refused_by_its_row():
    rows = [
        {"time_s": t, "north_m": t, "east_m": 0.0, "depth_m": d}
        for t, d in ((0.0, 0.0), (100.0, 6.0), (200.0, 6.0), (300.0, 0.0))
    ]
    content = Reference(shape="rows", origin={"north_m": 200, "east_m": 200}, rows=rows)
    with pytest.raises(ValueError, match=r"^waypoints\.2: it has the depth"):
        laid(Design(content=content))


def test_doubts_of_dives_that_were_asked_for_before_are_those_of_their_points(rng):
    design = Design(content=Way(waypoints=drawn_way(rng)), manner=drawn_manner(rng))
    legs = tuple(laid(design)[0].legs)
    expected = expected_points(GRACE3, legs)[:, POINT_STD]
    as_first = planned_points(GRACE3, legs)[:, POINT_STD]
    for _ in range(2):
        found = [std for _, std in doubts(GRACE3, dives_of(legs))]
        std_m = np.concatenate(found)
        assert std_m == pytest.approx(expected)
        # nothing has told of the current before the first dive, and each dive does afterwards
        assert found[0] == pytest.approx(as_first[: len(found[0])])
        assert (std_m <= as_first + 1e-9).all()
