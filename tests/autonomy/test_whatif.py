"""Trials: the thesis's tables, disturbances that act as they say, and comparisons."""

import json
from pathlib import Path

import numpy as np
import pytest

from autonomy.campaign import CampaignCancelledError, Threads
from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.feasibility import InfeasibleReferenceError
from autonomy.control.trajectory import Reference
from autonomy.current.table import FlowTable
from autonomy.vehicle.config import MINIGLIDER, VEHICLES
from autonomy.whatif.check import check_scenario
from autonomy.whatif.comparison import compare
from autonomy.whatif.config import (
    TABLE_3_1_LINEAR,
    TABLE_3_1_SAWTOOTH,
    TABLE_3_3_DIAGONAL,
    TRIAL_PRESETS,
    ControllerChoice,
    DisturbanceConfig,
    SensingConfig,
    TrialConfig,
)
from autonomy.whatif.run import fly, run_trial
from autonomy.whatif.setting import packed_references

GOLDEN = json.loads((Path(__file__).parent / "golden_vehicle.json").read_text())
THESIS = {"prop": "backstepping", "bs": "baseline", "pid": "pid"}
SHORT = TABLE_3_3_DIAGONAL.model_copy(update={"duration_s": 30.0, "runs": 1})


def choice(name, *, simulation=False, vehicle="miniglider"):
    kind = CONTROLLERS[f"controller.{name}"]
    config = kind.simulation_preset if simulation else kind.preset(vehicle)
    return ControllerChoice(kind.key, kind.title, config)


def trial_reference():
    return Reference((3.0, 1.0, 2.0), -0.4, (0.02, 0.01, 0.02))


def changed(config, **parts):
    return TrialConfig.model_validate(config.model_dump() | parts)


@pytest.mark.parametrize("name", THESIS)
def test_a_trial_of_the_linear_glide_has_the_golden_errors(name):
    trial = run_trial(MINIGLIDER, TABLE_3_1_LINEAR, choice(THESIS[name], simulation=True), 1)
    assert trial.rms() == pytest.approx(GOLDEN["closed_loop_rms"][f"linear/{name}"], rel=0.01)


@pytest.mark.parametrize(
    ("name", "rms"),
    [
        ("backstepping", [0.259, 0.730, 0.078, 0.005]),
        ("baseline", [0.238, 0.853, 0.006, 0.103]),
        ("pid", [0.242, 0.785, 0.018, 0.081]),
    ],
)
def test_a_trial_of_the_sawtooth_has_the_errors_of_the_prototype(name, rms):
    trial = run_trial(MINIGLIDER, TABLE_3_1_SAWTOOTH, choice(name, simulation=True), 1)
    assert trial.rms() == pytest.approx(rms, abs=6e-4)


def test_proposed_controller_alone_wins_back_the_distance():
    for scenario in (TABLE_3_1_LINEAR, TABLE_3_1_SAWTOOTH):
        ends = {
            name: run_trial(MINIGLIDER, scenario, choice(name, simulation=True), 1).errors[-1, 1]
            for name in THESIS.values()
        }
        assert ends["backstepping"] < min(ends["baseline"], ends["pid"])


def test_same_seed_gives_the_same_trial_and_another_seed_another():
    one, same, other = (
        run_trial(MINIGLIDER, SHORT, choice("backstepping"), seed) for seed in (1, 1, 2)
    )
    assert np.array_equal(one.state, same.state)
    assert np.array_equal(one.estimate, same.estimate)
    assert not np.array_equal(one.state, other.state)


@pytest.mark.parametrize("model", ["thesis", "extended"])
def test_commands_of_the_sliding_mass_take_effect_as_late_as_the_delay_says(model):
    exact = changed(SHORT, duration_s=5.0, model=model, sensing=SensingConfig(), disturbance={})
    late = changed(exact, disturbance=DisturbanceConfig(actuator_delay_s=0.4))
    at_once, delayed = (
        run_trial(MINIGLIDER, config, choice("backstepping"), 1) for config in (exact, late)
    )
    assert at_once.inputs[1, 1] != 0.0
    assert np.all(delayed.inputs[:5, 1] == 0.0)
    assert delayed.inputs[5, 1] == pytest.approx(at_once.inputs[1, 1])
    assert delayed.inputs[1, 0] == pytest.approx(at_once.inputs[1, 0])


