"""Trial flights: every estimator's errors are as large as it says, and the table of gains."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.estimation.config import (
    ESTIMATOR_PRESETS,
    MODEL_FILTER_PRESETS,
)
from autonomy.estimation.model_filter import ModelFilter
from autonomy.estimation.tag_filter import TagFilterConfig
from benchmarks.estimation.estimation import (
    STEADY_M_S,
    TANK_DIVE_S,
    flight,
    squares,
    water_of,
    wrong_model,
)
from benchmarks.estimation.estimation_trial.consistency import (
    bounds,
    consistency,
    normalized_error_squared,
)
from benchmarks.estimation.estimation_trial.dead_reckoning import DEAD_RECKONING_PRESETS
from benchmarks.estimation.estimation_trial.follow import (
    Track,
    by_dead_reckoning,
    by_model_filter,
    by_position_filter,
    by_tag_filter,
    observed_velocity,
    observer_covariance,
)
from benchmarks.estimation.estimation_trial.trial_flight import (
    PERIOD_S,
    Flight,
    TagErrors,
    sightings,
)
from benchmarks.estimation.observer_table import Case, errors, true_run
from simulator.fleet import GRACE_1, MINI_1, RobotDefinition

RUNS = 10
ROBOTS = pytest.mark.parametrize("robot", [MINI_1, GRACE_1], ids=["miniglider", "grace3"])


@pytest.fixture(scope="module")
def flights() -> dict[str, list[Flight]]:
    """Seeded flights of each robot in a steady current and eddies."""
    return {
        robot.vehicle.key: [
            flight(robot, seed, STEADY_M_S[robot.vehicle.key], dive_s) for seed in range(RUNS)
        ]
        for robot, dive_s in ((MINI_1, 150.0), (GRACE_1, 300.0))
    }


def judge(values: list[np.ndarray], dimensions: int):
    return consistency(np.array(values)[:, 10:], dimensions)


@ROBOTS
def test_model_filter_and_dead_reckoning_err_as_they_say_and_the_filter_far_less(
    robot: RobotDefinition, flights: dict[str, list[Flight]]
) -> None:
    key = robot.vehicle.key
    estimator = ESTIMATOR_PRESETS[key]
    change = {"current": water_of(robot, STEADY_M_S[key])}
    reckoned, modelled = [], []
    for flown in flights[key]:
        _, ned = observed_velocity(flown, robot.vehicle, estimator)
        config = DEAD_RECKONING_PRESETS[key].model_copy(update=change)
        reckoned.append(by_dead_reckoning(flown, ned, estimator, config))
        model = MODEL_FILTER_PRESETS[key].model_copy(update=change)
        modelled.append(by_model_filter(flown, robot.vehicle, estimator, model).position)
    for tracks in (reckoned, modelled):
        judged = judge([squares(track) for track in tracks], 2)
        assert not judged.is_overconfident
        assert judged.doubt < 1.5
    late = [flown.truth[3000:, 2] > 0.1 for flown in flights[key]]
    without, with_filter = (
        math.sqrt(
            np.mean(
                np.concatenate(
                    [np.square(t.error[3000:][u]).sum(1) for t, u in zip(tracks, late, strict=True)]
                )
            )
        )
        for tracks in (reckoned, modelled)
    )
    assert with_filter < 0.5 * without


@ROBOTS
def test_velocities_and_ballast_by_a_wrong_model_err_no_more_than_they_say(
    robot: RobotDefinition, flights: dict[str, list[Flight]]
) -> None:
    key = robot.vehicle.key
    estimator, model = ESTIMATOR_PRESETS[key], MODEL_FILTER_PRESETS[key]
    blind = model.model_copy(update={"model_error": 0.0})
    under = np.all([flown.truth[::10, 2] > 0.1 for flown in flights[key]], axis=0)
    values = {name: [] for name in ("filter", "blind", "right", "observer", "ballast")}
    for seed, flown in enumerate(flights[key][:6]):
        wrong = wrong_model(robot.vehicle, seed)
        track = by_model_filter(flown, wrong, estimator, model)
        values["filter"].append(squares(track.velocity)[under])
        values["ballast"].append(squares(track.bias)[300:])
        by_blind = by_model_filter(flown, wrong, estimator, blind).velocity
        values["blind"].append(squares(by_blind)[under])
        by_right = by_model_filter(flown, robot.vehicle, estimator, model).velocity
        values["right"].append(squares(by_right)[under])
        body, _ = observed_velocity(flown, wrong, estimator)
        doubt = observer_covariance(flown, body, wrong, estimator, model)
        observed = Track(flown.truth[:, 6:9] - body, doubt)
        values["observer"].append(squares(observed)[under])
    judged = {
        name: consistency(np.array(found), 1 if name == "ballast" else 3)
        for name, found in values.items()
    }
    for name in ("filter", "right", "observer", "ballast"):
        assert not judged[name].is_overconfident, name
    assert judged["filter"].doubt < 2.0
    assert judged["observer"].doubt < 2.0
    assert judged["right"].doubt < 3.0
    assert judged["blind"].mean > 100.0


@ROBOTS
def test_the_position_filter_errs_as_it_says_because_its_velocity_follows_the_eddies(
    robot: RobotDefinition,
) -> None:
    estimator = ESTIMATOR_PRESETS[robot.vehicle.key]
    dive_s = {"miniglider": 150.0, "grace3": 300.0}[robot.vehicle.key]
    stiff = estimator.model_copy(
        update={"acceleration_density": estimator.acceleration_density / 30.0}
    )
    values, by_stiff = [], []
    for seed in range(2 * RUNS):
        flown = flight(robot, seed, 0.0, dive_s)
        _, ned = observed_velocity(flown, robot.vehicle, estimator)
        values.append(squares(by_position_filter(flown, ned, estimator)))
        by_stiff.append(squares(by_position_filter(flown, ned, stiff)))
    judged = judge(values, 2)
    assert not judged.is_overconfident
    assert judged.doubt < 1.3
    assert judge(by_stiff, 2).is_overconfident


def test_the_tag_filter_errs_as_it_says_with_outliers_and_long_gaps() -> None:
    values = []
    for seed in range(RUNS):
        flown = flight(MINI_1, seed, 0.0, TANK_DIVE_S)
        poses, seen = sightings(flown, TagErrors(), np.random.default_rng([seed, 7]))
        assert 0.4 < seen.mean() < 0.9
        values.append(squares(by_tag_filter(flown, poses, seen, TagFilterConfig())))
    judged = judge(values, 4)
    assert not judged.is_overconfident
    assert judged.doubt < 1.1


def test_trial_flights_and_the_filter_on_board_are_the_same_filter(
    flights: dict[str, list[Flight]],
) -> None:
    flown = flights["miniglider"][0]
    estimator = ESTIMATOR_PRESETS["miniglider"]
    model = MODEL_FILTER_PRESETS["miniglider"]
    follower = ModelFilter(
        estimator,
        model,
        MINI_1.vehicle,
        (0.0, 0.0, 0.0),
        estimator.fix_std_m,
        attitude_rad=flown.attitude[0],
        angular_velocity_rad_s=flown.gyro[0],
        actuators=flown.actuators[0],
    )
    for k in range(800):
        fix = tuple(flown.fix_ne[k].tolist()) if flown.has_fix[k] else None
        follower.step(
            PERIOD_S,
            flown.command[k],
            k * PERIOD_S,
            attitude_rad=flown.attitude[k],
            angular_velocity_rad_s=flown.gyro[k],
            actuators=flown.actuators[k],
            depth_m=float(flown.depth_m[k]),
            fix_ne=fix,
        )
    track = by_model_filter(flown, MINI_1.vehicle, estimator, model)
    error = flown.truth[799, :2] - follower.position_ned[:2]
    assert error == pytest.approx(track.position.error[799], abs=1e-9)
    assert follower.position_covariance == pytest.approx(track.position.covariance[799], rel=1e-9)


def test_the_same_seed_flies_the_same_flight_and_another_does_not() -> None:
    a, b, c = (flight(MINI_1, seed, 0.02, 150.0) for seed in (4, 4, 5))
    assert np.array_equal(a.truth, b.truth)
    assert np.array_equal(a.depth_m, b.depth_m)
    assert not np.array_equal(a.truth, c.truth)


def test_errors_drawn_from_their_covariance_are_consistent_and_bolder_ones_are_not() -> None:
    rng = np.random.default_rng(0)
    A = rng.standard_normal((3, 3))
    P = A @ A.T + np.eye(3)
    error = rng.standard_normal((100, 200, 3)) @ np.linalg.cholesky(P).T
    honest = consistency(normalized_error_squared(error, np.broadcast_to(P, (100, 200, 3, 3))), 3)
    assert honest.low <= honest.mean <= honest.high
    assert honest.mean == pytest.approx(3.0, abs=0.06)
    assert 0.9 < honest.share_inside <= 1.0
    assert honest.doubt == pytest.approx(1.0, abs=0.01)
    bold = normalized_error_squared(error, np.broadcast_to(P / 1.1, (100, 200, 3, 3)))
    assert consistency(bold, 3).is_overconfident
    assert bounds(100, 2) == pytest.approx((1.627, 2.411), abs=0.001)


@pytest.mark.parametrize(("correlation", "draws"), [(1, 600.0), (20, 30.0), (600, 1.0)])
def test_errors_that_last_count_as_fewer_draws(correlation: int, draws: float) -> None:
    rng = np.random.default_rng(1)
    error = np.repeat(rng.standard_normal((200, 600 // correlation, 2)), correlation, axis=1)
    judged = consistency(np.sum(error**2, axis=2), 2)
    assert judged.draws == pytest.approx(draws, rel=0.3)
    assert (judged.low, judged.high) == pytest.approx(bounds(200 * judged.draws, 2))


def test_ten_runs_are_enough_to_find_a_covariance_that_is_too_small() -> None:
    rng = np.random.default_rng(2)
    error = np.repeat(rng.standard_normal((10, 20, 2)), 30, axis=1)
    honest = np.sum(error**2, axis=2)
    assert not consistency(honest, 2).is_overconfident
    assert consistency(1.6 * honest, 2).is_overconfident
    assert bounds(10, 2)[1] > 1.6 * 2.0


def test_consistency_of_nothing_or_of_no_number_is_refused() -> None:
    for bad in (np.empty((0, 3)), np.full((2, 2), math.nan), np.zeros(3)):
        with pytest.raises(ValueError, match="finite squares"):
            consistency(bad, 2)


def test_an_observer_with_injection_forgets_a_wrong_start_and_strong_gains_let_noise_in() -> None:
    runs = [true_run(seed) for seed in range(4)]

    def error(gains: tuple[float, float], case: Case) -> np.ndarray:
        return 1e3 * np.array([errors(run, gains, case, k) for k, run in enumerate(runs)])

    exact = {gains: error(gains, Case("exact")) for gains in ((0.0, 0.0), (0.25, 1.0), (1.0, 2.0))}
    size = {gains: np.median(np.linalg.norm(e, axis=2), axis=0) for gains, e in exact.items()}
    assert all(later[299] < 0.3 * later[99] for later in size.values())
    assert size[1.0, 2.0][99] < size[0.25, 1.0][99] < size[0.0, 0.0][99]

    def rms(gains: tuple[float, float], case: Case) -> np.ndarray:
        return np.sqrt(np.mean(error(gains, case)[:, -600:] ** 2, axis=(0, 1)))

    noise, bias = Case("noise", 1.0), Case("bias", 1.0, bias_kg=0.002)
    assert rms((0.0, 0.0), bias)[0] == pytest.approx(4.5, abs=0.6)
    assert rms((0.25, 1.0), bias)[0] == pytest.approx(2.4, abs=0.4)
    assert rms((1.0, 2.0), bias)[0] == pytest.approx(1.5, abs=0.3)
    assert rms((0.25, 1.0), noise) == pytest.approx([0.12, 0.18, 0.15], abs=0.08)
    assert rms((25.0, 10.0), noise)[0] > 3.0
    assert rms((0.25, 1.0), replace(noise, parameter_error=0.1)).max() < 3.0
