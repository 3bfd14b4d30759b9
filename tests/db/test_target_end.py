"""How missions that followed a target ended, by words on the plan that come before or after."""

from dataclasses import replace

import pytest

from db.query.mission.target_end import mission_end
from db.query.mission.target_reports import iterate_target_reports
from db.query.mission.target_span import EVERYTHING
from robot_link.messages import OnboardPlanState
from server.fleet.target_words import with_reasons
from tests.db.test_target_span import (
    DONE,
    ENDED,
    FAILED,
    FIRST,
    ON_BOARD,
    RUNNING,
    SECOND,
    at,
    row,
    word,
)  # fmt: skip


def told(second, state, reason, sha256=FIRST):
    return replace(word(second, state, sha256), reason=reason)


@pytest.fixture
def end(store):
    def of(second, *said):
        store.append(said).result(60)
        with store.read() as session:
            return mission_end(session, "mini-1", at(second))

    return of


def test_a_robot_that_comes_up_says_later_why(end):
    said = word(1, RUNNING), row(2, 5, ENDED)
    assert end(2, *said) == (RUNNING, "")
    assert end(2, word(3, RUNNING), told(9, FAILED, "the floor is near")) == (
        FAILED,
        "the floor is near",
    )


def test_a_reason_that_was_said_stays_when_another_plan_is_on_board(end):
    said = word(1, RUNNING), told(2, FAILED, "the target was lost for 120 s"), row(3, 5, ENDED)
    assert end(5, *said, word(4, ON_BOARD, SECOND), row(5, 5, ENDED)) == (
        FAILED,
        "the target was lost for 120 s",
    )


def test_the_end_of_the_plan_before_is_not_that_of_one_which_nobody_heard_fly(end):
    said = word(1, RUNNING), word(2, DONE), row(3, 1), row(4, 2, ENDED)
    assert end(4, *said) == (OnboardPlanState.RUNNING, "")
    late = told(6, FAILED, "surfaced by command", SECOND)
    assert end(4, late) == (FAILED, "surfaced by command")


def test_the_end_of_a_later_plan_explains_no_earlier_one(end):
    said = word(1, RUNNING), row(2, 1, ENDED), word(3, RUNNING, SECOND), word(4, DONE, SECOND)
    assert end(2, *said) == (OnboardPlanState.RUNNING, "")


def test_the_end_of_a_later_plan_explains_no_report_that_follows_it_either(store):
    said = word(1, RUNNING), row(2, 1, ENDED), word(3, RUNNING, SECOND), word(4, DONE, SECOND)
    store.append((*said, row(5, 1, ENDED))).result(60)
    with store.read() as session:
        told_of = with_reasons(session, iterate_target_reports(session, "mini-1", EVERYTHING))
        assert [reason for _, reason in told_of] == ["", ""]
