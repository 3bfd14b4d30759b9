"""What speaks against following a target, and the words for how well that goes."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from autonomy.site import LAKE, TANK
from autonomy.tracking.config import TRACKING_PRESETS, TrackingConfig
from autonomy.tracking.phase import TargetPhase
from db.query.fleet.robots import RobotRecord
from db.query.mission.plans import PlanRecord
from robot_link.messages import OnboardPlanState, PlanReport, RobotId, RobotMode
from robot_link.report import TargetEstimate
from robot_link.satellite.content import MobileOriginatedContent
from server.alarm.value import VALUES, Watch
from server.fleet.status import PlanInHand, RobotStatus
from server.fleet.target_words import target_text, within_95_m
from server.fleet.trail import Track
from server.fleet.words import activity
from server.plan.document import points_of
from server.plan.target_check import (
    target_path,
    target_violations,
    target_warnings,
)
from server.satellite.content import values_of
from tests.db.target import target_report
from tests.server.alarm.judge import verdicts
from tests.server.fake_link import state_report

NOW = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
MINI = RobotId("mini-1")
MODEM = "micromodem://127.0.0.1:5005?us=1&peer=2"


def status_in(site, position_ned=(1.0, 0.5, 0.0), **state):
    record = RobotRecord(MINI, "mini-1", "miniglider", "real", None, (MODEM,), site, NOW)
    status = RobotStatus(record, Track(0.01, (0.05, 0.12)))
    status.state = state_report(MINI, position_ned, **state)
    return status


def changed(**groups):
    value = TRACKING_PRESETS["miniglider"].model_dump()
    for group, fields in groups.items():
        value[group].update(fields)
    return TrackingConfig.model_validate(value)


def fields(found):
    return [one.field for one in found]


@pytest.mark.parametrize(
    ("vehicle", "site", "position"),
    [("miniglider", TANK, (1.0, 0.5, 0.0)), ("grace3", LAKE, (110.0, 140.0, 0.0))],
)
def test_the_presets_break_no_limit_and_need_no_warning(vehicle, site, position):
    status, config = status_in(site, position), TRACKING_PRESETS[vehicle]
    assert target_violations(status, config) == []
    assert target_warnings(status, config, is_quiet=False) == []


@pytest.mark.parametrize(
    ("groups", "field", "words"),
    [
        ({"target": {"north_m": 9.0}}, "target.north_m", "outside of the water"),
        ({"target": {"depth_m": 1.5}}, "target.depth_m", "floor there is 1.2 m"),
        (
            {"target": {"path": "line", "speed_m_s": 0.02}, "motion": {"duration_s": 900.0}},
            "target.path",
            "leaves the water",
        ),
        (
            {"target": {"kind": "tag"}, "filter": {"target_velocity": "known"}},
            "filter.target_velocity",
            "have it estimated",
        ),
        ({"target": {"kind": "tag", "address": 16}}, "target.address", "0 to 15"),
        ({"target": {"kind": "beacon", "address": 2}}, "target.address", "of mini-1 itself"),
        ({"target": {"kind": "tag", "address": 1}}, "target.address", "the station's modem"),
        ({"motion": {"depth_m": 1.3}}, "motion.depth_m", "1.2 m deep"),
        ({"motion": {"margin_m": 1.6}}, "motion.margin_m", "3.1 m wide"),
        (
            {"target": {"path": "circle", "speed_m_s": 0.7, "width_m": 0.1}},
            "target.speed_m_s",
            "speed cap",
        ),
        (
            {"target": {"path": "sine", "speed_m_s": 0.0, "width_m": 0.4, "period_s": 1.0}},
            "target.speed_m_s",
            "2.51 m/s",
        ),
    ],
)
def test_each_limit_is_named_by_its_field(groups, field, words):
    found = target_violations(status_in(TANK), changed(**groups))
    assert fields(found) == [field]
    assert words in found[0].message


def test_land_within_the_box_of_a_lake_is_no_water():
    status = status_in(LAKE, (250.0, 250.0, 0.0))
    found = target_violations(status, changed(target={"north_m": 10.0, "east_m": 490.0}))
    assert fields(found) == ["target.north_m"]


def test_a_robot_that_cannot_do_it_now_is_named():
    far = status_in(TANK, (30.0, 0.0, 0.0))
    assert fields(target_violations(far, TRACKING_PRESETS["miniglider"])) == ["start"]
    empty = status_in(TANK, battery_fraction=0.15)
    (one,) = target_violations(empty, TRACKING_PRESETS["miniglider"])
    assert one.field == "start"
    assert "15% of its battery" in one.message


@pytest.mark.parametrize(
    ("barrier", "field"),
    [
        ({"controller": "nominal"}, "teaching"),
        ({"controller": "mpc_none"}, "barrier.controller"),
        ({"alpha": "negative"}, "barrier.alpha"),
        ({"fallback": "nominal"}, "barrier.fallback"),
    ],
)
def test_what_a_person_should_know_is_a_warning_and_no_limit(barrier, field):
    config = changed(barrier=barrier)
    assert fields(target_warnings(status_in(TANK), config, is_quiet=False)) == [field]
    assert target_violations(status_in(TANK), config) == []


def test_swimming_out_of_radios_reach_and_silence_are_warned_of():
    lake = status_in(LAKE, (250.0, 250.0, 0.0))
    deep = changed(motion={"depth_m": 2.0})
    assert fields(target_warnings(lake, deep, is_quiet=False)) == ["motion.depth_m"]
    shallow = changed(motion={"depth_m": 0.5})
    assert target_warnings(status_in(TANK), shallow, is_quiet=False) == []
    assert fields(target_warnings(status_in(TANK), changed(), is_quiet=True)) == ["quiet"]


def test_path_of_a_target_that_turns_comes_back():
    config = changed(
        target={"path": "circle", "speed_m_s": 0.01, "width_m": 0.3},
        motion={"duration_s": 60.0 * 3.14159265},
    )
    path = target_path(config)
    assert path[-1][1:] == pytest.approx(path[0][1:], abs=1e-3)
    assert len(path) == 301


def test_path_of_long_missions_keeps_its_shape():
    day = {"duration_s": 86400.0}
    around = target_path(changed(target={"speed_m_s": 0.01, "width_m": 0.3}, motion=day))
    assert around[-1][0] == pytest.approx(60.0 * 3.14159265, abs=1e-3)
    swing = {"path": "sine", "speed_m_s": 0.0, "period_s": 30.0, "width_m": 0.2}
    swings = target_path(changed(target=swing, motion=day))
    assert len(swings) == 1001
    norths = [north for _, north, _ in swings]
    easts = [east for _, _, east in swings]
    assert max(norths) - min(norths) < 1e-9
    assert max(easts) - min(easts) == pytest.approx(0.4)


def test_swing_out_of_the_water_is_found_however_short():
    swing = {"path": "sine", "speed_m_s": 0.00001, "period_s": 144.0, "width_m": 1.3}
    config = changed(
        target={**swing, "east_m": 0.385}, motion={"duration_s": 43200.0, "speed_max_m_s": 0.2}
    )
    (one,) = target_violations(status_in(TANK), config)
    assert one.field == "target.path"
    late = changed(
        target={"path": "sine", "heading_rad": 0.0, "north_m": 0.5, "speed_m_s": 1e-4,
                "period_s": 30.0, "width_m": 0.1},
        motion={"duration_s": 80000.0, "speed_max_m_s": 0.2},
    )  # fmt: skip
    (one,) = target_violations(status_in(TANK), late)
    assert one.field == "target.path"


def in_hand(duration_s, kind="track_target"):
    document = {"account": {"duration_s": duration_s}}
    record = PlanRecord(
        "plan-1", MINI, kind, None, 1, "running", "a" * 64, {}, document, NOW, "me",
        NOW, NOW, NOW, NOW, None,
    )  # fmt: skip
    return PlanInHand(record, (), points_of(document), "")


def test_robot_that_follows_a_target_under_water_surfaces_when_that_ends():
    status = status_in(LAKE)
    status.plan = in_hand(400.0)
    assert status.next_surfacing() is None
    status.plan_report = PlanReport(
        MINI, "a" * 64, OnboardPlanState.RUNNING, 0, 0, 1.0, "", NOW, NOW
    )
    assert status.next_surfacing() == NOW + timedelta(seconds=400.0)


def alarm(status):
    return verdicts(status, Watch(NOW, NOW)).get("target")


def test_a_lost_target_is_an_alarm_as_long_as_the_mission_lasts():
    status = status_in(TANK)
    assert alarm(status) is None
    status.target_report = target_report(0, TargetPhase.LOST)
    assert alarm(status).text == "mini-1 lost its target; it circles to find it."
    status.target_report = replace(status.target_report, is_barrier_on=False)
    assert alarm(status).text == "mini-1 lost its target; it does not search for it."
    status.target_report = replace(status.target_report, is_quiet=True)
    assert alarm(status).text == "mini-1 lost its target; it was told not to ping."
    status.plan_report = PlanReport(
        MINI, "a" * 64, OnboardPlanState.FAILED, 0, 0, 1.0, "lost", NOW, NOW
    )
    assert alarm(status) is None


def test_a_target_that_is_too_fast_is_an_alarm_before_it_is_lost():
    status = status_in(TANK)

    def too_fast():
        return verdicts(status, Watch(NOW, NOW)).get("target speed")

    status.target_report = target_report(0)
    assert too_fast() is None
    status.target_report = target_report(0, is_too_fast=True)
    assert too_fast().text == "mini-1 follows a target that is too fast for it."
    status.plan_report = PlanReport(
        MINI, "a" * 64, OnboardPlanState.FAILED, 0, 0, 1.0, "lost", NOW, NOW
    )
    assert too_fast() is None


def test_the_alarm_of_a_lost_target_says_how_that_ended():
    value = VALUES["target_lost"]
    status = status_in(TANK)
    for phase, how in (
        (TargetPhase.TRACKING, "found again"),
        (TargetPhase.COASTING, "found again"),
        (TargetPhase.WAITING, "its pursuit ended"),
        (TargetPhase.ENDED, "its pursuit ended"),
    ):
        status.target_report = target_report(0, phase)
        assert value.over(status) == f"mini-1 lost its target; {how}."
    status.target_report = target_report(0, TargetPhase.TRACKING)
    status.plan_report = PlanReport(
        MINI, "a" * 64, OnboardPlanState.FAILED, 0, 0, 1.0, "lost", NOW, NOW
    )
    assert value.over(status) == "mini-1 lost its target; its pursuit ended."


def test_a_loss_in_an_earlier_mission_is_no_alarm_while_another_is_flown():
    status = status_in(TANK)
    status.target_report = target_report(0, TargetPhase.LOST)
    status.plan_report = PlanReport(
        MINI, "a" * 64, OnboardPlanState.RUNNING, 0, 0, 1.0, "", NOW, NOW
    )
    status.plan = in_hand(400.0)
    assert alarm(status) is not None
    status.plan = in_hand(400.0, kind="survey")
    assert alarm(status) is None


def test_a_satellite_record_tells_of_the_target_as_radio_does():
    state, report = state_report(MINI), target_report(0, TargetPhase.LOST)
    content = MobileOriginatedContent(counter=3, state=state, target=report)
    assert values_of(content, MINI, NOW, NOW, lambda _: None, lambda _: None) == [state, report]


ROUND = TargetEstimate((1.4, 0.8), (0.0, 0.0), (0.01, 0.0, 0.01), 1.0)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (
            {"phase": TargetPhase.WAITING, "hypotheses": (), "range_m": None},
            "mini-1 has heard no range of its target yet.",
        ),
        (
            {"phase": TargetPhase.WAITING, "hypotheses": (), "is_quiet": True},
            "mini-1 has heard no range of its target yet; it was told not to ping.",
        ),
        (
            {"hypotheses": (ROUND,)},
            "mini-1 follows its target, 0.50 m away, known within 0.24 m.",
        ),
        (
            {"hypotheses": (replace(ROUND, weight=0.9), replace(ROUND, weight=0.1))},
            "mini-1 follows its target, 0.50 m away, known within 0.24 m if it is not mirrored "
            "(10%).",
        ),
        (
            {"hypotheses": (replace(ROUND, weight=0.9),)},
            "mini-1 follows its target, 0.50 m away, known within 0.24 m if it is not mirrored "
            "(10%).",
        ),
        (
            {"hypotheses": (replace(ROUND, weight=0.999), replace(ROUND, weight=0.001))},
            "mini-1 follows its target, 0.50 m away, known within 0.24 m.",
        ),
        (
            {"phase": TargetPhase.COASTING, "hypotheses": (ROUND,), "range_age_s": 4.2},
            "mini-1 goes on by dead reckoning; the newest range is 4.2 s old, known within 0.24 m.",
        ),
        (
            {"phase": TargetPhase.LOST, "range_age_s": 21.3},
            "mini-1 lost its target; the newest range is 21 s old; it circles to find it.",
        ),
        (
            {"phase": TargetPhase.LOST, "is_quiet": True},
            "mini-1 lost its target, for it was told not to ping; it circles to find it.",
        ),
        ({"phase": TargetPhase.ENDED}, "mini-1 follows its target no longer."),
        (
            {"hypotheses": (ROUND,), "is_too_fast": True},
            "mini-1 follows its target, 0.50 m away, known within 0.24 m. The target seems too "
            "fast to follow and will be lost.",
        ),
        (
            {"hypotheses": (ROUND,), "delay_s": 1.94},
            "mini-1 follows its target, 0.50 m away, known within 0.24 m. Its ranges seem 1.9 s "
            "older than they are told.",
        ),
        (
            {"hypotheses": (ROUND,), "is_barrier_on": False},
            "mini-1 follows its target, 0.50 m away, known within 0.24 m. Nothing keeps the target "
            "observable: the mission is for teaching.",
        ),
    ],
)
def test_each_phase_has_its_sentence(changes, text):
    assert target_text(replace(target_report(0), **changes)) == text


def test_larger_axis_of_an_ellipse_does_not_depend_on_how_it_lies():
    lying = TargetEstimate((0.0, 0.0), (0.0, 0.0), (0.09, 0.0, 0.01), 1.0)
    turned = TargetEstimate((0.0, 0.0), (0.0, 0.0), (0.05, 0.04, 0.05), 1.0)
    assert within_95_m(lying) == pytest.approx(within_95_m(turned))
    assert within_95_m(lying) == pytest.approx(2.4477 * 0.3)


def test_a_robot_that_follows_or_searches_says_so():
    assert activity(state_report(MINI, mode=RobotMode.TRACKING), "", False) == (
        "Following its target"
    )
    assert activity(state_report(MINI, mode=RobotMode.SEARCHING), "", True) == (
        "Last heard: searching for its target"
    )
