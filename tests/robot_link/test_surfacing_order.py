"""Rules of surfacing as they travel: any that can, by every road, and older formats as before."""

import struct

import cbor2
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_link.mavlink.mission_item import mission_from_items, mission_items
from robot_link.messages import SystemId
from robot_link.mission import SETTINGS_FIELDS, Mission
from robot_link.satellite.blob import Blob, mission_of
from robot_link.satellite.frame import WireError
from robot_link.surfacing_order import SurfacingOrder, ValueLimit
from tests.robot_link.satellite_case import ONBOARD, SYSTEM, short_mission, surfacing_orders

RULES = SurfacingOrder.of(40, 600.0, [ValueLimit(4, False, 4.25), ValueLimit(3, True, 18.0)])


def ruled(rules=RULES, onboard=ONBOARD) -> Mission:
    plain = short_mission(onboard=None)
    return Mission.from_legs(plain.settings, plain.legs, onboard=onboard, rules=rules)


@given(surfacing_orders())
def test_any_rules_are_the_same_again_and_exact_in_a_float32(rules):
    integers = rules.integers()
    assert SurfacingOrder.from_integers((*integers, 0, 0)) == rules
    assert all(struct.unpack("<f", struct.pack("<f", one))[0] == one for one in integers)


@given(st.floats(-1e25, 1e25).filter(lambda one: abs(one) > 1e-20))
def test_a_limit_travels_with_seven_digits(value):
    (limit,) = SurfacingOrder.of(None, 0.0, [ValueLimit(1, True, value)]).on_value
    assert limit.limit == pytest.approx(value, rel=5.1e-7)


@settings(max_examples=60, deadline=None)
@given(surfacing_orders(), st.booleans())
def test_a_mission_with_rules_is_the_same_by_radio_and_by_satellite(rules, has_onboard):
    mission = ruled(rules, ONBOARD if has_onboard else None)
    items = mission_items(mission, SystemId(1))
    blob = Blob.of(mission)
    for found in (mission_from_items(items), mission_of(blob.packed, blob.codec)):
        assert (found, found.sha256(), found.rules) == (mission, mission.sha256(), rules)


@given(st.lists(st.integers(-(2**24), 2**24), max_size=24))
def test_any_integers_are_rules_or_a_sentence(integers):
    try:
        found = SurfacingOrder.from_integers(integers)
    except ValueError:
        return
    assert SurfacingOrder.from_integers(found.integers()) == found


def test_the_canonical_form_of_format_5_and_of_those_before():
    plain, with_onboard = short_mission(onboard=None), short_mission()
    rules = [40, 600, 2, 4, 0, 425, -2, 3, 1, 18, 0]
    settings_, legs = plain.settings_integers(), [list(leg) for leg in plain.leg_integers()]
    onboard = list(ONBOARD.integers())
    for mission, expected in (
        (plain, [2, list(settings_), legs]),
        (with_onboard, [3, list(settings_), legs, onboard]),
        (ruled(onboard=None), [5, list(settings_), legs, [], rules]),
        (ruled(), [5, list(settings_), legs, onboard, rules]),
    ):
        assert mission.canonical_bytes() == cbor2.dumps(expected, canonical=True)


def test_rules_stand_behind_the_tuning_and_nowhere_else():
    items = list(mission_items(ruled(), SYSTEM))
    commands = [item.command for item in items]
    assert commands[:9] == [54000, 54006, *[54007] * 5, *[54016] * 2]
    with pytest.raises(ValueError, match="item 3 with command 54007 does not belong there"):
        mission_from_items([*items[:2], items[7], *items[2:7], *items[8:]])
    with pytest.raises(ValueError, match="cut short"):
        mission_from_items([*items[:8], *items[9:]])


def test_a_robot_that_does_not_know_the_format_refuses_it_in_words(monkeypatch):
    blob = Blob.of(ruled())
    monkeypatch.delitem(SETTINGS_FIELDS, 5)
    with pytest.raises(WireError, match="format 5 of missions is unknown"):
        mission_of(blob.packed, blob.codec)


def test_only_format_5_has_rules():
    plain = short_mission(onboard=None)
    with pytest.raises(ValueError, match="only format 5 of missions carries rules"):
        Mission.from_legs(plain.settings, plain.legs, 2, rules=RULES)
    with pytest.raises(ValueError, match="only format 5 of missions carries rules"):
        Mission.from_legs(plain.settings, plain.legs, 5)


@pytest.mark.parametrize(
    ("integers", "sentence"),
    [
        ((1, 2), "cut short"),
        ((1, 2, 5), "more than 4"),
        ((-1, 2, 0), "out of range"),
        ((1, 86_401, 0), "out of range"),
        ((0, 0, 1, 0, 1, 5, 0), "names channel 0"),
        ((0, 0, 1, 3, 2, 5, 0), "side 2"),
        ((0, 0, 1, 3, 1, 10_000_000, 0), "value of a rule"),
        ((0, 0, 1, 3, 1, 5, 31), "value of a rule"),
        ((0, 0, 1, 3, 1, 5), "cut short"),
        ((0, 0, 0, 1), "followed by more"),
    ],
)
def test_what_are_no_rules_is_refused_with_a_sentence(integers, sentence):
    with pytest.raises(ValueError, match=sentence):
        SurfacingOrder.from_integers(integers)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e39])
def test_a_limit_that_cannot_travel_is_refused(value):
    with pytest.raises(ValueError, match="value of a rule"):
        SurfacingOrder.of(None, 0.0, [ValueLimit(1, True, value)])
