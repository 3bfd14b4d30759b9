"""Whole runs of range-only tracking against printed values, theory, and a second implementation."""

from dataclasses import replace

import numpy as np
import pytest

from autonomy.tracking.config import BarrierConfig, TargetConfig, TrackingConfig
from reproduction.tracking import metrics
from reproduction.tracking.run import Case, run, run_readable
from reproduction.tracking.scenario import FIT, STATIC, random_scenarios
from reproduction.tracking.tracker_run import run_tracker

UNSEEN = range(5000, 5040)


def with_target(scenario, **settings):
    target = TargetConfig(north_m=0.0, east_m=0.0, **settings)
    return replace(scenario, config=scenario.config.model_copy(update={"target": target}))


def test_runs_without_noise_have_the_digits_of_the_specification():
    quiet = {"position_density_m2_s": 1e-4}
    quiet |= {"heading_density_rad2_s": 1e-5, "speed_density_m2_s3": 1e-5}
    exact = replace(STATIC.with_filter(**quiet), believed_variance_m2=0.065)
    free, kept = (run(exact, case, 0).score for case in (Case.SF, Case.SF_CBF))
    assert free.estimation_error_m == pytest.approx(5.39587959e-5, abs=5e-13)
    assert free.tracking_error_m == pytest.approx(1.3680442, abs=5e-8)
    assert free.inverse_condition_s == pytest.approx(8.82900794, abs=5e-9)
    assert kept.tracking_error_m == pytest.approx(1.50749654, abs=5e-9)
    assert kept.inverse_condition_s == pytest.approx(29.5080942, abs=5e-8)


@pytest.mark.parametrize(
    ("case", "estimation", "tracking", "condition"),
    [
        (Case.SF, 0.152, 0.349, 31.5),
        (Case.OF, 86.5, 43.8, 27.3),
        (Case.SF_CBF, 0.089, 0.583, 226.9),
        (Case.OF_CBF, 0.093, 0.595, 217.2),
    ],
)
def test_means_of_the_fit_have_the_printed_digits(case, estimation, tracking, condition):
    scores = [run(FIT, case, seed).score for seed in range(10)]
    error = np.mean([score.estimation_error_m for score in scores])
    distance = np.mean([score.tracking_error_m for score in scores])
    assert error == pytest.approx(estimation, abs=0.05 if case is Case.OF else 5e-4)
    assert distance == pytest.approx(tracking, abs=0.05 if case is Case.OF else 5e-4)
    total = np.mean([score.inverse_condition_s for score in scores])
    assert total == pytest.approx(condition, abs=0.05)


def test_with_an_estimated_target_velocity_the_fit_is_within_a_percent_of_the_printed_means():
    # How the velocity filter begins is not written down, and one of ten seeds hangs on it.
    scores = [run(FIT, Case.OFETV_CBF, seed).score for seed in range(10)]
    means = np.mean(
        [[s.estimation_error_m, s.tracking_error_m, s.inverse_condition_s] for s in scores], axis=0
    )
    assert means == pytest.approx([0.115, 0.638, 216.5], rel=0.005)


@pytest.mark.parametrize("case", Case)
@pytest.mark.parametrize("shape", ["squared", "absolute"])
def test_the_compiled_run_is_the_readable_run(case, shape):
    fallback = "nominal" if shape == "squared" else "best_effort"
    short = replace(FIT.with_barrier(shape=shape, fallback=fallback), duration_s=12.0)
    compiled, readable = (each(short, case, 4).record for each in (run, run_readable))
    assert np.abs(compiled - readable).max() < 1e-11


def test_the_compiled_run_is_the_readable_one_on_other_paths_with_wrong_and_lost_ranges():
    for path in ("sine", "circle"):
        scenario = with_target(FIT, path=path, width_m=0.8, period_s=60.0, speed_m_s=0.03)
        scenario = replace(
            scenario, duration_s=12.0, range_steps=3, outlier_share=0.1, lost_share=0.2
        )
        compiled, readable = (
            each(scenario, Case.OFETV_CBF, 4).record for each in (run, run_readable)
        )
        assert np.abs(compiled - readable).max() < 1e-11
        assert compiled[-1, metrics.TARGET_NORTH] != compiled[0, metrics.TARGET_NORTH]


