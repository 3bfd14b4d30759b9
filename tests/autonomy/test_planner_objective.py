import dataclasses
import math

import numpy as np
import pytest

from autonomy.field.model.kernel import covariance
from autonomy.planner.belief import averaged_samples, sample_noise
from autonomy.planner.config import ErgodicConfig
from autonomy.planner.leg.edge import propose_edge, random_shape
from autonomy.planner.objective import (
    ErgodicMeasure,
    InformationGain,
    MutualInformation,
    target_distribution,
)
from tests.autonomy.planner_problem import START, THESIS_TANK, belief_over

THRESHOLDS = (0.03, 0.06)
SHAPES = ("matern12", "matern32", "matern52", "squared_exponential")
COUNTS = ("none", "levels", "noise")


def counted(belief, counts):
    """The belief and the noise of its samples, where position uncertainty counts so."""
    config = THESIS_TANK.model_copy(
        update={"fidelity_counts": counts != "none", "fidelity_thresholds_m": THRESHOLDS}
    )
    belief = dataclasses.replace(belief, counts="levels" if counts == "levels" else "noise")
    return belief, sample_noise(config, belief)


def exact(belief):
    return counted(belief, "none")


def some_points(number=3, seed=0):
    """Planned points of a few edges, one behind another."""
    rng = np.random.default_rng(seed)
    points = []
    while len(points) < number:
        edge = propose_edge(THESIS_TANK, START, (1.3, 0.9), 20.0, random_shape(THESIS_TANK, rng))
        if edge is not None:
            points.append(edge.points)
    return np.concatenate(points)


@pytest.mark.parametrize("past", [0, 1, 30])
@pytest.mark.parametrize("counts", COUNTS)
@pytest.mark.parametrize("shape", SHAPES)
def test_mutual_information_is_the_determinants_difference(past, counts, shape):
    belief = dataclasses.replace(belief_over(THESIS_TANK.domain, past=past), shape=shape)
    points = some_points()
    plain = InformationGain(*counted(belief, counts))(points)
    symmetric = MutualInformation(*counted(belief, counts))(points)
    assert plain > 1.0
    assert symmetric == pytest.approx(plain, abs=2e-6)


def test_samples_of_other_robots_to_come_count_like_past_ones():
    belief = belief_over(THESIS_TANK.domain, past=20)
    others = some_points(seed=3)
    informed = dataclasses.replace(belief, planned_points=others[:, 1:4], planned_std=others[:, 4])
    flown = dataclasses.replace(
        belief,
        sample_points=np.concatenate([belief.sample_points, others[:, 1:4]]),
        sample_position_std=np.concatenate([belief.sample_position_std, others[:, 4]]),
    )
    points = some_points()
    gain = MutualInformation(*counted(informed, "noise"))(points)
    assert gain == pytest.approx(MutualInformation(*counted(flown, "noise"))(points), rel=1e-9)
    assert gain < MutualInformation(*counted(belief, "noise"))(points)


def test_only_test_points_in_the_mask_count():
    belief = belief_over(THESIS_TANK.domain)
    mask = belief.test_points[:, 0] < 1.5
    half = belief.within(mask)
    assert len(half.test_points) == len(half.mean) == len(half.std) == mask.sum()
    points = some_points()
    assert InformationGain(*exact(half))(points) < InformationGain(*exact(belief))(points)


def test_a_displaced_sample_is_as_noisy_as_the_field_changes_across_the_displacement():
    rng = np.random.default_rng(0)
    belief = dataclasses.replace(belief_over(THESIS_TANK.domain), shape="squared_exponential")
    away = np.array([[0.4, 0.4, 0.0], [0.0, 0.0, 0.0]])
    prior = covariance(away, away, belief.kernel()) + 1e-12 * np.eye(2)
    fields = rng.multivariate_normal(np.zeros(2), prior, size=200_000)  # (200000, 2)
    expected = np.square(fields[:, 0] - fields[:, 1]).mean()
    assert belief.displacement_noise(np.array([0.4]))[0] == pytest.approx(expected, rel=0.02)


def test_more_samples_never_bring_less_information():
    gain = MutualInformation(*exact(belief_over(THESIS_TANK.domain)))
    points = some_points()
    gains = [gain(points[:count]) for count in range(1, len(points))]
    assert (np.diff(gains) > -1e-9).all()


def test_information_of_two_trajectories_is_at_most_the_sum():
    gain = MutualInformation(*exact(belief_over(THESIS_TANK.domain)))
    one, two = some_points(1, seed=1), some_points(1, seed=2)
    assert gain(np.concatenate([one, two])) <= gain(one) + gain(two)


