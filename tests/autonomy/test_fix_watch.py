"""Which fixes are believed, and how far they make a filter doubt itself."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autonomy.estimation.config import MOST_DOUBT
from autonomy.estimation.fix_watch import DIVES, FixGate, FixWatch, Verdict

SPEED_M_S = 0.5
FIX_STD_M = 1.5


def doubt_of(*squares: float) -> float:
    watch = FixWatch()
    for squared in squares:
        watch.take(squared)
    return watch.doubt


def test_dives_that_end_where_expected_raise_no_doubt() -> None:
    rng = np.random.default_rng(0)
    doubts = [doubt_of(*rng.chisquare(2, DIVES)) for _ in range(400)]
    assert np.mean(doubts) < 1.1
    assert np.quantile(doubts, 0.99) < 1.6


@pytest.mark.parametrize("scale", [2.0, 4.0])
def test_dives_that_end_farther_off_raise_the_doubt_to_how_much_farther(scale: float) -> None:
    rng = np.random.default_rng(1)
    doubts = [doubt_of(*(scale**2 * rng.chisquare(2, DIVES))) for _ in range(400)]
    assert 0.7 * scale < np.mean(doubts) < 1.1 * scale


def test_one_strange_dive_is_no_rule_and_two_are() -> None:
    assert doubt_of(1000.0) < 1.4
    assert doubt_of(*[2.0] * 7, 1000.0) < 1.2
    assert doubt_of(1000.0, 1000.0) == MOST_DOUBT
    assert doubt_of(*[1000.0] * 2, *[1.0] * DIVES) == 1.0


def test_what_a_fix_teaches_of_the_current_is_no_doubt_of_the_rest() -> None:
    watch = FixWatch()
    for _ in range(3):
        watch.take(100.0, 0.01)
    assert watch.doubt < 1.5
    assert watch.dives == 3


@given(st.lists(st.tuples(st.floats(0.0, 1e12), st.floats(0.0, 1.0)), max_size=20), st.floats(1, 3))
def test_the_doubt_is_bounded(seen: list[tuple[float, float]], least: float) -> None:
    watch = FixWatch(least)
    for squared, weight in seen:
        watch.take(squared, weight)
    assert least <= watch.doubt <= MOST_DOUBT


@pytest.mark.parametrize("doubt", [1.0, 1.3, 2.5])
def test_a_watch_begins_with_a_doubt_that_was_found_before_and_learns_better(doubt: float) -> None:
    watch = FixWatch()
    watch.begin_with(doubt)
    assert watch.doubt == pytest.approx(doubt)
    for _ in range(DIVES):
        watch.take(2.0)
    assert watch.doubt == pytest.approx(1.0)


def gate() -> FixGate:
    return FixGate(20.0, 3, SPEED_M_S, FIX_STD_M)


def test_a_fix_that_no_robot_could_have_reached_is_refused_however_unsure_it_is() -> None:
    it = gate()
    assert it.judge((200.0, 0.0), 0.1, 200.0, 100.0) is Verdict.REFUSED
    assert it.judge((30.0, 0.0), 0.1, 30.0, 101.0) is Verdict.BELIEVED
    assert it.refused == 1


def test_three_in_a_row_that_agree_reopen_the_question_and_scattered_ones_do_not() -> None:
    it = gate()
    for k in range(20):
        scattered = (200.0 * math.cos(k), 200.0 * math.sin(k))
        assert it.judge(scattered, 50.0, 200.0, 10.0) is Verdict.REFUSED
    verdicts = [it.judge((200.0, 100.0 + 0.5 * k), 50.0, 200.0, 10.0) for k in range(3)]
    assert verdicts == [Verdict.REFUSED, Verdict.REFUSED, Verdict.REOPENED]
    assert it.refused == 22


def test_a_good_fix_between_bad_ones_starts_the_count_anew() -> None:
    it = gate()
    for _ in range(5):
        for _ in range(2):
            assert it.judge((200.0, 0.0), 50.0, 200.0, 10.0) is Verdict.REFUSED
        assert it.judge((0.0, 0.0), 1.0, 0.0, 1.0) is Verdict.BELIEVED
