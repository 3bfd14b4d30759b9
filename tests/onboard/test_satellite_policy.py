"""When a robot calls by satellite, decided without a clock, a modem or a radio."""

import math
from itertools import pairwise

import pytest

from onboard.satellite.policy import CallLimits, CallPolicy, Situation

LIMITS = CallLimits(radio_silence_s=20.0, session_period_s=600.0, sessions_per_day=30)
POLICY = CallPolicy(LIMITS)


def at(
    time_s: float,
    surfaced_s: float,
    silent_s: float = math.inf,
    *,
    rung: bool = False,
    news: bool = False,
) -> Situation:
    return Situation(time_s, surfaced_s, silent_s, rung, news)


def test_robot_gives_the_radio_its_time_before_it_calls():
    assert not POLICY.is_due(at(100.0, 19.9))
    assert POLICY.is_due(at(100.0, 20.0))
    assert not POLICY.is_due(at(100.0, 60.0, silent_s=5.0))
    assert POLICY.is_due(at(100.0, 60.0, silent_s=20.0))


@pytest.mark.parametrize("why", [{"rung": True}, {"news": True}, {}])
def test_nobody_calls_under_water(why):
    assert not POLICY.is_due(at(100.0, 0.0, **why))
    assert not POLICY.is_awaited(at(100.0, 0.0, **why))


def test_ring_and_news_make_it_call_at_once_even_while_radio_is_live():
    assert POLICY.is_due(at(100.0, 0.1, silent_s=0.0, rung=True))
    assert POLICY.is_due(at(100.0, 0.1, silent_s=0.0, news=True))
    assert not POLICY.is_due(at(100.0, 0.1, silent_s=0.0))


def test_robot_that_stays_up_calls_once_a_period_and_once_after_each_dive():
    called = POLICY.called(at(120.0, 20.0), is_sent=True)
    assert not called.is_due(at(300.0, 200.0))
    assert called.is_due(at(720.0, 620.0))
    assert called.is_due(at(300.0, 30.0))


def test_failed_call_is_tried_again_after_a_growing_wait_and_at_once_after_coming_up():
    failed = POLICY.called(at(100.0, 50.0), is_sent=False)
    assert not failed.is_due(at(129.0, 79.0))
    assert failed.is_due(at(130.0, 80.0))
    twice = failed.called(at(130.0, 80.0), is_sent=False)
    assert not twice.is_due(at(189.0, 139.0, rung=True))
    assert twice.is_due(at(190.0, 140.0))
    assert twice.is_due(at(189.0, 25.0))
    for _ in range(20):
        twice = twice.called(at(130.0, 80.0), is_sent=False)
    assert not twice.is_due(at(130.0 + 479.0, 559.0))
    assert twice.is_due(at(130.0 + 480.0, 560.0))
    assert twice.called(at(700.0, 650.0), is_sent=True).failures == 0


def test_robot_stays_up_for_its_call_but_not_for_one_that_keeps_failing():
    assert POLICY.is_awaited(at(100.0, 5.0))
    assert not POLICY.is_awaited(at(100.0, 5.0, silent_s=1.0))
    assert POLICY.is_awaited(at(100.0, 5.0, silent_s=1.0, rung=True))
    assert not POLICY.called(at(95.0, 15.0), is_sent=True).is_awaited(at(100.0, 20.0))
    failing = POLICY.called(at(80.0, 40.0), is_sent=False)
    assert failing.is_awaited(at(100.0, 60.0))
    assert not failing.called(at(95.0, 55.0), is_sent=False).is_awaited(at(100.0, 60.0))


def test_robot_that_comes_up_again_stays_for_its_call_whatever_failed_before():
    failing = POLICY
    for time_s in (80.0, 110.0, 170.0):
        failing = failing.called(at(time_s, 100.0), is_sent=False)
    assert not failing.is_awaited(at(180.0, 110.0))
    assert failing.is_awaited(at(500.0, 5.0))
    once = failing.called(at(520.0, 25.0), is_sent=False)
    assert once.is_awaited(at(521.0, 26.0))
    assert once.is_due(at(550.0, 55.0))


def test_day_has_no_more_sessions_than_allowed_and_one_an_hour_on_top():
    policy, sessions, time_s = POLICY, [], 0.0
    while time_s < 3 * 86_400.0:
        now = at(time_s, 1e6 + time_s, rung=True, news=True)
        if policy.is_due(now):
            assert policy.is_awaited(now)
            policy = policy.held(time_s).called(now, is_sent=True)
            sessions.append(time_s)
        time_s += 60.0
    for begin in range(0, 2 * 86_400, 1800):
        assert sum(begin <= one < begin + 86_400 for one in sessions) <= 30 + 24
    hours = [b - a for a, b in pairwise(sessions)]
    assert max(hours) <= 3660.0, "it goes on calling"


def test_robot_whose_sessions_are_spent_does_not_stay_up_for_a_call():
    spent = POLICY
    for number in range(30):
        spent = spent.held(float(number))
    assert spent.is_spent(100.0)
    now = at(100.0, 100.0, rung=True)
    assert not spent.is_due(now)
    assert not spent.is_awaited(now)
    assert spent.is_due(at(29.0 + 3600.0, 4000.0, rung=True))
    assert not spent.is_spent(90_000.0)
