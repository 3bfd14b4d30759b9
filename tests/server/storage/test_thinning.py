import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from db.query.storage.thinning import kept_rows

HOUR_S = 3600


@st.composite
def series(draw):
    """Rows of up to three hours, at moments a second or less apart or with gaps between them."""
    gaps_ms = draw(st.lists(st.integers(50, 400_000), min_size=1, max_size=80))
    start_ms = draw(st.integers(0, 10**12))
    at_us = 1000 * (start_ms + np.cumsum(gaps_ms))
    size = len(gaps_ms)
    value = draw(
        st.lists(st.floats(-100.0, 100.0) | st.just(float("nan")), min_size=size, max_size=size)
    )
    marks = draw(st.lists(st.integers(0, 1), min_size=size, max_size=size))
    return at_us, np.array(value), np.array(marks).reshape(-1, 1)


PERIODS = st.integers(1, HOUR_S)


@given(series(), PERIODS)
def test_first_last_and_extremes_of_every_five_minutes_stay(rows, period_s):
    at_us, value, marks = rows
    kept = kept_rows(at_us, value, period_s, marks)
    assert kept[0]
    assert kept[-1]
    stretch = at_us // (300 * 10**6)
    for one in np.unique(stretch):
        of = stretch == one
        if not np.all(np.isnan(value[of])):
            assert np.nanmin(value[of & kept]) == np.nanmin(value[of])
            assert np.nanmax(value[of & kept]) == np.nanmax(value[of])


@given(series(), PERIODS)
def test_rows_on_either_side_of_a_surfacing_stay(rows, period_s):
    at_us, value, marks = rows
    kept = kept_rows(at_us, value, period_s, marks)
    change = np.flatnonzero(marks[1:, 0] != marks[:-1, 0])
    assert np.all(kept[change])
    assert np.all(kept[change + 1])


@given(series(), PERIODS)
def test_every_period_that_had_a_row_has_one(rows, period_s):
    at_us, value, marks = rows
    kept = kept_rows(at_us, value, period_s, marks)
    hour_us = HOUR_S * 10**6
    period = at_us // hour_us * HOUR_S + at_us % hour_us // (period_s * 10**6)
    assert set(period[kept]) == set(period)


@given(series(), PERIODS)
def test_thinned_once_more_nothing_goes(rows, period_s):
    at_us, value, marks = rows
    kept = kept_rows(at_us, value, period_s, marks)
    assert np.all(kept_rows(at_us[kept], value[kept], period_s, marks[kept]))


@given(series(), PERIODS, st.integers(0, 2**32 - 1))
def test_a_pass_that_was_cut_off_ends_the_same(rows, period_s, seed):
    at_us, value, marks = rows
    kept = kept_rows(at_us, value, period_s, marks)
    left = kept | (np.random.default_rng(seed).random(len(kept)) < 0.5)
    again = kept_rows(at_us[left], value[left], period_s, marks[left])
    assert np.array_equal(np.flatnonzero(left)[again], np.flatnonzero(kept))


def test_ten_hertz_become_few():
    at_us = np.arange(36_000) * 100_000
    value = np.sin(at_us / 5e7)
    kept = kept_rows(at_us, value, 10)
    assert 360 <= kept.sum() <= 360 + 2 * 12 + 1
