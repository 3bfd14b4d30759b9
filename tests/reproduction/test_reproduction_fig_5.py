"""Thesis Figures 5.7 and 5.9 worked out small: files, rows beside the thesis, progress, seeds."""

import csv
import json

import numpy as np
import pytest

from reproduction import fig_5_7, fig_5_9
from reproduction.fig_5_surveys import Sweep
from reproduction.writer import write

SMALL = Sweep(drifts_m_sqrt_s=(0.01, 0.03), trials=1, iterations=20)
ONE_DRIFT = Sweep(drifts_m_sqrt_s=(0.03,), trials=1, iterations=20)
SEED = 3


def silent(share, doing):
    pass


@pytest.fixture(scope="module")
def scenarios():
    """Figure 5.7 of two drifts, and what it told while it worked."""
    told = []
    result = fig_5_7.reproduce(SEED, lambda share, doing: told.append((share, doing)), SMALL)
    return result, told


@pytest.fixture(scope="module")
def models():
    return fig_5_9.reproduce(SEED, silent, SMALL)


def ours(result, row, column):
    (value,) = [r.ours for r in result.rows if (r.row, r.column) == (row, column)]
    return value


def test_progress_rises_to_the_end_and_names_what_is_done(scenarios):
    shares = [share for share, _ in scenarios[1]]
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    assert shares[-1] == pytest.approx(1.0)
    assert scenarios[1][-1][1] == "survey 8 of 8"


def test_every_scenario_stands_beside_the_number_that_the_thesis_prints(scenarios):
    printed = {r.column: r.thesis for r in scenarios[0].rows if r.row == "drift 0.03: WMSE, mean"}
    assert printed == {"MFE": 0.3879, "MFIG": 0.4556, "SFE": 2.8812, "SFIG": 3.7766}
    others = [r.thesis for r in scenarios[0].rows if "WMSE, mean" not in r.row]
    assert others == [None] * len(others)
    assert len(scenarios[0].rows) == 2 * 2 * 4 * 4


def test_single_fidelity_has_the_greater_weighted_error(scenarios):
    for drift in ("0.01", "0.03"):
        row = f"drift {drift}: WMSE, mean"
        multi = np.mean([ours(scenarios[0], row, key) for key in ("MFE", "MFIG")])
        single = np.mean([ours(scenarios[0], row, key) for key in ("SFE", "SFIG")])
        assert single > 1.5 * multi
    assert "by drift" in scenarios[0].notes[0]


def test_both_figures_see_the_same_surveys(scenarios, models):
    for drift in ("0.01", "0.03"):
        row = f"drift {drift}: RMSE, mean"
        spread = f"drift {drift}: RMSE, s.d."
        assert {r.column for r in models.rows if r.row == row} == set(fig_5_9.COLUMNS)
        single = [ours(scenarios[0], row, key) for key in ("SFE", "SFIG")]
        mean, deviation = ours(models, row, "single"), ours(models, spread, "single")
        # Two of the four surveys behind the mean are the single scenarios' own.
        assert abs(np.mean(single) - mean) <= deviation + 1e-6


def test_the_same_seed_gives_the_same_numbers(models):
    again = fig_5_9.reproduce(SEED, silent, ONE_DRIFT)
    assert again.rows == tuple(row for row in models.rows if "drift 0.03" in row.row)


@pytest.mark.parametrize("figure", ["scenarios", "models"])
def test_the_figure_is_written_with_its_scenario(figure, request, tmp_path):
    result = request.getfixturevalue(figure)
    result = result[0] if isinstance(result, tuple) else result
    files = write(result, tmp_path)
    assert [file.suffix for file in files] == [".json", ".csv", ".png"]
    read = json.loads(files[0].read_text())
    assert read["scenario"]["seed"] == SEED
    assert read["scenario"]["drifts_m_sqrt_s"] == [0.01, 0.03]
    with files[1].open(newline="") as opened:
        lines = list(csv.reader(opened))
    assert lines[0] == ["row", "column", "ours", "thesis", "unit"]
    assert len(lines) == 1 + len(result.rows)
    assert files[2].read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
