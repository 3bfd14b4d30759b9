"""Reproductions of chapter 4 and Appendix C: each runs, ends in numbers, and says what it found."""

import json
from dataclasses import replace

import numpy as np
import pytest

from reproduction import catalogue, drawing, experiment_4_5, table_4_1, table_4_2
from reproduction.catalogue import REPRODUCTIONS
from reproduction.tracking.run import Case
from reproduction.writer import document, write
from server.cli.main import main

NAMES = ("table-4.1", "table-4.2", "table-4.3", "appendix-c", "experiment-4.5")


def silent(done, doing):
    assert 0.0 <= done <= 1.0
    assert doing


@pytest.fixture(scope="module")
def table():
    """Table 4.1 with few seeds; its fit is the whole one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(table_4_1, "HELD_OUT", 20)
        patch.setattr(table_4_1, "OWN_TRIALS", 1)
        patch.setattr(table_4_1, "SLOPE_TRIALS", 10)
        patch.setattr(table_4_1, "LEVELS", (0.0065,))
        return table_4_1.reproduce(1, silent)


def cell(result, row, column):
    return next(each for each in result.rows if (each.row, each.column) == (row, column))


def sound(result):
    """Hold what is true of every reproduction."""
    names = [(row.row, row.column) for row in result.rows]
    assert len(set(names)) == len(names)
    assert all(np.isfinite(row.ours) for row in result.rows)
    read = json.loads(json.dumps(document(result), allow_nan=False))
    assert read["rows"] == document(result)["rows"]
    assert result.notes
    for panel in result.figure.panels:
        assert panel.title
        assert all(len(series.x) == len(series.y) > 0 for series in panel.series)


def test_chapter_four_is_listed(capsys):
    assert main(["reproduce", "--list"]) == 0
    listed = capsys.readouterr().out
    for name in NAMES:
        assert name in listed
        assert REPRODUCTIONS[name] in listed


def test_table_4_1_is_written_whole(table, tmp_path):
    sound(table)
    assert [file.suffix for file in write(table, tmp_path)] == [".json", ".csv", ".png"]


def test_table_4_1_has_every_cell_of_the_thesis_twice(table):
    printed = sorted(each for case in table_4_1.THESIS.values() for pair in case for each in pair)
    for seeds in ("fit", "held out"):
        cells = [row.thesis for row in table.rows if row.row.startswith(f"{seeds}: ")]
        assert sorted(each for each in cells if each is not None) == printed


def test_table_4_1_shows_what_the_text_says_of_it(table):
    def mean(quantity, case, seeds="fit"):
        return cell(table, f"{seeds}: {quantity}, mean", case.value).ours

    tracking = {case: mean("tracking error", case) for case in Case}
    assert min(tracking, key=tracking.__getitem__) is Case.SF
    assert max(tracking, key=tracking.__getitem__) is Case.OF
    condition = {case: mean("integral of inverse condition", case) for case in Case}
    ranked = sorted(condition, key=condition.__getitem__)
    assert ranked == [Case.OF, Case.SF, Case.OFETV_CBF, Case.OF_CBF, Case.SF_CBF]
    estimation = {case: mean("estimation error", case) for case in Case}
    assert estimation[Case.SF_CBF] < estimation[Case.OF_CBF] < estimation[Case.OFETV_CBF]
    assert estimation[Case.SF] > 1.5 * estimation[Case.SF_CBF]


def test_table_4_1_says_that_the_fallback_decides_with_a_steep_alpha(table):
    def lost(slope, title):
        return cell(table, f"OF+CBF lost, eps_B 0.0065, alpha = {slope:g} B", title).ours

    assert lost(1.0, "nominal fallback") >= 80.0
    assert lost(0.06, "nominal fallback") == 0.0
    assert max(lost(slope, "best effort") for slope in table_4_1.SLOPES) <= 10.0
    assert any("best effort" in note for note in table.notes)


def test_another_seed_chooses_other_held_out_runs_and_leaves_the_fit():
    columns = [table_4_1.unseen_seeds(seed) for seed in (0, 1)]
    assert not set(columns[0]) & set(columns[1])
    assert min(columns[0]) > table_4_1.TRIALS


def test_table_4_2_runs_both_scenarios_and_names_its_solvers(monkeypatch):
    few = replace(table_4_2.COARSE, duration_s=8.0)
    monkeypatch.setattr(table_4_2, "COARSE", few)
    doubtful = replace(table_4_2.DOUBTFUL, duration_s=8.0)
    monkeypatch.setattr(table_4_2, "SCENARIOS", {"A": few, "B": doubtful})
    result = table_4_2.reproduce(3, silent, trials=2)
    assert result.name == "table-4.2"
    sound(result)
    assert any("10 iterations" in note for note in result.notes)


def test_table_4_3_times_every_controller():
    result = catalogue.module_of("table-4.3").reproduce(3, silent, duration_s=4.0)
    assert result.name == "table-4.3"
    sound(result)
    assert all(row.ours >= 0.0 for row in result.rows)


def test_appendix_c_is_the_same_for_every_seed():
    results = [catalogue.reproduce("appendix-c", seed, silent) for seed in (1, 2)]
    sound(results[0])
    assert document(results[0]) == document(results[1])


def test_experiment_4_5_flies_every_controller_beside_table_4_4(monkeypatch):
    monkeypatch.setattr(experiment_4_5, "DURATION_S", 20.0)
    result = experiment_4_5.reproduce(3, silent, trials=1)
    assert result.name == "experiment-4.5"
    sound(result)
    assert {row.column for row in result.rows} >= {"O0", "O1", "O2", "O3", "CBF"}
    assert {0.65, 8.5, 17.6, 43.8} <= {row.thesis for row in result.rows}


def test_experiment_4_5_draws_no_two_controllers_alike():
    hues = [hue for _, hue in experiment_4_5.COLUMNS.values()]
    assert len({drawing.colour_of(hue) for hue in hues}) == len(hues)
