"""Tags and beacons of the simulated waters: where they are, and that no two answer to one ping."""

import math
from datetime import UTC, datetime, timedelta

import pytest

from robot_link.clock import ScaledClock
from simulator.fleet import FLEET, GRACE_1, MINI_1, STATION_ADDRESS
from simulator.target import LAKE_TARGETS, TANK_TARGETS, AcousticTarget

NEW_YEAR = datetime(2026, 1, 1, tzinfo=UTC)
TIMES = [NEW_YEAR + timedelta(days=40, seconds=37.0 * number) for number in range(400)]
(TANK_TAG,) = TANK_TARGETS
LAKE_TAG, LAKE_BEACON = LAKE_TARGETS
WATERS = [(TANK_TAG, MINI_1), (LAKE_TAG, GRACE_1), (LAKE_BEACON, GRACE_1)]


@pytest.mark.parametrize(("target", "robot"), WATERS)
def test_target_never_leaves_the_water_that_robots_may_swim_in(target: AcousticTarget, robot):
    for at in TIMES:
        place = target.place_ned_m(at)
        assert robot.site.water.contains(*place)
        north, east, depth = place
        if robot is GRACE_1:
            assert robot.is_in_range(north, east), "the station hears who follows it"
            assert depth < float(robot.site.bathymetry.floor_m(north, east))


@pytest.mark.parametrize(("tag", "most_m_s"), [(TANK_TAG, 0.0101), (LAKE_TAG, 0.0501)])
def test_tag_moves_slowly_and_never_stands_for_long(tag: AcousticTarget, most_m_s: float):
    step = timedelta(seconds=20.0)
    for at in TIMES:
        moved_m = math.dist(tag.place_ned_m(at), tag.place_ned_m(at + step))
        assert moved_m <= 20.0 * most_m_s
    spread = [math.dist(tag.place_ned_m(TIMES[0]), tag.place_ned_m(at)) for at in TIMES]
    assert max(spread) > 20.0 * most_m_s


def test_tag_of_the_tank_circles_the_middle():
    middle = (1.4, 0.7)
    for at in TIMES:
        assert math.dist(TANK_TAG.place_ned_m(at)[:2], middle) == pytest.approx(0.3)


def test_tag_that_wanders_is_on_no_circle_around_its_middle():
    radii = [math.dist(LAKE_TAG.place_ned_m(at)[:2], (120.0, 143.7)) for at in TIMES]
    assert 6.0 < min(radii) < 7.5
    assert 12.5 < max(radii) < 14.0


def test_beacon_stays():
    assert {LAKE_BEACON.place_ned_m(at) for at in TIMES} == {(100.0, 150.0, 6.0)}


def test_modem_of_a_target_is_where_it_is_by_the_shared_clock():
    at = TIMES[7]
    clock = ScaledClock(datetime.now(UTC), at, 1e-9)
    assert TANK_TAG.modem(clock).position() == pytest.approx(TANK_TAG.place_ned_m(at))


def test_every_robot_can_ping_and_no_address_is_taken_twice_in_its_water():
    for robot in FLEET.values():
        others = [one for one in FLEET.values() if one.site is robot.site]
        addresses = [one.acoustic_address for one in others]
        addresses += [target.address for target in robot.targets]
        assert None not in addresses
        assert len({STATION_ADDRESS, *addresses}) == len(addresses) + 1
        assert robot.targets
