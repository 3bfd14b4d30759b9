from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from autonomy.site import LAKE, TANK
from db.query.fleet.robots import RobotRecord
from robot_link.messages import (
    SURFACED_BY_COMMAND,
    LinkReport,
    LinkState,
    OnboardPlanState,
    PlanReport,
    RobotId,
    RobotMode,
)
from robot_link.report import CurrentReport
from server.alarm.value import Watch
from server.fleet.clock_fault import ClockFault
from server.fleet.status import RobotStatus, SatelliteStatus
from server.fleet.trail import POINTS_MAX, Track
from tests.robot_link.test_actuator_report import REPORT
from tests.server.alarm import judge
from tests.server.fake_link import state_report

NOW = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
LONG_AGO = NOW - timedelta(hours=2)
MINI = RobotId("mini-1")


@pytest.fixture
def status():
    record = RobotRecord(MINI, "mini-1", "miniglider", "real", None, (), TANK, LONG_AGO)
    return RobotStatus(record, Track(0.01, (0.05, 0.12)))


def verdicts(status, since=LONG_AGO, speed=1.0):
    return judge.verdicts(status, Watch(NOW, since, speed))


def link(state, age_s=60.0):
    return {"xbee": LinkReport(MINI, "xbee", state, NOW - timedelta(seconds=age_s), None, 1, 0)}


def test_robot_that_was_never_heard_raises_nothing(status):
    assert verdicts(status) == {}


def test_silence_alarms_after_its_limit_and_not_just_after_a_start(status):
    status.links = link(LinkState.STALE)
    assert verdicts(status)["silence"].text == "mini-1 does not answer; last heard at 11:59Z."
    assert verdicts(status, since=NOW - timedelta(seconds=5)) == {}
    status.links = link(LinkState.STALE, age_s=10)
    assert verdicts(status) == {}
    status.links = link(LinkState.STALE, age_s=200)
    assert verdicts(status, speed=20.0) == {}


def test_silence_of_a_robot_that_said_it_would_dive_is_no_alarm(status):
    status.links = link(LinkState.SUBMERGED, age_s=600)
    assert verdicts(status) == {}


def test_closed_port_alarms(status):
    status.links = link(LinkState.PORT_CLOSED)
    assert "plug it in" in verdicts(status)["port"].text


def test_radio_that_does_not_answer_is_not_told_to_be_plugged_in(status):
    status.links = link(LinkState.MUTE)
    text = verdicts(status)["port"].text
    assert text.startswith("The station's radio for mini-1 does not answer; its port is open.")
    assert "plug" not in text
    assert "opened" not in text


@pytest.mark.parametrize(("late_min", "level"), [(5, None), (15, "watch"), (50, "critical")])
def test_overdue_robot_alarms_by_how_late_it_is(status, monkeypatch, late_min, level):
    due = NOW - timedelta(minutes=late_min)
    monkeypatch.setattr(RobotStatus, "next_surfacing", lambda self: due)
    status.links = link(LinkState.SUBMERGED)
    found = verdicts(status).get("overdue")
    assert (found.level if found else None) == level


def test_actuators_alarm_by_what_they_do_to_the_flight(status):
    nominal = replace(REPORT, is_mass_off=False, speed_share=1.0)
    status.actuator_report = nominal
    assert verdicts(status) == {}
    status.actuator_report = REPORT
    found = verdicts(status)["actuators"]
    assert found.level == "watch"
    assert "its sliding mass is slow or late. Dives are flown at 50%" in found.text
    status.actuator_report = replace(nominal, is_swinging=True)
    found = verdicts(status)["actuators"]
    assert (found.level, "gentlest gait" in found.text) == ("warning", True)
    status.actuator_report = replace(nominal, stuck=("sliding mass",))
    assert "The sliding mass is stuck" in verdicts(status)["actuators"].text


def test_plan_that_ended_early_alarms_with_its_reason(status):
    report = PlanReport(
        MINI, None, OnboardPlanState.FAILED, 1, 3, 2.0, "the floor was near", NOW, NOW
    )
    status.plan_report = report
    assert "the floor was near" in verdicts(status)["plan ended early"].text
    status.plan_report = replace(report, state=OnboardPlanState.RUNNING)
    assert verdicts(status) == {}


