import math

import cbor2
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autonomy.planner.plan import Leg, PrimitiveKind
from robot_link.mavlink.mission_item import mission_from_items, mission_items
from robot_link.messages import SystemId
from robot_link.mission import Mission, MissionSettings

SETTINGS = MissionSettings(1.0, 0.5, 600.0, 0.0, 0.0)


def leg(start, end, kind=PrimitiveKind.GLIDE, **values) -> Leg:
    return Leg(kind, start, end, 0.03, 20.0, 1.5, **values)


def legs_with_jump(north_m: float, east_m: float, kind=PrimitiveKind.GLIDE) -> tuple[Leg, ...]:
    """A dive, and another that begins where the current has carried the robot meanwhile."""
    surfaced = (2.0 + north_m, 0.5 + east_m, 0.0)
    return (
        leg((0.0, 0.0, 0.0), (1.0, 0.25, 0.5)),
        leg((1.0, 0.25, 0.5), (2.0, 0.5, 0.0)),
        leg(surfaced, (surfaced[0] + 0.5, surfaced[1], 0.5), kind),
    )


@settings(deadline=None)
@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_where_a_dive_begins_in_a_current_travels_to_the_robot(north_m, east_m):
    sent = Mission.from_legs(SETTINGS, legs_with_jump(north_m, east_m))
    received = mission_from_items(mission_items(sent, SystemId(1)))
    assert (received, received.sha256()) == (sent, sent.sha256())
    assert sent.legs[2].start_ned == pytest.approx((2.0 + north_m, 0.5 + east_m, 0.0), abs=3.1e-3)
    assert (sent.legs[2].radius_m, sent.legs[2].turn_rad) == (0.0, 0.0)


def test_a_mission_without_jumps_keeps_its_bytes():
    mission = Mission.from_legs(SETTINGS, legs_with_jump(0.0, 0.0))
    expected = [
        2,
        [1000, 500, 600, 0, 0, 0, 0],
        [
            [0, 1000, 250, 500, 30, 200, 1500, 0, 0, 0],
            [0, 2000, 500, 0, 30, 200, 1500, 0, 0, 0],
            [0, 2500, 500, 500, 30, 200, 1500, 0, 0, 0],
        ],
    ]
    assert mission.canonical_bytes() == cbor2.dumps(expected, canonical=True)


def test_only_legs_at_the_surface_that_are_no_spirals_may_begin_elsewhere():
    with pytest.raises(ValueError, match="leg 3 does not begin where the one before it ends"):
        Mission.from_legs(SETTINGS, legs_with_jump(1.0, 0.0, PrimitiveKind.SPIRAL))
    down, up, _ = legs_with_jump(0.0, 0.0)
    shifted = leg((1.1, 0.25, 0.5), up.end_ned)
    with pytest.raises(ValueError, match="leg 2 does not begin"):
        Mission.from_legs(SETTINGS, (down, shifted))


def test_the_circle_of_a_spiral_at_the_surface_stays_a_circle():
    bend = leg((2.0, 0.5, 0.0), (2.2, 0.7, 0.5), PrimitiveKind.SPIRAL, radius_m=0.3, turn_rad=-2.0)
    mission = Mission.from_legs(SETTINGS, (*legs_with_jump(0.0, 0.0)[:2], bend))
    assert mission.legs[2].radius_m == 0.3
    assert math.isclose(mission.legs[2].turn_rad, -2.0)
    assert mission.legs[2].start_ned == (2.0, 0.5, 0.0)