def test_one_sample_brings_what_a_textbook_says():
    belief = dataclasses.replace(
        belief_over(THESIS_TANK.domain, past=0), test_points=np.array([[1.0, 1.0, 0.0]])
    )
    point = np.array([[2.0, 1.0, 1.0, 0.0, 0.0]])
    expected = 0.5 * math.log(1.0 + belief.signal_variance / belief.noise_variance)
    assert InformationGain(*exact(belief))(point) == pytest.approx(expected, rel=1e-6)


def test_worse_located_samples_bring_less_information():
    gain = MutualInformation(*counted(belief_over(THESIS_TANK.domain), "levels"))
    points = some_points()
    gains = []
    for std in (0.02, 0.05, 0.1):
        points[:, 4] = std
        gains.append(gain(points))
    assert gains[0] > gains[1] > gains[2]


def test_a_level_is_as_noisy_as_its_threshold_and_the_gradient_make_it():
    belief = belief_over(THESIS_TANK.domain, lengths=(2.0, 4.0, 1.0))
    gradient = 3.0 * 5.27 * (1.0 / 4.0 + 1.0 / 16.0)
    belief, levels = counted(belief, "levels")
    noise = levels.of(belief, np.array([0.0, 0.03, 0.031, 0.06, 0.2]))
    middle, worst = (0.0025 + gradient * threshold**2 for threshold in THRESHOLDS)
    np.testing.assert_allclose(noise, [0.0025, 0.0025, middle, middle, worst], rtol=0.05)


def test_samples_without_a_known_position_error_count_as_exact():
    belief = dataclasses.replace(belief_over(THESIS_TANK.domain), sample_position_std=None)
    _, noise = belief.known_samples(counted(belief, "noise")[1])
    np.testing.assert_allclose(noise, 0.0025)


def test_averaging_keeps_the_weight_of_all_samples():
    rng = np.random.default_rng(0)
    points, noise = rng.random((103, 3)), 0.1 + rng.random(103)
    centre, variance = averaged_samples(points, noise, 25)
    assert len(centre) == len(variance) <= 25
    assert (1.0 / variance).sum() == pytest.approx((1.0 / noise).sum())
    weighted = (centre / variance[:, None]).sum(axis=0)
    np.testing.assert_allclose(weighted, (points / noise[:, None]).sum(axis=0))


def test_averaged_past_samples_leave_almost_the_same_information():
    belief = belief_over(THESIS_TANK.domain, past=200)
    points = some_points()
    every, half = (MutualInformation(*exact(belief), limit)(points) for limit in (200, 100))
    assert half == pytest.approx(every, rel=0.02)


def test_few_samples_are_not_averaged():
    points, noise = np.ones((5, 3)), np.ones(5)
    kept, variance = averaged_samples(points, noise, 5)
    assert kept is points
    assert variance is noise


def test_ergodic_measure_is_the_divergence_written_out():
    belief = belief_over(THESIS_TANK.domain)
    config = ErgodicConfig()
    points = some_points()
    p = target_distribution(belief, config.exploitation)
    q = np.zeros(len(p))
    for i, test in enumerate(belief.test_points):
        for point in points:
            x, y, z = (point[1:4] - test) / (0.25, 0.25, 0.15)
            q[i] += math.exp(-0.5 * (x * x + y * y + z * z))
    q = q / q.sum() + 1e-12
    expected = -sum(p[i] * math.log(p[i] / q[i]) for i in range(len(p)))
    assert ErgodicMeasure(belief, config)(points) == pytest.approx(expected, rel=1e-12)


def test_time_spent_where_it_should_be_measures_best():
    belief = dataclasses.replace(belief_over(THESIS_TANK.domain))
    measure = ErgodicMeasure(belief, ErgodicConfig())
    everywhere = np.zeros((len(belief.test_points), 5))
    everywhere[:, 1:4] = belief.test_points
    one_corner = everywhere[:1]
    assert measure(one_corner) < measure(everywhere) <= 0.0


def test_a_trajectory_that_reaches_no_test_point_is_bad_but_finite():
    measure = ErgodicMeasure(belief_over(THESIS_TANK.domain), ErgodicConfig())
    value = measure(np.array([[1.0, 500.0, 500.0, 0.0, 0.01]]))
    assert -30.0 < value < -20.0


def test_exploitation_moves_the_target_to_high_values():
    belief = belief_over(THESIS_TANK.domain)
    explore, exploit = (target_distribution(belief, weight) for weight in (0.0, 1.0))
    assert explore.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(explore, explore[0])
    assert exploit.argmax() == belief.mean.argmax()
