"""Swarm and least squares find what made a recording, and say what it cannot tell."""

import json
from dataclasses import replace

import numpy as np
import pytest

from autonomy.identification import least_squares, nuisance
from autonomy.identification.config import (
    IDENTIFICATION_PRESETS,
    FreeParameters,
    IdentificationConfig,
    NoiseLevels,
)
from autonomy.identification.identifiability import judge
from autonomy.identification.kernel import DIVERGED
from autonomy.identification.normal_equations import Information, normal_equations
from autonomy.identification.problem import NothingToIdentifyError, Workers, problem_from
from autonomy.identification.progress import CheckpointError, IdentificationCancelledError
from autonomy.identification.recording import Recording
from autonomy.identification.run import identify
from autonomy.identification.unknown import Unknown, free_names
from autonomy.vehicle.config import MINIGLIDER, VEHICLES
from autonomy.vehicle.kernel import rk4_step
from autonomy.vehicle.parameter_file import vehicle_from_document
from tests.autonomy.identification_flight import open_loop_recording

WELL_KNOWN = ("mass_1_kg", "drag_0", "drag_alpha", "drag_delta", "lift_0", "lift_alpha")
TRUTH = MINIGLIDER.parameters.model_dump()
CAMERAS = NoiseLevels(fix_hold_s=0.0)
THESIS = IdentificationConfig(model="thesis", fits_offsets=False, step_s=0.2, noise=CAMERAS)
SMALL = THESIS.model_copy(update={"particles": 12, "iterations": 12, "runs": 2, "descents": 6})


def wrong_by(share: float, config: IdentificationConfig = THESIS):
    generator = np.random.default_rng(7)
    values = {
        name: TRUTH[name] * (1.0 + share * generator.uniform(-1.0, 1.0))
        for name in free_names(config.free)
    }
    return replace(MINIGLIDER, parameters=MINIGLIDER.parameters.model_copy(update=values))


@pytest.fixture(scope="module")
def six_runs() -> Recording:
    return open_loop_recording(MINIGLIDER, np.random.default_rng(3), period_s=0.2)


@pytest.fixture(scope="module")
def short_runs() -> Recording:
    return open_loop_recording(
        MINIGLIDER, np.random.default_rng(4), runs=2, duration_s=40.0, period_s=0.2
    )


def run(problem, config, **options):
    given = {"report": lambda _: None, "is_cancelled": lambda: False, "threads": 2} | options
    return identify(problem, config, np.random.default_rng(config.seed), **given)


def test_simulation_is_that_of_the_vehicle_model(short_runs):
    hold = replace(
        short_runs,
        net_buoyancy_kg=np.full_like(short_runs.time_s, 0.012),
        mass_position_m=np.full_like(short_runs.time_s, 0.02),
        tail_rad=np.full_like(short_runs.time_s, 0.4),
    )
    problem = problem_from(MINIGLIDER, hold, THESIS)
    with Workers(1) as workers:
        u = np.zeros((1, len(problem.sought)))
        predicted, sound = problem.simulate(u, problem.guess[None], workers)
    rows = problem.layout.segment_row
    state = problem.guess[0].copy()
    packed = MINIGLIDER.packed()
    assert sound.all()
    for row in range(1, rows[1]):
        state = rk4_step(state, np.array([0.012, 0.02, 0.4]), packed, 0.2, 1)
        assert predicted[0, row] == pytest.approx(state[:6], abs=1e-9)


def test_actuators_are_interpolated_between_rows():
    coarse = open_loop_recording(
        MINIGLIDER, np.random.default_rng(9), runs=1, duration_s=30.0, period_s=0.5
    )
    fine = THESIS.model_copy(update={"step_s": 0.05})
    with Workers(1) as workers:
        predictions = []
        for config in (THESIS, fine):
            problem = problem_from(MINIGLIDER, coarse, config)
            u = np.zeros((1, len(problem.sought)))
            predictions.append(problem.simulate(u, problem.guess[None], workers)[0])
    assert predictions[0] == pytest.approx(predictions[1], abs=2e-4)


def test_cost_is_one_at_the_truth(six_runs):
    problem = problem_from(MINIGLIDER, six_runs, THESIS)
    with Workers(2) as workers:
        point = least_squares.begin(problem, np.zeros(len(problem.sought)), workers)
    assert point.cost == pytest.approx(1.0, abs=0.03)


def test_projection_is_the_exact_cost_near_its_point(short_runs):
    problem = problem_from(MINIGLIDER, short_runs, THESIS)
    u = np.zeros(len(problem.sought))
    with Workers(1) as workers:
        initial = least_squares.settled(problem, u, problem.guess, workers)
        assert initial is not None
        moved = initial.copy()
        moved[:, 6] += 0.002
        profile = nuisance.profile_of(problem, u, moved, workers)
        exact = least_squares.at(problem, u, initial, workers).cost
        assert nuisance.costs(problem, u[None], profile, workers)[0] == pytest.approx(
            exact, rel=0.02
        )


