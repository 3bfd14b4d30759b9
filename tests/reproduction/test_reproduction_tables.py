"""Tables and figures of chapter 3: what of the thesis they show, with the trials really run."""

import json

import numpy as np
import pytest

from autonomy.control.config import PID_EXPERIMENT, BacksteppingConfig
from autonomy.whatif.config import TABLE_3_3_DIAGONAL
from reproduction import fig_3_3_cases, fig_3_10, table_3_1, table_3_3
from reproduction.catalogue import REPRODUCTIONS, reproduce
from reproduction.contender import CONTENDERS
from reproduction.trials import Job, run_jobs, with_actuator
from reproduction.writer import document

PROPOSED, BASELINE, PID = range(3)
HORIZONTAL, PITCH = 1, 2


def silent(done, doing):
    assert 0.0 <= done <= 1.0
    assert doing


@pytest.fixture(scope="module")
def table():
    return table_3_1.reproduce(1, silent)


@pytest.fixture(scope="module")
def cases():
    return fig_3_3_cases.case_runs(silent)


@pytest.fixture(scope="module")
def sets():
    return {each.title: each for each in table_3_3.trial_sets(3, silent, trials=3)}


def cell(result, row, column):
    return next(each for each in result.rows if (each.row, each.column) == (row, column))


def test_contenders_are_the_three_of_the_thesis_with_its_gains():
    proposed, baseline, pid = CONTENDERS
    assert [each.title for each in CONTENDERS] == ["proposed", "baseline", "PID"]
    for gains in (baseline.simulation, baseline.experiment):
        assert isinstance(gains, BacksteppingConfig)
        assert gains.pitch_trade_rad == 0.0
    assert proposed.simulation.pitch_trade_rad == pytest.approx(np.pi / 9)
    assert pid.experiment == PID_EXPERIMENT
    assert pid.experiment.anti_windup == "none"


def test_table_3_1_has_every_cell_of_the_thesis_beside_ours(table):
    printed = sorted(row.thesis for row in table.rows if row.row.endswith(" error, RMS"))
    assert printed == sorted(np.array(list(table_3_1.THESIS.values())).ravel())
    cell_of_text = cell(table, "linear glide: horizontal error, RMS", "baseline")
    assert (cell_of_text.thesis, cell_of_text.unit) == (3.491, "m")


def test_table_3_1_shows_what_the_text_says_of_the_linear_glide(table):
    def horizontal(column, quantity="RMS"):
        return cell(table, f"linear glide: horizontal error, {quantity}", column).ours

    start = np.hypot(3.0, 1.5)
    assert horizontal("proposed", "end") < 0.1 * start  # "quickly decreases rho_e"
    assert horizontal("baseline", "end") > start  # "e_rho increasing over time"
    assert start > horizontal("PID", "end") > 0.8 * start  # "slowly decrease rho_e"
    assert horizontal("proposed") < horizontal("PID") < horizontal("baseline")


def test_table_3_1_shows_the_price_in_pitch_and_that_only_the_proposed_ends_the_hybrid_error(table):
    for trajectory in table_3_1.SCENARIOS:
        pitch = [cell(table, f"{trajectory}: pitch error, RMS", one.title) for one in CONTENDERS]
        assert pitch[PROPOSED].ours > pitch[PID].ours > pitch[BASELINE].ours
        hybrid = [cell(table, f"{trajectory}: hybrid error, RMS", one.title) for one in CONTENDERS]
        assert hybrid[PROPOSED].ours < 0.5 * min(hybrid[BASELINE].ours, hybrid[PID].ours)


def test_weighting_the_beginning_counts_it_more(table):
    plain = cell(table, "linear glide: pitch error, RMS", "baseline").ours
    weighted = cell(table, "linear glide: pitch error, weighted RMS", "baseline").ours
    # 540 s of which 10 s hold all of the error: the mean square grows by 21 * 540 / 740
    assert weighted / plain == pytest.approx(np.sqrt(21.0 * 540.0 / 740.0), rel=0.01)


def test_a_result_is_json_and_the_same_again(table):
    again = reproduce("table-3.1", 1, silent)
    assert document(again) == document(table)
    assert json.loads(json.dumps(document(table), allow_nan=False)) == document(table)
    assert set(REPRODUCTIONS) >= {"table-3.1", "table-3.3", "fig-3.3-cases"}
    with pytest.raises(KeyError):
        reproduce("table-9.9", 1, silent)


