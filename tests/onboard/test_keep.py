"""Robots that stay at the surface, in currents and within radii that are drawn at run time."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.planner.leg import primitive
from autonomy.planner.plan import Leg, PrimitiveKind
from autonomy.planner.preset import PLANNER_PRESETS
from onboard.flight.keep import Keep
from onboard.link.robot_link import CommandOutcome
from onboard.profile import FLIGHT_PROFILES
from robot_link.messages import CommandKind, OnboardPlanState, RobotMode
from simulator.fleet import GRACE_1, MINI_1
from tests.simulator.flight import LAKE_PLANNER, TANK_PLANNER, Life, horizontal, mission, vee

DRIFTED = 6
"""Columns 5 and 6 of a track are where the robot truly was."""


@pytest.fixture
def rng():
    return np.random.default_rng()


def drawn_current(rng, most_m_s):
    speed, angle = rng.uniform(0.2 * most_m_s, most_m_s), rng.uniform(0.0, 2.0 * math.pi)
    return speed * math.cos(angle), speed * math.sin(angle)


def stay(place, radius_m, duration_s, config=LAKE_PLANNER) -> Leg:
    return primitive.keep(config, (*place, 0.0), radius_m, duration_s)


def away_m(track, place):
    return np.hypot(track[:, 5] - place[0], track[:, DRIFTED] - place[1])


def test_the_robot_stays_within_its_radius_in_a_current_that_is_drawn(rng):
    """It leaves the radius only by what it takes to turn, and by its fixes' noise."""
    for _ in range(3):
        place, current = tuple(rng.uniform(220.0, 280.0, 2)), drawn_current(rng, 0.07)
        carried_m = 2400.0 * math.hypot(*current)
        radius = rng.uniform(6.0, min(25.0, 0.45 * carried_m))  # else it stays by chance
        definition = replace(GRACE_1, start_ne_m=place, current_ne_m_s=current)
        life = Life(definition, seed=int(rng.integers(1000)))
        track = life.fly(mission(stay(place, radius, 2400.0), timeout_s=9000.0))
        assert life.executive.plan_state is OnboardPlanState.DONE
        assert 2400.0 <= len(track) * 0.1 <= 2460.0
        away = away_m(track, place)
        assert np.quantile(away, 0.95) < radius + 4.0
        assert away.max() < radius + 0.07 * 90.0 + 4.0
        assert life.notebook.modes.count(RobotMode.SWIMMING) >= 1
        assert track[:, 7].max() < 0.5


def test_a_small_robot_does_not_coast_through_its_place_for_ever(rng):
    """How far a flight is for nine tenths of its time is noisy: the mean of several is judged.

    One lies 0.04 m beyond the radius, give or take 0.05 m.
    """
    place, radius = (1.3, 0.7), TANK_PLANNER.primitives.keep_radius_min_m
    far_m = []
    for _ in range(6):
        current = drawn_current(rng, 0.02)
        definition = replace(MINI_1, start_ne_m=place, current_ne_m_s=current)
        life = Life(definition, seed=int(rng.integers(1000)))
        track = life.fly(mission(stay(place, radius, 900.0, TANK_PLANNER)))
        far_m.append(np.quantile(away_m(track, place), 0.9))
        swims = life.notebook.modes.count(RobotMode.SWIMMING)
        assert swims < 900.0 / (2.0 * FLIGHT_PROFILES["miniglider"].coast_s)
    assert np.mean(far_m) < radius + 0.25


def test_swimming_back_is_charged_and_floating_costs_time_alone(rng):
    still = Life(replace(GRACE_1, start_ne_m=(250.0, 250.0), drift_m_sqrt_s=0.0), seed=1)
    still.fly(mission(stay((250.0, 250.0), 20.0, 600.0)))
    time_alone = LAKE_PLANNER.energy.time_factor * 600.0
    assert still.executive.energy_used == pytest.approx(time_alone, rel=0.05)
    current = drawn_current(rng, 0.06)
    moved = Life(replace(GRACE_1, start_ne_m=(250.0, 250.0), current_ne_m_s=current), seed=1)
    moved.fly(mission(stay((250.0, 250.0), 6.0, 1200.0)))
    assert moved.executive.energy_used > 2.0 * time_alone + 1.0