def test_threads_do_not_change_a_number(short_runs):
    problem = problem_from(MINIGLIDER, short_runs, THESIS)
    u = np.random.default_rng(0).uniform(-0.5, 0.5, (17, len(problem.sought)))
    found = []
    for threads in (1, 2, 3):
        with Workers(threads) as workers:
            profile = nuisance.profile_of(problem, 0.0 * u[0], problem.guess, workers)
            found.append(nuisance.costs(problem, u, profile, workers))
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])


def test_candidate_that_diverges_has_a_finite_cost(short_runs):
    problem = problem_from(MINIGLIDER, short_runs, THESIS)
    u = np.zeros((2, len(problem.sought)))
    place = [unknown.name for unknown in problem.sought].index("pitch_damping_m_s")
    u[1, place] = 2000.0
    with Workers(1) as workers:
        profile = nuisance.profile_of(problem, u[0], problem.guess, workers)
        costs = nuisance.costs(problem, u, profile, workers)
    assert costs[0] < DIVERGED
    assert costs[1] == DIVERGED


def test_least_squares_find_the_well_known_parameters_within_three_percent(six_runs):
    config = THESIS.model_copy(update={"method": "least_squares"})
    result = run(problem_from(wrong_by(0.05), six_runs, config), config)
    for name in WELL_KNOWN:
        assert result.parameter(name).after == pytest.approx(TRUTH[name], rel=0.03), name
        assert result.parameter(name).verdict == "identified"
    assert result.cost_after == pytest.approx(1.0, abs=0.03)
    for name in ("offset_mass_kg", "offset_mass_depth_m"):
        estimate = result.parameter(name)
        assert estimate.verdict == "not identifiable"
        assert estimate.std is None
        assert "only the product offset mass x depth of the offset mass enters" in estimate.reason
    assert result.parameter("yaw_delta_m").verdict == "weak"
    assert result.parameter("area_m2").verdict == "fixed"


def test_measured_ballast_gives_the_moments_their_scale(six_runs):
    measured = FreeParameters(sliding_mass=False, offset_mass=False)
    config = THESIS.model_copy(update={"method": "least_squares", "free": measured})
    result = run(problem_from(wrong_by(0.05, config), six_runs, config), config)
    assert not any("product" in message for message in result.findings)
    for name in ("inertia_1_kg_m2", "inertia_2_kg_m2", "inertia_3_kg_m2", "pitch_0_m"):
        estimate = result.parameter(name)
        assert estimate.after == pytest.approx(TRUTH[name], rel=0.02), name
        assert estimate.std is not None
        assert abs(estimate.after - TRUTH[name]) < 4.0 * estimate.std
    assert result.parameter("sliding_mass_kg").verdict == "fixed"


def test_swarm_with_polish_recovers_parameters_and_actuator_offsets():
    recording = open_loop_recording(
        MINIGLIDER,
        np.random.default_rng(3),
        runs=4,
        duration_s=60.0,
        period_s=0.2,
        extended=True,
        net_buoyancy_bias_kg=0.0007,
        mass_position_bias_m=-0.001,
    )
    config = IdentificationConfig(particles=40, iterations=15, step_s=0.2, noise=CAMERAS)
    result = run(problem_from(wrong_by(0.15), recording, config), config)
    for name in WELL_KNOWN:
        assert result.parameter(name).after == pytest.approx(TRUTH[name], rel=0.05), name
    offset = result.parameter("net_buoyancy_offset_kg").after
    assert offset == pytest.approx(0.0007, abs=5e-5)
    assert result.parameter("mass_position_offset_m").after == pytest.approx(-0.001, abs=1e-4)


def test_swarm_improves_and_says_how_far_it_is(short_runs):
    config = SMALL.model_copy(update={"polish": False})
    heard = []
    result = run(problem_from(wrong_by(0.15), short_runs, config), config, report=heard.append)
    assert [progress.iteration for progress in heard] == list(range(1, 25))
    assert {progress.iterations for progress in heard} == {24}
    assert heard[11].spread < heard[0].spread
    assert result.cost_before is not None
    assert result.cost_after < result.cost_before
    assert len(result.convergence) == 24


def test_resumed_identification_ends_exactly_as_an_uninterrupted_one(short_runs):
    problem = problem_from(wrong_by(0.15), short_runs, SMALL)
    states: list[str] = []
    whole = run(problem, SMALL, report=lambda now: states.append(json.dumps(now.state)))
    document = whole.model_dump_json()
    for place in (4, 12, 25):
        again = run(problem, SMALL, resume=json.loads(states[place]), threads=1)
        assert again.model_dump_json() == document


