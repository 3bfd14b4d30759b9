"""Reports on a target are listed under the plan that was flown, however it began and ended."""

from datetime import timedelta

import pytest

from autonomy.tracking.phase import TargetPhase
from db.query.mission.target_reports import target_reports
from db.query.mission.target_span import TargetSpan, range_of_plan
from robot_link.messages import OnboardPlanState, PlanHash, PlanReport, RobotId
from tests.db.conftest import START
from tests.db.target import target_report

FIRST, SECOND, THIRD = (PlanHash(letter * 64) for letter in "abc")
ON_BOARD, RUNNING = OnboardPlanState.ON_BOARD, OnboardPlanState.RUNNING
DONE, FAILED = OnboardPlanState.DONE, OnboardPlanState.FAILED
WAITING, TRACKING, ENDED = TargetPhase.WAITING, TargetPhase.TRACKING, TargetPhase.ENDED


def at(second):
    return START + timedelta(seconds=second)


def word(second, state, sha256=FIRST):
    return PlanReport(RobotId("mini-1"), sha256, state, 0, 0, 0.0, "", at(second), at(second))


def row(second, heard, phase=TRACKING):
    return target_report(second, phase, ranges_heard=heard)


@pytest.fixture
def listed(store):
    """Keeps what a robot said, and says which seconds are listed under a plan."""

    def of(plan, *said):
        if said:
            store.append(said).result(60)
        with store.read() as session:
            wanted = range_of_plan(session, "mini-1", plan)
            if wanted is None:
                return None
            found = target_reports(session, "mini-1", wanted)
        return [round((one.measured_at - START).total_seconds()) for one in found]

    return of


def test_reports_belong_to_the_plan_that_was_flown(store):
    said = [
        word(0, ON_BOARD),
        word(10, RUNNING),
        word(20, RUNNING),
        word(30, DONE),
        word(40, ON_BOARD, SECOND),
        word(50, RUNNING, SECOND),
    ]
    store.append(said).result(60)
    with store.read() as session:
        assert range_of_plan(session, "mini-1", FIRST) == TargetSpan(at(0), at(40))
        assert range_of_plan(session, "mini-1", SECOND) == TargetSpan(at(40), None)
        assert range_of_plan(session, "mini-1", THIRD) is None


def test_last_words_of_a_mission_are_not_those_of_the_plan_that_came_on_board_meanwhile(listed):
    assert listed(
        FIRST,
        word(10, RUNNING), row(11, 4), row(12, 9),
        word(13, FAILED), row(13, 9, ENDED),
        word(14, ON_BOARD, SECOND), row(15, 9, ENDED), row(16, 9, ENDED),
        row(18, 0, WAITING), word(19, RUNNING, SECOND), row(20, 2),
    ) == [11, 12, 13, 15, 16]  # fmt: skip
    assert listed(SECOND) == [18, 20]


def test_a_plan_that_nobody_heard_fly_leaves_its_reports_to_no_other(listed):
    assert listed(
        FIRST,
        word(10, RUNNING), row(11, 30), word(12, DONE), row(13, 31, ENDED),
        word(14, ON_BOARD, SECOND), row(16, 1), row(17, 3, ENDED),
        word(18, FAILED, SECOND), row(19, 3, ENDED),
        word(20, ON_BOARD, THIRD), row(21, 3, ENDED), row(22, 1), word(23, RUNNING, THIRD),
    ) == [11, 13]  # fmt: skip
    assert listed(SECOND) == [16, 17, 19, 21]
    assert listed(THIRD) == [22]


def test_a_mission_that_follows_another_without_a_word_is_known_by_its_count_of_ranges(listed):
    assert listed(
        FIRST,
        word(10, RUNNING), row(11, 30), row(12, 34), row(14, 2), word(15, RUNNING, SECOND),
        row(16, 5),
    ) == [11, 12]  # fmt: skip
    assert listed(SECOND) == [14, 16]


def test_a_plan_that_could_not_begin_takes_nothing_from_the_one_before(listed):
    assert listed(
        FIRST,
        word(10, RUNNING), row(11, 7), word(12, DONE), row(13, 7, ENDED),
        word(14, FAILED, SECOND), row(15, 7, ENDED),
    ) == [11, 13, 15]  # fmt: skip
    assert listed(SECOND) is None


def test_a_plan_of_which_nothing_is_heard_yet_has_not_the_last_words_of_the_one_before(listed):
    assert listed(
        FIRST,
        word(10, RUNNING), row(11, 7), word(12, DONE), word(13, ON_BOARD, SECOND),
        row(14, 7, ENDED), word(15, RUNNING, SECOND),
    ) == [11, 14]  # fmt: skip
    assert listed(SECOND) == []


def test_the_first_mission_of_all_may_be_heard_at_its_end_only(listed):
    assert listed(FIRST, row(11, 7), word(12, FAILED), row(13, 7, ENDED)) == [11, 13]