def test_what_the_planner_expects_is_about_what_a_stay_takes(rng):
    """In the current that it counts on; the robot swims a quarter faster than plans count on."""
    shares = []
    for _ in range(3):
        current = drawn_current(rng, 0.06)
        told = LAKE_PLANNER.current.model_copy(
            update={"north_m_s": current[0], "east_m_s": current[1]}
        )
        sure = LAKE_PLANNER.position_filter.model_copy(update={"steady_current_m_s": 0.0})
        config = LAKE_PLANNER.model_copy(update={"current": told, "position_filter": sure})
        leg = stay((250.0, 250.0), 10.0, 2400.0, config)
        definition = replace(GRACE_1, start_ne_m=(250.0, 250.0), current_ne_m_s=current)
        life = Life(definition, seed=int(rng.integers(1000)))
        life.fly(mission(leg, timeout_s=9000.0))
        shares.append(life.executive.energy_used / leg.energy)
    assert 0.3 < np.mean(shares) < 1.2


def test_a_dive_follows_a_stay_and_a_stay_follows_a_dive():
    life = Life()
    out = vee()
    here = out[-1].end_ned
    back = vee(here[:2], 3.4)
    track = life.fly(mission(*out, stay(here[:2], 0.6, 60.0, TANK_PLANNER), *back))
    assert life.executive.plan_state is OnboardPlanState.DONE
    assert life.executive.leg == 5
    under = track[:, 7] > 0.2
    assert np.count_nonzero(np.diff(under.astype(int)) == 1) == 2
    assert horizontal(track[-1, 5:7], back[-1].end_ned) < 0.6


def keeping() -> Life:
    life = Life(replace(GRACE_1, start_ne_m=(250.0, 250.0)))
    assert life.start(mission(stay((250.0, 250.0), 10.0, 300.0))) is CommandOutcome.DONE
    assert life.live_until(lambda: life.executive.is_sampling, 60.0)
    life.live(100.0)
    return life


def test_a_stay_that_was_held_goes_on_for_what_is_left_of_it():
    life = keeping()
    assert life.robot.program.obey(CommandKind.HOLD, "") is CommandOutcome.DONE
    life.live(200.0)
    assert life.executive.mode is RobotMode.HOLDING
    assert life.robot.program.obey(CommandKind.RESUME, "") is CommandOutcome.DONE
    began_s = life.robot.program.time_s
    done = OnboardPlanState.DONE
    assert life.live_until(lambda: life.executive.plan_state is done, 600.0)
    assert life.robot.program.time_s - began_s == pytest.approx(200.0, abs=30.0)


def test_the_mission_that_takes_too_long_ends_a_stay():
    life = Life(replace(GRACE_1, start_ne_m=(250.0, 250.0)))
    life.fly(mission(stay((250.0, 250.0), 10.0, 3000.0), timeout_s=200.0))
    assert life.executive.plan_state is OnboardPlanState.FAILED
    assert "took longer than 200 s" in life.executive.reason


def test_a_plan_that_waits_may_begin_while_the_robot_keeps_its_place():
    life = keeping()
    assert life.executive.may_switch
    life.robot.program.obey(CommandKind.HOLD, "")
    life.live(1.0)
    assert not life.executive.may_switch


@pytest.mark.parametrize(
    ("changes", "flaw"),
    [
        ({"radius_m": 0.0}, "within no radius"),
        ({"duration_s": 0.0}, "for no time"),
        ({"end_ned": (250.0, 250.0, 3.0)}, "under water"),
    ],
)
def test_a_stay_that_nobody_can_fly_is_refused_in_words(changes, flaw):
    life = Life(replace(GRACE_1, start_ne_m=(250.0, 250.0)))
    plan = mission(replace(stay((250.0, 250.0), 10.0, 300.0), **changes))
    assert life.start(plan) is CommandOutcome.NOT_NOW
    assert flaw in life.executive.reason


def test_a_radius_that_the_robot_cannot_tell_is_widened_on_board():
    for definition in (MINI_1, GRACE_1):
        life = Life(definition)
        place = life.estimate.position_ned
        least_m = FLIGHT_PROFILES[definition.vehicle.key].arrival_m
        leg = Leg(PrimitiveKind.KEEP, place, place, 0.1, 600.0, 1.0, radius_m=0.01)
        keep = Keep(life.executive._flight, leg)
        off = replace(life.estimate, position_ned=(place[0] + 0.9 * least_m, place[1], 0.0))
        keep.step(off, 0.1)
        assert keep.mode is RobotMode.SURFACED
        assert PLANNER_PRESETS[definition.vehicle.key].primitives.keep_radius_min_m >= least_m
