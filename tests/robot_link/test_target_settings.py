"""Missions that follow a target: the same comes out on every road, and nothing else ever does."""

import math
import zlib
from dataclasses import replace

import cbor2
import pytest
from hypothesis import given, settings

from autonomy.configuration import Configuration
from autonomy.tracking.config import (
    THESIS_TRACKING,
    TRACKING_PRESETS,
    MotionConfig,
    RangingConfig,
    TargetConfig,
    TrackingConfig,
)
from robot_link.mavlink.codec import ROBOT_COMPONENT, STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.mavlink.mission_item import mission_from_items, mission_items
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from robot_link.mission import SETTINGS_FIELDS, Mission
from robot_link.satellite.blob import Blob, BlobCodec, mission_of
from robot_link.satellite.chunk import sizes
from robot_link.satellite.frame import WireError
from robot_link.short_model import field_count
from robot_link.target_settings import MOST_INTEGERS, TargetSettings
from tests.robot_link.satellite_case import ONBOARD, short_mission
from tests.robot_link.target_case import SETTINGS, tracking_configs, tracking_mission

SYSTEM = SystemId(7)
PRESETS = {**TRACKING_PRESETS, "thesis": THESIS_TRACKING, "default": TrackingConfig()}
DEFAULT = TargetSettings.of(TrackingConfig())
ADDRESS, NORTH = 1, 3
"""Where the order names the target's address and northing."""


def over_the_air(mission: Mission) -> Mission:
    """Carry a mission in frames, as float32 where the item has them."""
    station, robot = Codec(STATION_SYSTEM, STATION_COMPONENT), Codec(SYSTEM, ROBOT_COMPONENT)
    frames = b"".join(map(station.pack, mission_items(mission, SYSTEM)))
    return mission_from_items(robot.unpack(frames).messages)


def numbers(config: Configuration) -> dict[str, object]:
    flat: dict[str, object] = {}
    for name, value in config:
        flat |= numbers(value) if isinstance(value, Configuration) else {name: value}
    return flat


@pytest.mark.parametrize("preset", PRESETS)
def test_preset_is_the_same_mission_on_every_road(preset):
    mission = tracking_mission(PRESETS[preset])
    blob = Blob.of(mission)
    for found in (over_the_air(mission), mission_of(blob.packed, blob.codec)):
        assert (found, found.sha256()) == (mission, blob.plan)
        assert found.tracking.config() == mission.tracking.config()
    assert (mission.format, mission.legs, mission.onboard) == (4, (), None)
    assert len(sizes(blob)) == 1, "it fits one message"


@settings(deadline=None, max_examples=60)
@given(tracking_configs())
def test_any_order_is_the_same_mission_on_every_road(config):
    mission = tracking_mission(config)
    blob = Blob.of(mission)
    assert over_the_air(mission) == mission == mission_of(blob.packed, blob.codec)
    assert TargetSettings.of(mission.tracking.config()) == mission.tracking
    assert all(abs(number) < 2**24 for number in mission.tracking.integers())


@settings(deadline=None, max_examples=60)
@given(tracking_configs())
def test_order_says_what_was_meant_within_its_rounding(config):
    meant, said = numbers(config), numbers(TargetSettings.of(config).config())
    assert list(meant) == list(said)
    for name, value in meant.items():
        if name in ("north_m", "east_m"):
            assert said[name] == pytest.approx(value, abs=5.1e-4)
        elif isinstance(value, float):
            assert said[name] == pytest.approx(value, rel=2.6e-3, abs=1e-10)
        else:
            assert said[name] == value


def test_canonical_bytes_hold_format_settings_no_legs_and_the_order():
    mission = tracking_mission()
    assert cbor2.loads(mission.canonical_bytes()) == [
        4,
        [1000, 10_000, 900, 1500, -2250, 1000, -2000],
        [],
        list(DEFAULT.integers()),
    ]


def test_bytes_and_name_of_an_order_stay_what_they_are():
    """A robot of today must understand a station of tomorrow: the layout of what is there."""
    config = TrackingConfig(
        target=TargetConfig(kind="tag", address=10, north_m=12.345, heading_rad=math.pi)
    )
    integers = TargetSettings.of(config).integers()
    # kind tag, address 10, depth 0, 12345 mm, 700 mm, 0.35 m, circle, 0.01 m/s, 3.141 rad, 0.3 m
    assert integers[:10] == (1, 27, 0, 12345, 700, 562, 3, 18, 50259, 49)
    items = mission_items(tracking_mission(config), SYSTEM)
    assert [item.command for item in items[:3]] == [54000, 54006, 54008]
    third = items[2]
    carried = (third.param1, third.param2, third.param3, third.param4, third.x, third.y, third.z)
    assert carried == integers[:7]
    payload = third.pack(grace.MAVLink(None))[10:-2]
    assert payload.hex() == (
        "0000803f0000d8410000000000e44046bc02000032020000000040400200f8d20701020001"
    )