def test_the_same_seed_gives_the_same_run_and_another_does_not():
    first, again, other = (run(FIT, Case.OF_CBF, seed).record for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_without_the_barrier_the_estimate_is_mirrored_and_the_target_is_lost():
    free = [run(FIT, Case.OF, seed).score for seed in UNSEEN]
    assert np.mean([score.is_lost for score in free]) >= 0.9
    assert all(score.is_mirrored for score in free if score.is_lost)
    for case in (Case.OF_CBF, Case.OFETV_CBF):
        kept = [run(FIT, case, seed).score for seed in UNSEEN]
        assert not any(score.is_lost for score in kept)


def test_a_steep_alpha_is_a_trap_with_the_nominal_fallback_and_none_with_best_effort():
    steep = FIT.with_barrier(slope=1.0)
    best = steep.with_barrier(fallback="best_effort")
    trapped, saved = (
        np.mean([run(scenario, Case.OF_CBF, seed).score.is_lost for seed in UNSEEN])
        for scenario in (steep, best)
    )
    assert trapped >= 0.9
    assert saved <= 0.05


def test_started_straight_at_the_target_only_the_absolute_barrier_can_turn_away():
    ahead = replace(STATIC, start=(-5.0, 0.0, 0.0, 0.1), duration_s=20.0)
    dead, alive = (
        run(ahead.with_barrier(shape=shape), Case.SF_CBF, 0).score
        for shape in ("squared", "absolute")
    )
    assert dead.infeasible_share == 1.0
    assert dead.inverse_condition_s == pytest.approx(0.0, abs=1e-9)
    assert alive.infeasible_share == 0.0
    assert alive.inverse_condition_s > 0.5


def record_of(tau, tau_hat):
    record = np.zeros((1000, metrics.RECORD_SIZE))
    record[:, [metrics.NORTH, metrics.EAST]] = tau
    record[:, [metrics.ESTIMATE_NORTH, metrics.ESTIMATE_EAST]] = tau_hat
    return record


def test_an_estimate_is_mirrored_if_its_range_is_right_and_its_error_twice_that():
    assert metrics.score(record_of((2.0, 0.0), (-2.0, 0.1)), 0.1).is_mirrored
    assert not metrics.score(record_of((2.0, 0.0), (2.1, 0.3)), 0.1).is_mirrored
    assert not metrics.score(record_of((2.0, 0.0), (-6.0, 0.0)), 0.1).is_mirrored
    healed = record_of((2.0, 0.0), (-2.0, 0.0))
    healed[600:, metrics.ESTIMATE_NORTH] = 2.0
    assert not metrics.score(healed, 0.1).is_mirrored


def test_a_score_is_the_mean_of_errors_and_the_sum_of_the_inverse_condition():
    record = record_of((3.0, 4.0), (3.0, 3.0))
    record[:, metrics.INVERSE_CONDITION] = 0.5
    record[:250, metrics.STATUS] = 2.0
    score = metrics.score(record, 0.1)
    assert score.estimation_error_m == pytest.approx(1.0)
    assert score.tracking_error_m == pytest.approx(5.0)
    assert score.is_lost
    assert score.inverse_condition_s == pytest.approx(50.0)
    assert score.infeasible_share == 0.25


def test_the_tracker_finds_the_right_side_where_the_single_filter_is_mirrored():
    steep = TrackingConfig(barrier=BarrierConfig(epsilon=0.012, slope=1.0))
    some = random_scenarios(0, 124, steep)
    for n in (45, 123):
        assert run(some[n], Case.OFETV_CBF, n).score.is_mirrored
        followed = run_tracker(some[n], Case.OFETV_CBF, n)
        assert not followed.score.is_mirrored
        assert not followed.score.is_lost
        assert followed.record[:, metrics.SPEED].max() < 0.62  # the cap, where the noise is not


def test_the_tracker_runs_on_the_same_random_numbers_and_has_no_state_feedback():
    short = replace(FIT, config=TrackingConfig(target=FIT.config.target), duration_s=6.0)
    single, tracked = (each(short, Case.OF_CBF, 2).record for each in (run, run_tracker))
    first = [metrics.ESTIMATE_NORTH, metrics.ESTIMATE_EAST]
    assert tracked[0, first] == pytest.approx(single[0, first], abs=1e-9)
    with pytest.raises(ValueError, match="SF"):
        run_tracker(short, Case.SF, 2)