def test_in_every_case_the_pitch_turns_as_drawn_and_the_gap_closes(cases):
    assert [case.case for case in cases] == list(fig_3_3_cases.CASES)
    for run in cases:
        assert np.degrees(run.steeper_rad()) * run.case.pitch_sign > 4.0
        distance = run.proposed.errors[:, HORIZONTAL]
        assert distance[0] == pytest.approx(fig_3_3_cases.GAP_M)
        assert distance[-1] < 0.15
        assert run.baseline.errors[-1, HORIZONTAL] == pytest.approx(1.0, abs=0.1)
        assert np.abs(run.proposed.state[:, 1]).max() < 1e-6  # it stays in the plane


def test_a_robot_that_is_ahead_turns_round_when_it_steers_for_its_copy(cases):
    for run in cases:
        greatest = run.turning.errors[:, HORIZONTAL].max()
        assert greatest > 1.5 if run.case.is_ahead else greatest < 1.01


def test_with_the_nominal_actuator_nobody_oscillates_and_the_baseline_is_farther_off(sets):
    errors = sets["diagonal"].rms()
    assert errors.shape == (3, 3, 4)
    assert (errors[:, :, PITCH] < table_3_3.OSCILLATION_RAD).all()
    assert (errors[BASELINE, :, HORIZONTAL] > errors[PROPOSED, :, HORIZONTAL]).all()


@pytest.mark.parametrize("trajectory", table_3_3.SCENARIOS)
def test_from_behind_the_proposed_controller_is_closest_in_every_trial(sets, trajectory):
    horizontal = sets[f"{trajectory}, behind"].rms()[:, :, HORIZONTAL]
    assert (horizontal[PROPOSED] < horizontal[BASELINE]).all()
    assert (horizontal[PROPOSED] < horizontal[PID]).all()


@pytest.mark.parametrize("trajectory", table_3_3.SCENARIOS)
def test_with_a_slow_mass_the_pid_alone_oscillates_and_is_farthest_off(sets, trajectory):
    errors = sets[f"{trajectory}, slow mass"].rms()
    assert (errors[:PID, :, PITCH] < table_3_3.OSCILLATION_RAD).all()
    mean = errors.mean(axis=1)
    assert mean[PID, PITCH] > table_3_3.OSCILLATION_RAD
    assert mean[PID, HORIZONTAL] > 1.1 * mean[PROPOSED, HORIZONTAL]


def test_trials_of_one_seed_are_the_same_and_of_another_are_not():
    scenario = TABLE_3_3_DIAGONAL.model_copy(update={"duration_s": 20.0})
    proposed = CONTENDERS[PROPOSED]
    jobs = [Job(scenario, proposed, proposed.experiment, seed) for seed in (4, 4, 5)]
    first, again, other = run_jobs(jobs, silent)
    assert np.array_equal(first.errors, again.errors)
    assert not np.array_equal(first.errors, other.errors)


def test_the_sweep_takes_its_example_from_the_pid_with_the_slow_mass():
    swept = fig_3_10.sweep(7, silent, rate_shares=(1.0, 0.25), delays_s=(0.0,), trials=2)
    assert swept.rms.shape == (2, 1, 3, 2, 4)
    assert swept.oscillating()[:, 0].tolist() == [[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]]
    pid = CONTENDERS[PID]
    slow = with_actuator(TABLE_3_3_DIAGONAL, *fig_3_10.EXAMPLE)
    (alone,) = run_jobs([Job(slow, pid, pid.experiment, 7)], silent)
    assert np.array_equal(swept.example.state, alone.state)
    assert swept.rms[1, 0, PID, 0] == pytest.approx(alone.rms())


@pytest.mark.parametrize("name", ["table-3.3", "fig-3.10", "fig-3.3-cases"])
def test_every_reproduction_ends_in_finite_rows_and_whole_panels(name, monkeypatch):
    monkeypatch.setattr(table_3_3, "TRIALS", 2)
    monkeypatch.setattr(fig_3_10, "TRIALS", 2)
    few = TABLE_3_3_DIAGONAL.model_copy(update={"duration_s": 30.0})
    monkeypatch.setattr(table_3_3, "SCENARIOS", dict.fromkeys(table_3_3.SCENARIOS, few))
    monkeypatch.setattr(fig_3_10, "TABLE_3_3_DIAGONAL", few)
    monkeypatch.setattr(fig_3_3_cases, "DURATION_S", 160.0)
    result = reproduce(name, 2, silent)
    assert result.name == name
    names = [(row.row, row.column) for row in result.rows]
    assert len(set(names)) == len(names)
    assert all(np.isfinite(row.ours) for row in result.rows)
    assert json.loads(json.dumps(document(result), allow_nan=False)) == document(result)
    for panel in result.figure.panels:
        assert panel.title
        assert all(len(series.x) == len(series.y) > 0 for series in panel.series)