@pytest.mark.parametrize("model", ["thesis", "extended"])
def test_actuators_never_leave_their_stops_nor_exceed_their_rates(model):
    limits = MINIGLIDER.limits
    low = np.array([limits.m0_min_kg, limits.rp1_min_m, -limits.delta_max_rad])
    high = np.array([limits.m0_max_kg, limits.rp1_max_m, limits.delta_max_rad])
    rates = np.array([limits.m0_rate_kg_s, 0.5 * limits.rp1_rate_m_s, limits.delta_rate_rad_s])
    wild = changed(
        SHORT,
        model=model,
        disturbance=DisturbanceConfig(
            actuator_rate_share=0.5, net_buoyancy_error_kg=0.004, mass_position_error_m=0.003
        ),
    )
    for name in THESIS.values():
        trial = run_trial(MINIGLIDER, wild, choice(name, simulation=True), 3)
        for values in (trial.inputs, trial.commands):
            assert np.all(values >= low - 1e-12)
            assert np.all(values <= high + 1e-12)
        speed = np.abs(np.diff(trial.inputs, axis=0)) / wild.period_s
        assert np.all(speed <= rates * (1 + 1e-9))
        assert np.all(speed.max(axis=0) > 0.9 * rates)


def test_a_wrong_net_buoyancy_leaves_the_depth_offset_that_the_gains_allow():
    exact = changed(
        TABLE_3_1_LINEAR,
        duration_s=300.0,
        step_s=0.05,
        disturbance=DisturbanceConfig(net_buoyancy_error_kg=0.002),
    )
    trial = run_trial(MINIGLIDER, exact, choice("baseline", simulation=True), 1)
    pitch, p = trial.state[-1, 4], MINIGLIDER.parameters
    by_mass = p.gravity_m_s2 * (np.sin(pitch) ** 2 / p.mass_1_kg + np.cos(pitch) ** 2 / p.mass_3_kg)
    assert trial.errors[-1, 0] == pytest.approx(-0.002 * by_mass, rel=0.01)


@pytest.mark.parametrize("model", ["thesis", "extended"])
def test_a_current_carries_a_robot_that_does_not_see_it(model):
    still = changed(SHORT, model=model, sensing=SensingConfig(), disturbance={}, duration_s=4.0)
    flowing = changed(
        still, disturbance=DisturbanceConfig(current_north_m_s=0.01, current_east_m_s=-0.02)
    )
    one, other = (
        run_trial(MINIGLIDER, config, choice("pid"), 1).state[1, :3] for config in (still, flowing)
    )
    assert other - one == pytest.approx([0.001, -0.002, 0.0], abs=1e-7)


def test_wrong_parameters_change_the_robot_and_not_the_controller():
    wrong = changed(
        SHORT, sensing=SensingConfig(), disturbance=DisturbanceConfig(parameter_error=0.1)
    )
    right = changed(wrong, disturbance={})
    trials = [run_trial(MINIGLIDER, config, choice("pid"), 1) for config in (wrong, right)]
    assert np.array_equal(trials[0].commands[0], trials[1].commands[0])
    assert not np.array_equal(trials[0].state[5], trials[1].state[5])


def test_noise_is_as_large_as_the_scenario_says():
    noisy = changed(SHORT, duration_s=225.0)
    trial = run_trial(MINIGLIDER, noisy, choice("pid"), 1)
    seen = (trial.estimate - trial.state).std(axis=0)
    assert seen[2] == pytest.approx(0.003, rel=0.1)
    assert seen[[3, 4]] == pytest.approx(np.radians([0.5, 0.5]), rel=0.1)
    assert seen[9:] == pytest.approx([0.005] * 3, rel=0.1)
    assert seen[:2] == pytest.approx([0.055] * 2, rel=0.5)
    assert np.abs(trial.estimate[:, 6:9] - trial.state[:, 6:9])[600:].max() < 0.01