def test_number_beyond_its_limit_by_rounding_is_rounded_towards_zero_and_no_other():
    config = TrackingConfig(target=TargetConfig(heading_rad=-math.pi, guess_std_m=0.35))
    said = TargetSettings.of(config).config().target
    assert (said.heading_rad, said.guess_std_m) == (-3.141, 0.35)


@pytest.mark.parametrize(
    ("config", "sentence"),
    [
        (
            TrackingConfig(target=TargetConfig(north_m=20_000.0)),
            r"target\.north_m: 20000 cannot travel",
        ),
        (
            TrackingConfig(target=TargetConfig(guess_std_m=1e-12)),
            r"target\.guess_std_m: 1e-12 cannot travel",
        ),
        (
            TrackingConfig(
                ranging=RangingConfig(coast_after_s=3.0, lost_after_s=3.00001, give_up_after_s=9.0)
            ),
            "these settings cannot travel, .* must ascend",
        ),
    ],
)
def test_order_that_cannot_travel_names_its_number(config, sentence):
    with pytest.raises(ValueError, match=sentence):
        TargetSettings.of(config)


def changed(index: int, value: int) -> tuple[int, ...]:
    integers = list(DEFAULT.integers())
    integers[index] = value
    return tuple(integers)


@pytest.mark.parametrize(
    ("integers", "sentence"),
    [
        (DEFAULT.integers()[:-1], "has [0-9]+ numbers, not"),
        ((), "numbers, not 0"),
        ((*DEFAULT.integers(), 0, 1), "is followed by more"),
        (changed(0, 3), r"target\.kind of an order to follow a target is none of its choices"),
        (changed(0, -1), r"target\.kind"),
        (changed(ADDRESS, 0), r"target\.address: Input should be greater"),
        (changed(ADDRESS, 15 * 16 + 1), r"target\.address: Input should be a valid integer"),
        (changed(NORTH, 2**24), "too large"),
        ((0,) * (MOST_INTEGERS + 1), "too many numbers"),
        ((0,) * len(DEFAULT.integers()), "is impossible"),
    ],
)
def test_impossible_integers_are_refused_with_a_sentence(integers, sentence):
    with pytest.raises(ValueError, match=sentence):
        TargetSettings.from_integers(integers)


def test_zeros_that_fill_the_last_item_do_not_matter():
    assert TargetSettings.from_integers((*DEFAULT.integers(), 0, 0, 0)) == DEFAULT
    assert len(DEFAULT.integers()) == field_count(TrackingConfig)


def test_mission_has_either_legs_or_an_order():
    survey = short_mission(onboard=None)
    rounded = survey.settings_integers()
    with pytest.raises(ValueError, match="neither legs nor onboard settings"):
        Mission.from_integers(rounded, survey.leg_integers(), None, DEFAULT)
    with pytest.raises(ValueError, match="neither legs nor onboard settings"):
        Mission.from_integers(rounded, (), ONBOARD, DEFAULT)
    with pytest.raises(ValueError, match="no format of missions has 5 numbers"):
        Mission.from_integers(rounded[:5], (), None, DEFAULT)
    with pytest.raises(ValueError, match="timeout of the settings is out"):
        Mission.for_target(replace(SETTINGS, timeout_s=1e9), DEFAULT)


def test_items_in_another_order_or_torn_apart_are_refused_by_number():
    items = mission_items(tracking_mission(), SYSTEM)
    with pytest.raises(ValueError, match="item 1 with command 54008 does not belong there"):
        mission_from_items((items[0], *items[2:]))
    with pytest.raises(ValueError, match=r"has [0-9]+ numbers, not"):
        mission_from_items(items[:-1])
    legs = mission_items(short_mission(onboard=None), SYSTEM)[2:]
    with pytest.raises(ValueError, match="neither legs"):
        mission_from_items((*items, *legs))


def test_robot_that_does_not_know_this_format_refuses_it_with_a_sentence(monkeypatch):
    blob = Blob.of(tracking_mission())
    monkeypatch.delitem(SETTINGS_FIELDS, 4)
    with pytest.raises(WireError, match="format 4 of missions is unknown"):
        mission_of(blob.packed, blob.codec)
    items = list(mission_items(short_mission(onboard=None), SYSTEM))
    items[2].command = 54017
    with pytest.raises(ValueError, match="item 2 with command 54017 does not belong there"):
        mission_from_items(items)


@pytest.mark.parametrize(
    ("index", "part"), [(0, 2), (0, 3), (0, 5), (2, []), (2, [9] * 44), (3, [15, 1, 1, 0, 0, 0])]
)
def test_blob_that_is_no_order_is_refused(index, part):
    blob = Blob.of(tracking_mission())
    is_plain = blob.codec is BlobCodec.PLAIN
    parts = cbor2.loads(blob.packed if is_plain else zlib.decompress(blob.packed, -15))
    parts[index] = part
    with pytest.raises(WireError):
        mission_of(cbor2.dumps(parts), BlobCodec.PLAIN)


def test_motion_of_a_second_order_makes_another_name():
    other = TrackingConfig(motion=MotionConfig(duration_s=601.0))
    assert tracking_mission().sha256() != tracking_mission(other).sha256()
