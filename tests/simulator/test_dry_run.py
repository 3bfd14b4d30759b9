import dataclasses

import numpy as np
import pytest

from autonomy.planner import outcome
from autonomy.planner.leg import edge
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.site import TANK, Area
from autonomy.vehicle.config import VEHICLES
from robot_link.dry_run import DryRunProblem
from robot_link.mission import Mission, MissionSettings
from simulator import dry_run
from tests.simulator.flight import two_dives

CONFIG = PLANNER_PRESETS["miniglider"]


def problem(legs=None, *, drift=None, timeout_s=5000.0, runs=1, **changes):
    """Return what the planner would hand over for two dives in the tank."""
    legs = legs or two_dives()
    config = CONFIG
    edges = [
        edge.Edge(pair, edge.planned_points(config, pair), sum(leg.energy for leg in pair))
        for pair in (legs[:2], legs[2:])
    ]
    candidate = outcome.as_candidate(config, edges, 0.0)
    start = legs[0].start_ned[:2]
    settings = MissionSettings(2.0, 10.0, timeout_s, *start)
    return dataclasses.replace(
        DryRunProblem(
            mission=Mission.from_legs(settings, tuple(legs)),
            planned_points=candidate.points,
            vehicle=VEHICLES["miniglider"],
            site=TANK,
            start_ne_m=start,
            heading_rad=0.4,
            drift_m_sqrt_s=CONFIG.position_filter.drift_m_sqrt_s if drift is None else drift,
            runs=runs,
        ),
        **changes,
    )


def flown(asked, reports=None, cancelled=lambda: False):
    told = [] if reports is None else reports
    return dry_run.run(asked, told.append, cancelled)


def test_a_plan_is_flown_whole_and_compared_with_what_it_promised():
    reports = []
    done = flown(problem(runs=2), reports)
    assert done.completed, done.message
    assert reports == [0.5, 1.0]
    assert 0.0 < done.rms_error_m < done.worst_error_m < 1.0
    assert 0.0 < done.surfacing_error_m < 1.0
    planned = sum(leg.duration_s for leg in two_dives())
    assert planned < done.duration_s < 2.0 * planned
    assert len(done.document()["flown"]) == len(done.track.time_s)


def test_what_the_water_does_unseen_shows_in_the_error():
    calm = flown(problem(drift=0.001))
    carried = flown(problem(drift=0.001, current_ne_m_s=(0.0, 0.06)))
    # the robot learns the current and aims off for it: its first dive tells, not its last
    assert carried.rms_error_m > calm.rms_error_m + 0.05
    drift = carried.track.true_ned[:, 1] - carried.track.believed_ned[:, 1]
    assert drift.max() > 0.2
    assert carried.position_error_m > 2.0 * calm.position_error_m
    assert calm.position_error_m < calm.predicted_error_m


def test_flights_that_come_to_the_end_let_expect_a_track():
    asked = problem(drift=0.001, runs=2)
    done = flown(asked)
    legs, each = len(two_dives()), len(done.expected) // len(two_dives())
    track = done.expected.reshape(legs, each, 5)
    ends_s = np.cumsum([leg.duration_s for leg in two_dives()])
    np.testing.assert_allclose(track[:, -1, 0], ends_s)
    np.testing.assert_allclose(track[1:, 0, 0], ends_s[:-1])
    assert all(begin < end for begin, end in done.expected_times_s)
    assert done.expected_times_s[-1][1] == pytest.approx(done.duration_s, abs=10.0)
    beside = done.track.true_ned[:, :2] - expected_at(done, done.track.time_s)
    of_two_m = done.spread_m / np.sqrt(3.0)  # both are as far from their own mean
    assert np.sqrt(np.mean(np.sum(beside**2, axis=1))) == pytest.approx(of_two_m, rel=0.3)
    assert 0.0 < of_two_m < done.rms_error_m
    assert np.all((track[..., 4] > 0.0) & (track[..., 4] < 0.5))
    assert len(done.document()["expected"]) == legs * each


def expected_at(done, time_s):
    """Return where the expected track is at moments of a flight, north and east."""
    legs = done.expected.reshape(len(done.expected_times_s), -1, 5)
    at_s = np.concatenate([np.linspace(*times, legs.shape[1]) for times in done.expected_times_s])
    return np.column_stack([np.interp(time_s, at_s, done.expected[:, k]) for k in (1, 2)])


def test_a_single_flight_or_one_that_breaks_off_lets_expect_no_track():
    for done in (flown(problem()), flown(problem(timeout_s=60.0, runs=2))):
        assert (done.expected, done.spread_m, done.expected_times_s) == (None, None, ())
        assert done.document()["expected"] == []


def test_what_nobody_knows_of_the_current_differs_by_flight_and_cancels():
    asked = problem(runs=4, current_ne_m_s=(0.01, -0.02), unknown_current_std_m_s=0.03, seed=5)
    met = np.array([dry_run._current_ne_m_s(asked, number) for number in range(4)])
    np.testing.assert_allclose(met.mean(axis=0), (0.01, -0.02), atol=1e-12)
    np.testing.assert_allclose(np.sqrt(((met - met.mean(axis=0)) ** 2).mean(axis=0)), 0.03)
    alone = dataclasses.replace(asked, runs=1)
    assert dry_run._current_ne_m_s(alone, 0) == (0.01, -0.02)


def test_trim_is_taken_to_be_right():
    plain = flown(problem(drift=0.001))
    settings = dataclasses.replace(
        problem().mission.settings, net_buoyancy_offset_kg=-0.002, mass_position_offset_m=0.001
    )
    trimmed = Mission.from_legs(settings, two_dives())
    same = flown(problem(drift=0.001, mission=trimmed))
    assert same.rms_error_m < plain.rms_error_m + 0.08


def test_a_mission_that_runs_out_of_time_is_said_so():
    done = flown(problem(timeout_s=60.0))
    assert not done.completed
    assert "did not fly the whole plan" in done.message


def square(name, north_m, east_m):
    half_m = 0.1
    sides = [(-half_m, -half_m), (-half_m, half_m), (half_m, half_m), (half_m, -half_m)]
    return Area(name=name, corners_m=tuple((north_m + n, east_m + e) for n, e in sides))


def test_a_keep_out_that_the_robot_is_carried_into_is_named():
    north_m, east_m, _ = two_dives()[0].end_ned
    way, aside = square("reeds", north_m, east_m), square("jetty", north_m, east_m + 1.0)
    done = flown(problem(drift=0.001, keep_outs=(way, aside)))
    assert done.completed
    assert done.entered == ("reeds",)
    assert done.message.startswith("Flown once against the full dynamics: ")
    assert " m (rms) from the plan" in done.message
    assert done.message.endswith(' It enters the keep-out "reeds".')
    again = flown(problem(drift=0.001, keep_outs=(way, aside), runs=2))
    assert again.message.endswith(' It enters the keep-out "reeds" in 2 of 2 flights.')
    clear = flown(problem(drift=0.001, keep_outs=(aside,)))
    assert clear.entered == ()
    assert "keep-out" not in clear.message


def test_it_stops_when_nobody_wants_to_know():
    with pytest.raises(dry_run.DryRunCancelledError):
        flown(problem(), cancelled=lambda: True)


def test_the_same_seed_flies_the_same_way():
    np.testing.assert_array_equal(flown(problem()).track.true_ned, flown(problem()).track.true_ned)


def test_a_vehicle_without_a_simulated_robot_is_refused_by_name():
    own = dataclasses.replace(VEHICLES["miniglider"], key="seal")
    with pytest.raises(ValueError, match="seal"):
        flown(problem(vehicle=own))