def test_cancelled_identification_hands_over_its_state(short_runs):
    problem = problem_from(wrong_by(0.15), short_runs, SMALL)
    count = iter(range(100))
    with pytest.raises(IdentificationCancelledError) as stopped:
        run(problem, SMALL, is_cancelled=lambda: next(count) == 3)
    assert len(stopped.value.state["convergence"]) == 4


def test_checkpoint_of_another_recording_is_refused(short_runs):
    problem = problem_from(wrong_by(0.15), short_runs, SMALL)
    with pytest.raises(CheckpointError):
        run(problem, SMALL, resume={"format": 1, "fingerprint": "other", "convergence": []})


def test_document_carries_a_vehicle_that_can_be_read_again(short_runs):
    config = SMALL.model_copy(update={"method": "least_squares"})
    result = run(problem_from(wrong_by(0.05), short_runs, config), config)
    document = json.loads(json.dumps(result.model_dump(mode="json"), allow_nan=False))
    vehicle = vehicle_from_document(document["vehicle"])
    assert vehicle.parameters == result.vehicle.parameters
    assert vehicle.note.startswith("identified from 80 s")
    assert document["offsets"] is None
    fit = document["fit"]
    assert len(fit["time_s"]) == len(fit["after"]["depth_m"]) == len(fit["before"]["pitch_rad"])
    with pytest.raises(KeyError):
        result.parameter("colour")


def test_recording_without_a_sound_part_is_refused(short_runs):
    shallow = replace(short_runs, position_ned=np.zeros_like(short_runs.position_ned))
    with pytest.raises(NothingToIdentifyError, match="surface"):
        problem_from(MINIGLIDER, shallow, THESIS)


def test_nothing_free_is_refused(short_runs):
    nothing = FreeParameters(**dict.fromkeys(FreeParameters.model_fields, False))
    with pytest.raises(NothingToIdentifyError, match="free at least one"):
        problem_from(MINIGLIDER, short_runs, THESIS.model_copy(update={"free": nothing}))


def test_model_that_cannot_follow_is_said(short_runs):
    config = THESIS.model_copy(update={"method": "least_squares"})
    wild = MINIGLIDER.parameters.model_copy(update={"drag_0": -5000.0})
    with pytest.raises(least_squares.DivergedError, match="cannot follow"):
        run(problem_from(replace(MINIGLIDER, parameters=wild), short_runs, config), config)


def test_parameter_that_is_zero_stays_and_is_told_so(short_runs):
    config = SMALL.model_copy(update={"method": "least_squares"})
    flat = MINIGLIDER.parameters.model_copy(update={"pitch_alpha_m": 0.0})
    result = run(problem_from(replace(MINIGLIDER, parameters=flat), short_runs, config), config)
    assert result.parameter("pitch_alpha_m").verdict == "fixed"
    assert "is 0" in result.parameter("pitch_alpha_m").reason


def named(name: str, nominal: float = 1.0) -> Unknown:
    return Unknown(name, name, "", nominal, abs(nominal), -0.5, 0.5, 0)


def information(*fishers: np.ndarray, pulls=None) -> Information:
    """What one or several segments tell."""
    n = fishers[0].shape[0]
    parts = np.array(fishers)
    gradients = np.zeros((len(fishers), n)) if pulls is None else np.array(pulls)
    return Information(parts.sum(axis=0), gradients.sum(axis=0), parts, gradients)


def test_segments_that_disagree_widen_the_interval():
    one = np.array([[1e6]])
    agreeing, _ = judge((named("a"),), np.zeros(1), information(one, one), 1.0)
    told = information(one, one, pulls=[[1e5], [-1e5]])
    disagreeing, _ = judge((named("a"),), np.zeros(1), told, 1.0)
    assert agreeing[0].std == pytest.approx(1.0 / np.sqrt(2e6))
    # 0.1 by the two segments, and as much more as two can be wrong
    assert disagreeing[0].std == pytest.approx(0.25)
    assert disagreeing[0].verdict == "weak"


