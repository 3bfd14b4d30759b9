"""Limits with hysteresis and delays: nothing chatters, nothing is early, nothing is missed."""

import math
from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from autonomy.channel import CHANNELS
from server.alarm.course import CompiledRule, Course, Look, Told
from server.alarm.judging import NORMAL, Band, Standing, advance
from server.alarm.rule import AlarmRule, RuleLimit
from server.alarm.value import Found

T0 = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
LIMITS = (RuleLimit(level="critical", high=20.0), RuleLimit(level="warning", high=10.0))


def band(**changes):
    rule = AlarmRule(key="a", title="A", reads="leak", limits=LIMITS, text="x", **changes)
    return Band.of(rule, rule.limits)


def at(second):
    return T0 + timedelta(seconds=second)


def ranks(band, values):
    """Return the rank after each value, one a second."""
    standing, found = Standing(), []
    for second, value in enumerate(values):
        standing, _ = advance(band, standing, value, at(second))
        found.append(standing.rank)
    return found


def test_the_gravest_limit_counts_and_hysteresis_holds_it():
    assert ranks(band(hysteresis=2.0), [5, 11, 21, 19, 17, 9, 7]) == [-1, 0, 1, 1, 0, 0, -1]


def test_a_delay_lets_no_short_peak_through():
    assert ranks(band(delay_s=3.0), [11, 11, 9, 11, 11, 11, 11]) == [-1] * 6 + [0]
    assert ranks(band(clear_after_s=2.0), [11, 9, 11, 9, 9, 9]) == [0, 0, 0, 0, 0, -1]


def test_a_graver_value_does_not_begin_the_delay_anew():
    assert ranks(band(delay_s=3.0), [11, 11, 21, 21]) == [-1, -1, -1, 1]


def test_what_nobody_knows_changes_nothing_and_ends_a_delay():
    assert ranks(band(), [11, math.nan, math.nan]) == [0, 0, 0]
    assert ranks(band(delay_s=2.0), [11, 11, math.nan, 11, 11, 11]) == [-1] * 5 + [0]


def test_the_end_of_a_delay_is_told():
    standing, due = advance(band(delay_s=5.0), Standing(), 11.0, T0)
    assert (standing.rank, due) == (NORMAL, at(5))
    assert advance(band(delay_s=5.0), standing, 11.0, at(5))[0].rank == 0


@given(
    st.lists(st.floats(-1.0, 1.0), max_size=40),
    st.floats(2.01, 5.0),
    st.sampled_from([10.0, 20.0]),
)
def test_noise_within_the_hysteresis_never_chatters(noise, hysteresis, around):
    """However a value trembles about a limit, its rank changes at most once, and upwards."""
    found = ranks(band(hysteresis=hysteresis), [around + one for one in noise])
    assert found == sorted(found)


@given(
    st.lists(st.floats(0.0, 30.0), max_size=40),
    st.integers(0, 5), st.integers(0, 5), st.floats(0.0, 4.0),
)  # fmt: skip
def test_a_rank_is_held_only_by_values_that_lasted(values, delay_s, clear_s, hysteresis):
    judged = band(delay_s=delay_s, clear_after_s=clear_s, hysteresis=hysteresis)
    found = ranks(judged, values)
    before = NORMAL
    for second, rank in enumerate(found):
        if rank > before:
            lasted = values[max(0, second - delay_s) : second + 1]
            assert len(lasted) == delay_s + 1
            assert all(value > 10.0 - hysteresis for value in lasted)
        if rank < before:
            assert second >= clear_s
            end = judged.limits[before].high - hysteresis
            assert all(value <= end for value in values[second - clear_s : second + 1])
        before = rank


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"limits": ()}, "needs one limit"),
        ({"limits": (LIMITS[0], LIMITS[0])}, "each level may have one limit"),
        ({"reads": ""}, "must watch something"),
        ({"text": "{robot.__class__}"}, "stands for nothing"),
        ({"text": "a\u202eb"}, "cannot be seen"),
        ({"kind": "catalogue"}, "has those of the catalogue"),
        ({"kind": "expression", "expression": "1 > 2"}, "reads nothing"),
        ({"kind": "expression", "expression": "leak ** 2"}, "expression: holds"),
        ({"delay_s": math.inf}, "finite"),
        ({"modes": ("flying",)}, "'idle'"),
        ({"surprise": 1}, "Extra inputs"),
        ({"key": "../x"}, "pattern"),
    ],
)
def test_a_rule_that_cannot_be_is_refused_in_words(changes, words):
    fields = {"key": "a", "title": "A", "reads": "leak", "limits": LIMITS, "text": "x"}
    with pytest.raises(ValidationError, match=words):
        AlarmRule(**{**fields, **changes})