@pytest.mark.parametrize("key", VEHICLES)
def test_every_controller_runs_the_scenario_that_a_form_starts_with(key):
    vehicle = VEHICLES[key]
    config = changed(TRIAL_PRESETS[key], duration_s=60.0, step_s=0.05)
    choices = [choice(name.partition(".")[2], vehicle=key) for name in CONTROLLERS]
    shares = []
    comparison = compare(
        vehicle, config, choices, report=lambda share, _message: shares.append(share)
    )
    document = comparison.result(50).model_dump(mode="json")
    assert shares[-1] == 1.0
    assert len(document["time_s"]) == 50
    assert document["time_s"][-1] == pytest.approx(config.period_s * (config.periods - 1))
    assert [run["kind"] for run in document["runs"]] == list(CONTROLLERS)
    assert json.loads(json.dumps(document, allow_nan=False)) == document


def test_controllers_are_compared_on_the_same_seeds_and_bands_hold_the_median():
    config = changed(SHORT, runs=5)
    choices = [choice("backstepping"), choice("pid")]
    comparison = compare(MINIGLIDER, config, choices)
    first, second = comparison.results
    assert [one.seed for one in first.runs] == [one.seed for one in second.runs] == [1, 2, 3, 4, 5]
    run = comparison.result().model_dump()["runs"][0]
    middle = np.array(run["errors"]["horizontal_m"])
    assert np.all(np.array(run["band"]["horizontal_m"]["low"]) <= middle)
    assert np.all(np.array(run["band"]["horizontal_m"]["high"]) >= middle)
    for one, seed in zip(second.runs, config.seeds, strict=True):
        alone = run_trial(MINIGLIDER, config, choices[1], seed)
        assert np.array_equal(alone.state, one.state)
        assert np.array_equal(alone.rms(), one.rms)
        assert np.array_equal(alone.travel, one.travel)


def test_a_comparison_keeps_few_rows_of_a_long_trial_and_lets_go_of_the_rest():
    config = changed(SHORT, duration_s=200.0, step_s=0.05)
    alone = run_trial(MINIGLIDER, config, choice("pid"), config.seed)
    kept = compare(MINIGLIDER, config, [choice("pid")]).results[0].runs[0]
    assert kept.time_s.shape == (400,)
    assert kept.time_s[-1] == alone.time_s[-1]
    at = np.searchsorted(alone.time_s, kept.time_s)
    assert np.array_equal(kept.state, alone.state[at])
    for array in (kept.time_s, kept.state, kept.inputs, kept.errors):
        assert array.base is None
    assert np.array_equal(kept.rms, alone.rms())


def test_a_comparison_can_be_cancelled():
    with pytest.raises(CampaignCancelledError):
        compare(MINIGLIDER, changed(SHORT, runs=3), [choice("pid")], is_cancelled=lambda: True)


def test_a_comparison_of_nothing_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        compare(MINIGLIDER, SHORT, [])


@pytest.mark.parametrize(
    "wrong",
    [
        {"step_s": 0.0},
        {"step_s": 1e-9, "duration_s": 4e-4, "disturbance": {"actuator_delay_s": 2.0}},
        {"duration_s": 30_000.0},
        {"duration_s": 0.005},
        {"runs": 0},
        {"reference": "loop"},
        {"disturbance": {"actuator_rate_share": 0.0}},
    ],
)
def test_a_scenario_that_cannot_be_run_is_refused(wrong):
    with pytest.raises(ValueError, match="validation error"):
        changed(TABLE_3_1_LINEAR, **wrong)


def test_many_runs_give_what_single_trials_give_on_any_number_of_threads():
    config = changed(SHORT, runs=4, disturbance=DisturbanceConfig(parameter_error=0.1))
    many = [
        compare(MINIGLIDER, config, [choice("backstepping")], spread=Threads(places))
        .results[0]
        .runs
        for places in (1, 2)
    ]
    for alone, together, seed in zip(*many, config.seeds, strict=True):
        single = run_trial(MINIGLIDER, config, choice("backstepping"), seed)
        for run in (alone, together):
            assert np.array_equal(run.state[-1], single.state[-1])
            assert np.array_equal(run.errors[-1], single.errors[-1])
            assert np.array_equal(run.rms, single.rms())
            assert np.array_equal(run.travel, single.travel)