def test_plan_that_a_person_ended_is_no_cause_of_alarm(status):
    status.plan_report = PlanReport(
        MINI, None, OnboardPlanState.FAILED, 1, 3, 2.0, SURFACED_BY_COMMAND, NOW, NOW
    )
    assert verdicts(status) == {}


def test_battery_alarms_by_its_charge(status):
    for charge, level in ((0.5, None), (0.15, "warning"), (0.05, "critical")):
        status.state = state_report(MINI, battery_fraction=charge)
        found = verdicts(status).get("battery")
        assert (found.level if found else None) == level


def test_long_track_is_thinned_and_asks_to_be_drawn_anew():
    track = Track(0.5, (0.05, 0.12))
    for number in range(POINTS_MAX):
        track.add((float(number), 0.0, 0.0), 0.02, RobotMode.GLIDING)
    before = track.since(0)
    track.add((float(POINTS_MAX), 0.0, 0.0), 0.02, RobotMode.GLIDING)
    after = track.since(before.cursor)
    assert after.restarted
    assert len(after.position_ned) == POINTS_MAX // 2 + 1
    assert after.position_ned[-1, 0] == POINTS_MAX


def test_track_sorts_its_points_anew_when_thresholds_change():
    track = Track(0.01, (0.05, 0.12))
    track.add((0.0, 0.0, 0.0), 0.08, None)
    assert track.since(0).fidelity.tolist() == [1]
    track.set_thresholds((0.1, 0.2))
    assert track.since(0).fidelity.tolist() == [2]
    assert track.levels == 3


def test_track_tells_what_floated_from_what_was_flown():
    track = Track(0.01, (0.05, 0.12))
    modes = [RobotMode.IDLE, RobotMode.SWIMMING, RobotMode.SURFACED, None, RobotMode.HOLDING]
    for number, mode in enumerate(modes):
        track.add((float(number), 0.0, 0.0), 0.02, mode)
    assert track.since(0).is_adrift.tolist() == [True, False, True, False, True]


def satellite(**changes):
    values = {
        "credits_today": 4,
        "credits_per_day": 100,
        "waits_for_budget": False,
        "next_session_at": None,
        "fault": "",
    }
    return SatelliteStatus(**{**values, **changes})


@pytest.mark.parametrize(("late_min", "level"), [(5, None), (15, "watch"), (50, "critical")])
def test_robot_that_misses_its_call_by_satellite_alarms_once(status, late_min, level):
    due = NOW - timedelta(minutes=late_min)
    status.links = link(LinkState.STALE, age_s=7200)
    status.satellite = satellite(next_session_at=due)
    found = verdicts(status)
    assert (found["contact"].level if level else None) == level
    assert set(found) == ({"contact"} if level else set()), "silence is not alarmed as well"


def test_spent_budget_alarms_only_while_something_waits_for_it(status):
    status.satellite = satellite(credits_today=100)
    assert verdicts(status) == {}
    status.satellite = satellite(credits_today=100, waits_for_budget=True)
    assert "100 of 100 credits" in verdicts(status)["satellite budget"].text


def test_refused_plan_by_satellite_alarms_with_the_gateways_sentence(status):
    status.satellite = satellite(fault="plan-3 refused: RockBLOCK did not take it: no credit.")
    assert verdicts(status)["satellite"].text == (
        "Satellite to mini-1: plan-3 refused: RockBLOCK did not take it: no credit."
    )


def test_wrong_clock_alarms(status):
    status.clock_fault = ClockFault(timedelta(days=-400), "The clock of mini-1 is behind.")
    assert verdicts(status)["clock"].text == "The clock of mini-1 is behind."


def test_slow_simulation_is_not_blamed_on_the_robot_alone(status):
    status.clock_fault = ClockFault(timedelta(minutes=-45), "Its clock is behind.")
    assert "simulate" not in verdicts(status, speed=20.0)["clock"].text
    status.record = replace(status.record, kind="simulated")
    assert "cannot simulate 20 times as fast" in verdicts(status, speed=20.0)["clock"].text
    assert "simulate" not in verdicts(status)["clock"].text