@pytest.mark.parametrize(
    ("nominal", "vector", "message"),
    [
        (1.0, (1.0, -1.0, 0.0), "only the product a x b enters"),
        (1.0, (1.0, 1.0, 0.0), "only the ratio a / b enters"),
        (-1.0, (1.0, 1.0, 0.0), "only the product a x b enters"),
        (1.0, (0.0, 0.0, 1.0), "the c leaves no trace"),
        (1.0, (1.0, 1.0, 1.0), "only ratios of"),
    ],
)
def test_null_direction_is_named(nominal, vector, message):
    direction = np.array(vector) / np.linalg.norm(vector)
    fisher = 1e6 * (np.eye(3) - np.outer(direction, direction))
    sought = (named("a", nominal), named("b"), named("c"))
    judged, directions = judge(sought, np.zeros(3), information(fisher), 1.0)
    assert any(message in found.message for found in directions)
    members = [judgement.verdict == "not identifiable" for judgement in judged]
    assert members == [abs(value) > 0.0 for value in vector]


def test_parameter_at_the_border_of_the_box_is_weak():
    judged, _ = judge((named("a"),), np.array([0.5]), information(np.array([[1e8]])), 1.0)
    assert judged[0].verdict == "weak"
    assert "border" in judged[0].reason


def test_every_vehicle_has_settings():
    assert set(IDENTIFICATION_PRESETS) == set(VEHICLES)


def test_small_part_in_a_null_direction_is_no_certainty():
    direction = np.array([1.0, 1.0, 0.2]) / np.linalg.norm([1.0, 1.0, 0.2])
    fisher = 1e8 * (np.eye(3) - np.outer(direction, direction))
    sought = (named("a"), named("b"), named("c"))
    judged, _ = judge(sought, np.zeros(3), information(*[fisher] * 6), 1.0)
    assert [judgement.verdict for judgement in judged] == ["not identifiable"] * 3


def test_few_segments_identify_nothing():
    one = np.array([[1e8]])
    few, _ = judge((named("a"),), np.zeros(1), information(*[one] * 5), 1.0)
    enough, _ = judge((named("a"),), np.zeros(1), information(*[one] * 6), 1.0)
    assert (few[0].verdict, enough[0].verdict) == ("weak", "identified")
    assert "5 segments" in few[0].reason


def test_what_was_not_reported_widens_the_interval():
    told = information(*[np.array([[1e6]])] * 6)
    drift = np.array([[6e5], [-1e5]])
    judged, _ = judge((named("a"),), np.zeros(1), told, 1.0, drift)
    assert judged[0].std == pytest.approx(0.1, rel=1e-3)
    assert "too seldom" in judged[0].reason


def test_cost_beyond_one_widens_the_interval():
    told = information(*[np.array([[1e6]])] * 6)
    fair, _ = judge((named("a"),), np.zeros(1), told, 1.0)
    poor, _ = judge((named("a"),), np.zeros(1), told, 9.0)
    assert poor[0].std == pytest.approx(3.0 * fair[0].std)


def test_descent_that_was_cut_short_has_no_intervals(short_runs):
    config = THESIS.model_copy(update={"method": "least_squares", "descents": 1})
    result = run(problem_from(wrong_by(0.15), short_runs, config), config)
    assert not result.is_converged
    assert all(estimate.std is None for estimate in result.parameters)
    assert "not ended at a minimum" in result.findings[0]


def test_segments_by_themselves_tell_what_they_tell_together(short_runs, monkeypatch):
    problem = problem_from(MINIGLIDER, short_runs, THESIS)
    u = np.zeros(len(problem.sought))
    found = []
    with Workers(1) as workers:
        for rows in (10_000, 1):
            monkeypatch.setattr("autonomy.identification.problem._MOST_ROWS", rows)
            equations = normal_equations(problem, u, problem.guess, workers)
            profile = nuisance.profile_of(problem, u, problem.guess, workers)
            assert equations is not None
            found.append((Information.of(equations), profile))
    (together, profile), (apart, other) = found
    assert len(list(problem.pieces())) == 2
    assert np.array_equal(together.fisher_by_segment, apart.fisher_by_segment)
    assert np.array_equal(together.gradient, apart.gradient)
    assert np.array_equal(profile.basis, other.basis)
    assert np.array_equal(profile.lean, other.lean)


def test_truth_with_any_start_is_near_its_minimum():
    for seed in (101, 105, 108):
        recording = open_loop_recording(
            MINIGLIDER, np.random.default_rng(seed), runs=4, duration_s=60.0, period_s=0.2
        )
        problem = problem_from(MINIGLIDER, recording, THESIS)
        with Workers(2) as workers:
            start = least_squares.begin(problem, np.zeros(len(problem.sought)), workers)
        assert start.cost == pytest.approx(1.0, abs=0.05), seed


def test_swarm_tells_its_move_and_cost(short_runs):
    heard = []
    run(problem_from(wrong_by(0.15), short_runs, SMALL), SMALL, report=heard.append)
    assert heard[2].message == f"the swarm searches: move 3 of 24, cost {heard[2].best_cost:.3g}"
    assert heard[24].message.startswith("least squares descend: step 1, cost ")