@pytest.mark.parametrize(
    ("parts", "kinds", "words"),
    [
        (
            {"reference": "straight_glide", "straight": {"glide_angle_rad": -0.2}},
            ["pid"],
            "flatter than this vehicle glides",
        ),
        (
            {"reference": "straight_glide", "straight": {"vertical_speed_m_s": 0.2}},
            ["pid"],
            "buoyancy allows at most",
        ),
        ({}, ["swimming", "pid"], "needs the extended model"),
        ({"reference": "level_swim", "model": "extended"}, ["pid"], "only the swimming"),
        (
            {
                "reference": "level_swim",
                "model": "extended",
                "straight": {"swim_speed_m_s": 0.5},
            },
            ["swimming"],
            "Miniglider swims at most",
        ),
    ],
)
def test_a_scenario_beyond_a_limit_is_refused_by_its_name(parts, kinds, words):
    with pytest.raises(InfeasibleReferenceError, match=words):
        check_scenario(
            MINIGLIDER, changed(TABLE_3_1_LINEAR, **parts), [choice(kind) for kind in kinds]
        )


def test_scenarios_of_the_thesis_are_accepted_for_every_controller():
    every = [choice(key.partition(".")[2]) for key in CONTROLLERS]
    for scenario in (TABLE_3_1_LINEAR, TABLE_3_1_SAWTOOTH, TABLE_3_3_DIAGONAL):
        check_scenario(MINIGLIDER, changed(scenario, model="extended"), every)


def test_nonsense_from_sensors_never_reaches_an_actuator():
    broken = changed(SHORT, duration_s=5.0, sensing={"exact": False, "tilt_std_rad": 1.0})
    for name in CONTROLLERS:
        trial = run_trial(MINIGLIDER, broken, choice(name.partition(".")[2]), 1)
        assert np.all(np.isfinite(trial.commands))
        assert np.all(np.isfinite(trial.inputs))


def test_every_law_answers_an_estimate_that_is_not_a_number_with_neutral_set_points():
    far = trial_reference()
    for kind in CONTROLLERS.values():
        controller = kind.make(MINIGLIDER, kind.preset("miniglider"))
        command = controller.command(np.full(12, np.nan), far, 0.1)
        assert (command.m0_kg, command.rp1_m, command.delta_rad) == (0.0, 0.0, 0.0)
        assert command.tail_amplitude_rad == 0.0
        fresh = kind.make(MINIGLIDER, kind.preset("miniglider"))
        state = np.full(12, 0.05)
        assert controller.command(state, far, 0.1) == fresh.command(state, far, 0.1)


@pytest.mark.parametrize("model", ["thesis", "extended"])
def test_water_flows_as_a_table_says_at_each_place_and_time(model):
    scenario = changed(SHORT, model=model, disturbance={"current_north_m_s": 0.05})
    one = choice("backstepping")
    typed = run_trial(MINIGLIDER, scenario, one, 1)
    values = np.zeros((2, 2, 2, 2, 2))
    values[..., 0] = 0.05
    table = FlowTable(values, (-50.0, -50.0, 0.0, 0.0), (0.01, 0.01, 0.1, 0.01))
    references = packed_references(MINIGLIDER, scenario)
    still = changed(scenario, disturbance={})
    alike = fly(MINIGLIDER, still, one, 1, references, table)
    np.testing.assert_allclose(alike.state, typed.state, atol=1e-9)
    values[:, :, :, 0] = 0.0  # it begins to flow with time
    later = fly(MINIGLIDER, still, one, 1, references, table)
    first = run_trial(MINIGLIDER, still, one, 1)
    assert np.abs(later.state[1, :2] - first.state[1, :2]).max() < 1e-4
    assert np.abs(later.state[-1, 0] - first.state[-1, 0]) > 0.02
