"""Flags as those of ioos_qc, the field's own implementation, where both mean the same.

It cuts times to whole seconds and wants regular steps, so the glider's rows are given such times.
"""

import csv
from pathlib import Path

import numpy as np
import pytest

from autonomy.quality.rules import GRACE_QARTOD
from autonomy.quality.series_test import flat_line, gross_range, rate_of_change, speed, spike

FILE = Path(__file__).parents[4] / "shared" / "data" / "eva035_chl_temp.csv"
PERIOD_S = 30


def glider():
    if not FILE.exists():
        pytest.skip(f"{FILE.name} is not at hand")
    with FILE.open() as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def faulty(values):
    """Return a copy with a spike, missing values, a flat stretch and one out of range."""
    changed = values.copy()
    changed[1000] += 9.0
    changed[1500:1530] = np.nan
    changed[2000:2200] = changed[2000]
    changed[4000] = 400.0
    return changed


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("change", [np.copy, faulty])
@pytest.mark.parametrize("key", ["temperature", "chlorophyll"])
def test_every_flag_is_the_oracles(key, change):
    qartod = pytest.importorskip("ioos_qc.qartod", reason="ioos_qc is not installed")
    values, rule = change(glider()[key]), GRACE_QARTOD.series[key]
    times_s = 1_500_000_000.0 + PERIOD_S * np.arange(values.size, dtype=np.float64)
    fail, suspect = (rule.fail_low, rule.fail_high), (rule.suspect_low, rule.suspect_high)
    ours = {
        "range": gross_range(values, suspect, fail),
        "spike": spike(values, rule.spike_suspect, rule.spike_fail),
        "rate": rate_of_change(values, times_s, 0.01),
        "flat": flat_line(
            values, times_s, rule.flat_suspect_s, rule.flat_fail_s, rule.flat_tolerance
        ),
    }
    theirs = {
        "range": qartod.gross_range_test(values, fail, suspect),
        "spike": qartod.spike_test(values, rule.spike_suspect, rule.spike_fail),
        "rate": qartod.rate_of_change_test(values, times_s, 0.01),
        "flat": qartod.flat_line_test(
            values, times_s, int(rule.flat_suspect_s), int(rule.flat_fail_s), rule.flat_tolerance
        ),
    }
    for test, flags in theirs.items():
        assert ours[test].tolist() == np.ma.getdata(flags).astype(int).tolist(), test


def test_the_gliders_positions_jump_three_times():
    """Rows 1785, 5041 and 5042 of the file: 4.30, 1.29 and 1.62 m/s at fixes (spec of the data)."""
    rows = glider()
    latitude = np.radians(rows["latitude"])
    north_east = 6_371_000.0 * np.column_stack(
        [latitude, np.radians(rows["longitude"]) * np.cos(latitude.mean())]
    )
    no_fix = np.zeros(len(latitude), dtype=bool)
    flags = speed(north_east, rows["time"], no_fix, 1.0, 3.0)
    lines = {int(row) + 2: int(flags[row]) for row in np.flatnonzero(flags != 1)}
    assert sorted(lines) == [1785, 5041, 5042]
    assert sorted(lines.values()) == [3, 3, 4]


@pytest.mark.parametrize(
    ("key", "good", "suspect"), [("temperature", 5044, 0), ("chlorophyll", 5041, 3)]
)
def test_the_delivered_rules_find_what_the_glider_file_is_known_for(key, good, suspect):
    from autonomy.quality.judgement import judge_series

    rows = glider()
    found = judge_series(rows[key], rows["time"], GRACE_QARTOD.series[key])
    counts = found.counts["all"]
    assert (counts["good"], counts["suspect"], counts["fail"]) == (good, suspect, 0)
