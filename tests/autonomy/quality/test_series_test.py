"""Tests of series: laws, exact times, speed, and the field's own implementation as oracle."""

import math
import time

import numpy as np
import pytest
from pydantic import ValidationError

from autonomy.quality import series_test
from autonomy.quality.flag import FAIL, GOOD, MISSING, SUSPECT, UNKNOWN, og1_flags, worst
from autonomy.quality.judgement import judge_series, stretches
from autonomy.quality.rules import GRACE_QARTOD, KEPT, QualityRules, SeriesRule
from autonomy.quality.series_test import flat_line, gross_range, rate_of_change, speed, spike

LIMITS_S = 1.0
"""Of a test of a million values."""


def array(*values):
    return np.array(values, dtype=np.float64)


def test_range_keeps_its_ends_and_what_is_missing():
    flags = gross_range(array(-3, -2, 0, 5, 6, np.nan), (-2.0, 5.0), (-2.5, 6.0))
    assert flags.tolist() == [FAIL, GOOD, GOOD, GOOD, SUSPECT, MISSING]


def test_a_spike_is_held_against_both_neighbours_and_ends_are_not_evaluated():
    flags = spike(array(1, 1, 4, 1, 1, np.nan, 1, 1, 1), 2.0, 6.0)
    assert flags.tolist() == [
        UNKNOWN, GOOD, SUSPECT, GOOD, UNKNOWN, MISSING, UNKNOWN, GOOD, UNKNOWN,
    ]  # fmt: skip


def test_a_rate_uses_exact_times():
    """Cut to whole seconds, 1.9 s would count as 1 s and every value be suspect."""
    times_s = np.arange(100) * 1.9
    values = 0.158 * times_s
    assert set(rate_of_change(values, times_s, 0.2).tolist()) == {GOOD}
    assert rate_of_change(values, times_s, 0.157).tolist() == [GOOD] + 99 * [SUSPECT]


def test_a_flat_line_needs_its_whole_time_at_any_rate():
    for period_s in (0.2, 1.0, 7.3):
        times_s = np.arange(2000) * period_s
        flags = flat_line(np.full(2000, 3.0), times_s, 100.0, 150.0, 0.001)
        assert flags.tolist() == [
            FAIL if at >= 150.0 else SUSPECT if at >= 100.0 else GOOD for at in times_s.tolist()
        ]


@pytest.mark.parametrize("at_once", [1, 7, 65_536])
def test_a_flat_line_is_as_a_slow_reading_of_its_words_finds_it(monkeypatch, at_once):
    monkeypatch.setattr(series_test, "_WINDOWS_AT_ONCE", at_once)
    rng = np.random.default_rng(4)
    times_s = np.cumsum(rng.uniform(0.1, 3.0, 700))
    values = np.round(np.cumsum(rng.normal(0, 0.1, 700)), 1)
    values[rng.random(700) < 0.1] = np.nan
    found = flat_line(values, times_s, 8.0, None, 0.15)
    for i in range(700):
        window = values[(times_s >= times_s[i] - 8.0) & (np.arange(700) <= i)]
        is_flat = (
            times_s[i] - times_s[0] >= 8.0
            and np.nanmax(window, initial=-np.inf) - np.nanmin(window, initial=np.inf) < 0.15
        )
        expected = MISSING if np.isnan(values[i]) else SUSPECT if is_flat else GOOD
        assert found[i] == expected, i


def test_a_jump_at_a_fix_is_the_dead_reckonings_fault():
    place = array(0, 1, 2, 40, 41, 42)[:, None]
    times_s = np.arange(6) * 1.5
    no_fix = np.zeros(6, dtype=bool)
    jumped = speed(place, times_s, no_fix, 1.0, 3.0)
    assert jumped.tolist() == [GOOD, GOOD, GOOD, FAIL, GOOD, GOOD]
    fix = np.arange(6) == 3
    assert speed(place, times_s, fix, 1.0, 3.0).tolist() == [GOOD, GOOD, SUSPECT, GOOD, GOOD, GOOD]


def test_flags_of_a_file_say_what_nobody_evaluated():
    flags = np.array([GOOD, UNKNOWN, SUSPECT, FAIL, MISSING], dtype=np.int8)
    assert og1_flags(flags).tolist() == [1, 0, 3, 4, -127]
    other = np.array([SUSPECT, GOOD, GOOD, UNKNOWN, MISSING], dtype=np.int8)
    assert worst([flags, other], 5).tolist() == [SUSPECT, GOOD, SUSPECT, FAIL, MISSING]
    assert worst([], 2).tolist() == [MISSING, MISSING]