def test_robot_that_the_water_carries_ashore_alarms(status):
    status.record = replace(status.record, site=LAKE)
    middle = 0.5 * (LAKE.water.x_min_m + LAKE.water.x_max_m)
    status.state = state_report(MINI, (middle, 250.0, 0.0), at=NOW)
    assert "adrift" not in verdicts(status)
    status.state = state_report(MINI, (middle, 455.0, 0.0), at=NOW)
    left_m = LAKE.clearance_m(middle, 455.0)
    assert 0.0 < left_m < 60.0
    status.current_report = CurrentReport(MINI, NOW, NOW, (0.0, 0.04), 0.01, 1.0, 3, 0)
    assert "near the shore" in verdicts(status)["adrift"].text
    sure = status.current_report
    status.current_report = replace(sure, current_std_m_s=0.05)
    assert "adrift" not in verdicts(status), "of which nobody knows whither it flows"
    status.current_report = replace(sure, current_ne_m_s=(0.0, -0.04))
    assert "adrift" not in verdicts(status)
    status.current_report = replace(status.current_report, current_ne_m_s=(0.0, 0.04))
    status.plan_report = PlanReport(MINI, None, OnboardPlanState.RUNNING, 1, 3, 2.0, "", NOW, NOW)
    assert "adrift" not in verdicts(status)
    status.plan_report = None
    status.state = state_report(MINI, (middle, 900.0, 0.0), at=NOW)
    assert "outside of its water" in verdicts(status)["adrift"].text


def test_another_robot_under_the_same_system_id_alarms(status):
    now = NOW - timedelta(seconds=1)
    conflict = "another radio (00000000000000A2) speaks as system 1; it is not obeyed"
    status.links = {
        "xbee": LinkReport(MINI, "xbee", LinkState.LIVE, now, None, 1, 0, conflict=conflict)
    }
    assert verdicts(status)["system id"].text == (
        f"mini-1 is not alone under its system id: {conflict}."
    )
    status.links = link(LinkState.LIVE)
    assert "system id" not in verdicts(status)


def test_rules_say_when_time_alone_changes_their_answer(status, monkeypatch):
    due = NOW - timedelta(minutes=4)
    monkeypatch.setattr(RobotStatus, "next_surfacing", lambda self: due)
    status.links = link(LinkState.SUBMERGED)

    def asked(at):
        watch = Watch(at, LONG_AGO, 1.0)
        found = judge.verdicts(status, watch)
        return watch.due, found.get("overdue")

    begins, nothing = asked(NOW)
    assert nothing is None
    assert begins == due + timedelta(minutes=10)
    more, first = asked(begins)
    assert first.level == "watch"
    assert more == due + timedelta(minutes=40)
    _, worst = asked(due + timedelta(minutes=40))
    assert worst.level == "critical"


def test_what_an_alarm_says_does_not_age(status, monkeypatch):
    """It is read in the log for years: a moment has its time, and its day where that is another."""
    due = NOW - timedelta(minutes=15)
    monkeypatch.setattr(RobotStatus, "next_surfacing", lambda self: due)
    status.links = link(LinkState.SUBMERGED)
    text = verdicts(status)["overdue"].text
    assert text == "mini-1 was to surface at 11:45Z and did not."
    due = NOW - timedelta(hours=20)
    assert "at 2026-11-20 16:00Z and" in verdicts(status)["overdue"].text
    status.links = link(LinkState.STALE, age_s=86_400)
    assert "last heard at 2026-11-20 12:00Z." in verdicts(status)["silence"].text


def test_robot_whose_fixes_surprise_it_is_doubted_aloud(status):
    calm = CurrentReport(MINI, NOW, NOW, (0.01, 0.0), 0.002, 1.1, 6, 0)
    status.current_report = calm
    assert verdicts(status) == {}
    status.current_report = replace(calm, doubt=1.8)
    assert verdicts(status)["doubt"].level == "watch"
    assert verdicts(status)["doubt"].text == (
        "mini-1: Its last fixes lay farther off than it states: the water moves more than was "
        "believed, or its compass is off. Position errors may be 1.8 times larger than stated. "
        "Let it surface more often, or plan with the current from dives."
    )
