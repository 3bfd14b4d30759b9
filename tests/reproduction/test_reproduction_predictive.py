"""Tables 4.2 and 4.3: every cell beside the thesis's, verdicts that follow from the runs."""

import json
import re

import numpy as np
import pytest

from reproduction import table_4_2, table_4_3
from reproduction.drawing import png
from reproduction.rival import (
    BARRIER,
    COARSE,
    HUES,
    OBJECTIVES,
    run_column,
    slsqp,
    steered_by,
)
from reproduction.table_4_2 import INDEPENDENT, KAPPA, TAU, THESIS, Trials
from reproduction.writer import document


def silent(done, doing):
    assert 0.0 <= done <= 1.0
    assert doing


@pytest.fixture(scope="module")
def table():
    return table_4_2.reproduce(0, silent, trials=2)


@pytest.fixture(scope="module")
def times():
    return table_4_3.reproduce(0, silent, duration_s=6.0)


def cell(result, row, column):
    return next(each for each in result.rows if (each.row, each.column) == (row, column))


def test_table_4_2_has_every_cell_of_the_thesis_beside_ours(table):
    for setting in ("A", "B"):
        of_setting = [each for each in table.rows if each.row.startswith(f"{setting}: ")]
        printed = sorted(each.thesis for each in of_setting if each.thesis is not None)
        assert printed == sorted(np.array(THESIS).ravel())
    of_text = cell(table, "A: inverse condition, summed, mean", "O3")
    assert (of_text.thesis, of_text.unit) == (239.2, "s")


def test_table_4_2_agrees_with_another_program_where_the_runs_are_not_chaotic(table):
    columns = list(HUES)
    for setting, (kappa, tau, condition) in INDEPENDENT.items():
        for column in ("O1", "O3", BARRIER):
            j = columns.index(column)
            for quantity, wanted in (
                ("estimation error", kappa[j]),
                ("tracking error", tau[j]),
                ("inverse condition, summed", condition[j]),
            ):
                ours = cell(table, f"{setting}: {quantity}, mean", column).ours
                assert ours == pytest.approx(wanted, rel=0.1), (setting, column, quantity)


def test_table_4_2_names_solver_and_limit_and_what_is_not_reproduced(table):
    assert table.scenario["seeds"] == [0, 1]
    assert table.scenario["iterations at most"] == 10
    assert "BFGS" in table.scenario["solver"]
    notes = " ".join(table.notes)
    for words in (
        "at most 10 iterations",
        "Not reproduced in A",
        "O0 tracking error",
        "not its own",
    ):
        assert words in notes
    assert "Confirmed: of the predictive controllers, the condition number tracks closest" in notes


def test_table_4_2_shows_what_another_solver_changes(table):
    rows = {
        solver: cell(table, f"A, seed 0, {solver} iterations: tracking error", "O3").ours
        for solver in ("ours 10", "ours 100", "SLSQP 10")
    }
    assert len(set(rows.values())) == 3
    assert all(0.5 < tau < 1.2 for tau in rows.values())


def made_up(means):
    """Trials in which every run has its column's mean, and O0 alone is lost."""
    scores = np.repeat(np.array(means, dtype=float).T[:, None, :], 2, axis=1)
    lost = np.zeros((len(HUES), 2))
    lost[0] = 1.0
    return Trials(scores, lost, {})


def test_verdicts_of_table_4_2_follow_the_numbers():
    thesis = made_up([mean for mean, _ in THESIS])
    claims = table_4_2._claims({"A": thesis, "B": thesis})
    assert [claim.startswith("Confirmed") for claim in claims] == [True, True, True, False]
    assert "100 % of its trials are lost in A" in claims[3]
    assert table_4_2._missed("A", thesis.mean()).endswith("off: nothing.")
    means = np.array([mean for mean, _ in THESIS])
    means[TAU, 3], means[KAPPA, 4] = 9.0, 9.0
    spoilt = made_up(means)
    claims = table_4_2._claims({"A": spoilt, "B": thesis})
    assert [claim.startswith("Confirmed") for claim in claims] == [True, False, False, False]
    missed = table_4_2._missed("A", spoilt.mean())
    assert "O3 tracking error 9 (thesis 0.61) m" in missed
    assert "CBF estimation error 9 (thesis 0.08) m" in missed
    assert missed.count("thesis") == 2


def test_another_solver_keeps_to_the_box_and_warms_its_plan():
    scenario = steered_by("O2", COARSE)
    controller = slsqp(scenario)
    turn, faster = controller.command(np.array([-2.0, 0.5, 0.2, 0.2]), (0.0, 0.0), 0.01 * np.eye(4))
    assert abs(turn) <= np.pi / 4.0
    assert abs(faster) <= 0.01
    assert np.abs(controller.plan).max() > 0.1


def test_table_4_3_has_the_thesis_times_and_ratios(times):
    warm = "time of a step: from the plan before, mean"
    assert [cell(times, warm, each).thesis for each in HUES] == [36.0, 182.0, 51.0, 51.0, 3.0]
    for column, thesis in zip(OBJECTIVES, (12.0, 182.0 / 3.0, 17.0, 17.0), strict=True):
        ratio = cell(times, "step / barrier step: from a plan of zeros", column)
        assert ratio.thesis == pytest.approx(thesis)
        assert ratio.ours > 0.0
        assert cell(times, "iterations of a step: from a plan of zeros, mean", column).ours >= 1.0
    assert all(np.isfinite(each.ours) for each in times.rows)


def test_table_4_3_counts_the_same_iterations_again(times):
    again = table_4_3.reproduce(0, silent, duration_s=6.0)
    for row in times.rows:
        if row.row.startswith("iterations"):
            assert cell(again, row.row, row.column).ours == row.ours


def test_verdicts_of_table_4_3_are_those_of_its_ratios(times):
    verdicts = [note for note in times.notes if "order of magnitude" in note]
    assert len(verdicts) == 3
    for note in verdicts:
        way = re.search(r"onfirmed (.*): the barrier", note).group(1)
        least = min(
            cell(times, f"step / barrier step: {way}", column).ours for column in OBJECTIVES
        )
        assert note.startswith("Confirmed") == (least >= 10.0)


def test_both_tables_can_be_written_and_drawn(table, times):
    for result in (table, times):
        assert json.dumps(document(result), allow_nan=False)
        assert png(result).startswith(b"\x89PNG")


def test_barrier_column_is_the_compiled_loops():
    outcome = run_column(BARRIER, COARSE, 0)
    assert not outcome.score.is_lost
    assert outcome.score.tracking_error_m == pytest.approx(0.573, abs=0.1)