def test_stretches_tell_all_that_is_not_good_and_why():
    values = array(1, 1, 9, 1, 1, 50, 51, 1, 1)
    rule = SeriesRule(fail_high=40.0, spike_suspect=2.0)
    found = judge_series(values, np.arange(9.0), rule)
    told = stretches(found)
    rebuilt = np.full(9, GOOD)
    for one in told:
        rebuilt[one.first : one.last + 1] = one.flag
    assert rebuilt.tolist() == found.flags.tolist()
    assert next(one for one in told if one.flag == FAIL).tests == ("range",)
    assert next(one.tests for one in told if one.flag == SUSPECT) == ("spike",)
    assert found.counts["all"]["fail"] == 2


def test_a_channel_without_rules_fails_outside_of_what_the_catalogue_believes():
    rules = QualityRules().with_ranges({"ph": (0.0, 10.0)})
    found = judge_series(array(0, 5, 11), np.arange(3.0), rules.series["ph"])
    assert found.flags.tolist() == [GOOD, GOOD, FAIL]
    assert found.by_test.keys() == {"range"}


def test_the_hash_names_the_ranges_that_are_applied():
    rules = QualityRules(series={"ph": SeriesRule(fail_low=2.0, spike_fail=1.0)})
    one = rules.with_ranges({"ph": (0.0, 10.0), "salinity": (0.0, math.inf)})
    assert one.series["ph"] == SeriesRule(fail_low=2.0, fail_high=10.0, spike_fail=1.0)
    assert one.series["salinity"] == SeriesRule(fail_low=0.0)
    other = rules.with_ranges({"ph": (0.0, 9.0), "salinity": (0.0, math.inf)})
    assert len({rules.sha256, one.sha256, other.sha256}) == 3
    assert one.with_ranges({"ph": (3.0, 4.0)}) == one, "what was frozen stays"


@pytest.mark.parametrize(
    ("limits", "field", "words"),
    [
        ({"fail_low": 5.0, "fail_high": 4.0}, "fail_high", "must be above fail_low 5; is 4"),
        ({"suspect_low": 5.0, "suspect_high": 5.0}, "suspect_high", "must be above suspect_low 5"),
        ({"fail_low": 0.0, "suspect_low": -1.0}, "suspect_low", "must not be below fail_low 0"),
        ({"fail_high": 9.0, "suspect_high": 9.5}, "suspect_high", "must not be above fail_high 9"),
        ({"fail_high": 9.0, "suspect_low": 9.5}, "suspect_low", "must not be above fail_high 9"),
        ({"spike_suspect": 3.0, "spike_fail": 2.0}, "spike_fail", "not be below spike_suspect 3"),
        ({"flat_suspect_s": 9.0, "flat_fail_s": 1.0}, "flat_fail_s", "not be below flat_suspect_s"),
    ],
)
def test_limits_that_contradict_each_other_name_the_field(limits, field, words):
    document = {"series": {"ph": limits}}
    with pytest.raises(ValidationError, match=words) as refused:
        QualityRules.model_validate(document)
    assert [one["loc"] for one in refused.value.errors()] == [("series", "ph", field)]
    kept = QualityRules.model_validate(document, context=KEPT)
    assert kept.series["ph"].model_dump(exclude_unset=True) == limits


def test_speeds_that_contradict_each_other_name_the_field():
    with pytest.raises(ValidationError, match="must not be below speed_suspect_m_s 2") as refused:
        QualityRules.model_validate({"position": {"speed_suspect_m_s": 2.0, "speed_fail_m_s": 1.0}})
    assert [one["loc"] for one in refused.value.errors()] == [("position", "speed_fail_m_s")]


@pytest.mark.parametrize("size", [0, 1, 2])
def test_a_series_of_hardly_any_values_is_judged(size):
    rule = GRACE_QARTOD.series["temperature"]
    found = judge_series(np.full(size, 5.0), np.arange(float(size)), rule)
    assert found.flags.tolist() == [GOOD] * size
    assert len(stretches(found)) == 0


def test_a_million_values_take_less_than_a_second_a_test():
    rng = np.random.default_rng(1)
    times_s = np.cumsum(rng.uniform(0.5, 1.5, 1_000_000))
    values = np.cumsum(rng.normal(0, 0.001, 1_000_000))
    north_east = np.column_stack([values, values])
    no_fix = np.zeros(1_000_000, dtype=bool)
    tests = {
        "range": lambda: gross_range(values, (-2.0, 35.0), (-2.5, 40.0)),
        "spike": lambda: spike(values, 2.0, 6.0),
        "rate": lambda: rate_of_change(values, times_s, 0.2),
        "flat": lambda: flat_line(values, times_s, 1800.0, 3600.0, 0.001),
        "speed": lambda: speed(north_east, times_s, no_fix, 1.0, 3.0),
    }
    for name, test in tests.items():
        # a busy neighbour takes none of the processor's time that is counted here
        begun = time.thread_time()
        test()
        assert time.thread_time() - begun <= LIMITS_S, name