def course(**changes):
    fields = {"key": "a", "title": "A", "text": "{title} {value} {side} {limit} {detail}"}
    return Course(CompiledRule(AlarmRule(**fields, **changes), CHANNELS))


def look(second, station=None, **values):
    told = {key: Told(*pair) for key, pair in values.items()}
    return Look("mini-1", at(second), told, (station or {}).get)


def test_a_rate_is_taken_over_its_window_by_the_robots_own_clock():
    """A clock that is off by an hour changes no rate: only differences of it count."""
    limits = (RuleLimit(level="warning", high=5.0),)
    rising = course(kind="rate", reads="internal_pressure", limits=limits, window_s=60.0)
    texts = []
    for second in range(0, 200, 10):
        measured = at(second) + timedelta(hours=1)
        found = rising.look(look(second, internal_pressure=(0.1 * second, measured, at(second))))
        texts.append(found.text if found else None)
    assert texts[:3] == [None] * 3, "less than half of the window is known"
    assert texts[-1] == "Internal pressure 6 hPa/min above 5 hPa/min "


def test_absence_is_due_when_a_value_is_too_old_and_ends_with_the_next():
    limits = (RuleLimit(level="watch", high=30.0),)
    absent = course(kind="absence", reads="leak", limits=limits)
    assert absent.look(look(0)) is None, "it never had the instrument"
    far_off = at(0) - timedelta(days=3)
    assert absent.look(look(0, leak=(0.0, far_off, at(0)))) is None
    assert absent.due == at(30)
    assert absent.look(look(30, leak=(0.0, far_off, at(0)))).level == "watch"
    assert absent.look(look(40, leak=(0.0, far_off, at(39)))) is None


def test_an_expression_joins_channels_with_values_of_the_station():
    joined = course(
        kind="expression",
        expression="internal_pressure > 1000 and silence > 20",
        limits=(RuleLimit(level="severe", high=0.5),),
    )
    silent = {"silence": Found(since=at(0))}
    high = (1100.0, at(0), at(0))
    assert joined.look(look(10, silent, internal_pressure=high)) is None
    assert joined.due is not None, "time alone may change it"
    assert joined.look(look(30, silent, internal_pressure=high)).level == "severe"
    assert joined.look(look(31, internal_pressure=high)) is None


def test_a_sentence_keeps_the_value_that_crossed_its_limit():
    high = course(reads="internal_pressure", limits=(RuleLimit(level="watch", high=1000.0),))
    first = high.look(look(0, internal_pressure=(1100.0, at(0), at(0))))
    assert first.text == "Internal pressure 1100 hPa above 1000 hPa "
    assert high.look(look(1, internal_pressure=(1300.0, at(1), at(1)))) is first


@pytest.mark.parametrize(
    ("expression", "is_raised"),
    [("nearest_robot < 50", False), ("battery < 20", False), ("overdue < 5 and adrift < 1", True)],
)
def test_a_quantity_that_does_not_apply_is_unknown_while_a_state_is_normal(expression, is_raised):
    limits = (RuleLimit(level="warning", high=0.5),)
    rule = AlarmRule(
        key="a", title="A", kind="expression", expression=expression, limits=limits, text="x"
    )
    assert (Course(CompiledRule(rule, CHANNELS)).look(look(0)) is not None) is is_raised


def test_what_does_not_apply_raises_nothing_where_limits_of_two_levels_cross():
    limits = (RuleLimit(level="watch", high=5.0), RuleLimit(level="warning", low=20.0))
    rule = AlarmRule(key="a", title="A", reads="battery", limits=limits, text="x")
    assert Course(CompiledRule(rule, CHANNELS)).look(look(0)) is None
