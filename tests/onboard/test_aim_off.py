"""Robots that believe in a current aim off for it."""

import math
from dataclasses import replace

import pytest

from autonomy.planner.leg import primitive
from onboard.flight.leg import begin_leg, first_course, upstream
from onboard.flight.maneuver import Swim
from onboard.flight.navigation import Estimate
from onboard.flight.water_track import CurrentBelief
from simulator.fleet import MINI_1
from tests.simulator.flight import TANK_PLANNER, Life, mission, vee

EASTWARD = (0.0, 0.02)


@pytest.fixture(scope="module")
def life() -> Life:
    return Life(replace(MINI_1, start_ne_m=(0.5, 0.5)))


def believing(life: Life, current_ne_m_s: tuple[float, float], std_m_s: float = 0.0) -> Estimate:
    """The robot at rest at the origin of a dive, with a belief in a current."""
    return replace(
        life.estimate,
        position_ned=(0.5, 0.5, 0.0),
        current=CurrentBelief(current_ne_m_s, std_m_s),
    )


def test_what_may_be_chance_is_not_aimed_off_for(life):
    down, up = vee(heading_rad=0.0)
    unsure = believing(life, EASTWARD, 0.02)
    assert first_course(life.executive._flight, (down, up), down, unsure) == pytest.approx(0.0)
    assert unsure.current.sure_ne_m_s == (0.0, 0.0)
    half = CurrentBelief((0.02, 0.0), 0.01).sure_ne_m_s
    assert half == pytest.approx((0.01, 0.0))


def test_first_course_of_a_dive_leads_to_its_node_through_moving_water(life):
    flight = life.executive._flight
    down, up = vee(heading_rad=0.0)
    still = first_course(flight, (down, up), down, believing(life, (0.0, 0.0)))
    aimed = first_course(flight, (down, up), down, believing(life, EASTWARD))
    assert still == pytest.approx(0.0)
    reach = down.end_ned[0] - down.start_ned[0]
    assert math.tan(aimed) == pytest.approx(-EASTWARD[1] * down.duration_s / reach)


def test_glide_holds_the_speed_that_the_water_leaves_to_it(life):
    """With the water ahead a glide is steeper than in still water, against it flatter."""
    flight = life.executive._flight
    legs = vee(heading_rad=0.0, angle_rad=math.radians(51.0))
    pitches = []
    for along in (-0.004, 0.0, 0.004):
        still = believing(life, (along, 0.0))
        estimate = replace(still, position_ned=(0.5, 0.5, 0.05), velocity_ned=(0.02, 0.0, 0.03))
        glide = begin_leg(flight, legs, estimate)
        glide.step(estimate, 0.1)
        pitches.append(abs(glide._motion._aim._wanted_rad))
    assert pitches[0] < pitches[1] < pitches[2]


def test_swim_heads_into_a_current_from_aside_and_never_away_from_its_target(life):
    flight = life.executive._flight
    target = (1.5, 0.5)
    for east, least, most in ((0.0, 0.0, 0.0), (0.02, 0.2, 0.3), (0.5, 0.7, 0.8), (-0.5, 0.7, 0.8)):
        swim = Swim(flight, target, believing(life, (0.0, east)))
        assert least <= -math.copysign(1.0, east) * swim._course <= most
    along = Swim(flight, target, believing(life, (0.05, 0.0)))
    assert along._course == pytest.approx(0.0)


def test_dive_that_cannot_steer_begins_upstream_of_where_the_plan_has_it(life):
    sink = primitive.dive(TANK_PLANNER, (0.5, 0.5, 0.0), 0.4)
    rise = primitive.glide(TANK_PLANNER, sink.end_ned, (0.9, 0.5, 0.0))
    estimate = believing(life, EASTWARD)
    start = upstream((0.5, 0.5), (sink, rise), estimate, (0.0, 0.0))
    assert start == pytest.approx((0.5, 0.5 - 0.5 * EASTWARD[1] * sink.duration_s))
    # what the plan counts on it has in its legs, and a glide steers itself
    assert upstream((0.5, 0.5), (sink, rise), estimate, EASTWARD) == pytest.approx((0.5, 0.5))
    assert upstream((0.5, 0.5), (rise,), estimate, (0.0, 0.0)) == (0.5, 0.5)


def test_robot_prepares_a_dive_where_its_turn_is_carried_to_the_start(life):
    executive = life.executive
    executive.take_plan(mission(*vee()))
    executive.leg = 0
    start = vee()[0].start_ned[:2]
    turn_s = executive._flight.profile.turn_s
    assert executive._start_ne_m(believing(life, (0.0, 0.0))) == start
    led = executive._start_ne_m(believing(life, EASTWARD))
    assert led == pytest.approx((start[0], start[1] - EASTWARD[1] * turn_s))
    # a current that it can hardly swim against does not drive it on and on
    assert executive._start_ne_m(believing(life, (0.0, 0.2))) == start
