from dataclasses import replace

import numpy as np
import pytest

from autonomy.field.mask import water_mask
from autonomy.field.model.position_noise import slope_correlation
from autonomy.planner.belief import sample_noise
from autonomy.planner.objective import MutualInformation
from autonomy.planner.position_error import (
    difference_correlation,
    error_correlation,
    planned_noise,
)
from autonomy.planner.resolution import drawn_points, fine_part
from autonomy.site import LAKE
from tests.autonomy.planner_problem import THESIS_TANK, belief_over
from tests.autonomy.test_planner_objective import some_points

BELIEF = belief_over(THESIS_TANK.domain)
FIX, DRIFT = 0.01, 0.02


def counting(steady_current=0.0):
    """Settings by which every position error counts."""
    position = THESIS_TANK.position_filter.model_copy(update={"steady_current_m_s": steady_current})
    return sample_noise(
        THESIS_TANK.model_copy(update={"fidelity_counts": True, "position_filter": position}),
        BELIEF,
    )


def two_dives(current=0.0, count=20):
    """Points of two straight dives of 40 s each, as certain as walk and current leave them."""
    time_s = np.arange(1, count + 1) * 2.0
    depth = 0.5 * np.sin(np.pi * time_s / time_s[-1])
    depth[-1] = 0.0
    std = np.sqrt(FIX**2 + DRIFT**2 * time_s + (current * time_s) ** 2)
    dive = np.column_stack([time_s, 0.3 + 0.02 * time_s, 0.5 + 0.0 * time_s, depth, std])
    second = dive + np.array([time_s[-1], 0.8, 0.0, 0.0, 0.0])
    return np.concatenate([dive, second])


@pytest.mark.parametrize("current", [0.0, 0.02])
def test_errors_of_a_dive_are_a_walk_and_a_current(current):
    points = two_dives(current)
    std = points[:, 4]
    shared = error_correlation(points, current) * np.multiply.outer(std, std)
    time_s = np.tile(points[:20, 0], 2)
    first, last = np.minimum.outer(time_s, time_s), np.maximum.outer(time_s, time_s)
    expected = FIX**2 + DRIFT**2 * first + current**2 * first * last
    expected[:20, 20:] = expected[20:, :20] = 0.0
    np.testing.assert_allclose(shared, expected, rtol=1e-9)


def test_field_differs_alike_across_short_displacements_as_its_slopes_are_alike():
    rng = np.random.default_rng(0)
    places = rng.uniform(0.0, 1.0, size=(30, 3))
    belief = replace(BELIEF, shape="matern52")
    expected = slope_correlation(places, places, belief.kernel())
    np.testing.assert_allclose(difference_correlation(belief, places), expected, atol=0.01)


@pytest.mark.parametrize("shape", ["matern12", "matern32", "matern52", "squared_exponential"])
def test_noise_of_a_trajectory_is_a_covariance(shape):
    belief = replace(BELIEF, shape=shape)
    noise = planned_noise(belief, counting(0.03), some_points(5))
    np.testing.assert_allclose(noise, noise.T)
    assert np.linalg.eigvalsh(noise).min() > 0.0


def test_shared_errors_bring_less_than_errors_that_average_out():
    points = two_dives()
    gain = MutualInformation(BELIEF, counting())
    own = points.copy()
    own[:, 3] = 0.0  # at the surface every sample is a dive of its own
    apart, together = own, own.copy()
    together[:, 3] = np.where(points[:, 3] > 0.0, 1e-5, 0.0)
    assert gain(together) < 0.95 * gain(apart)


def test_steady_current_takes_from_what_a_dive_tells():
    calm, carried = two_dives(), two_dives(0.02)
    gain = MutualInformation(BELIEF, counting(0.02))
    assert gain(carried) < gain(calm)


def test_points_to_judge_on_are_in_the_water_and_new_for_every_source_of_chance():
    one, again, other = (
        drawn_points(LAKE.domain, LAKE, np.random.default_rng(seed)) for seed in (0, 0, 1)
    )
    assert len(one) == 1000
    assert water_mask(LAKE, one).all()
    np.testing.assert_array_equal(one, again)
    apart = np.linalg.norm((one[:, None] - other[None]) / (500.0, 500.0, 20.0), axis=2)
    assert apart.min(axis=1).mean() > 0.02


def test_rough_fields_hide_more_between_points():
    parts = [
        fine_part(replace(BELIEF, shape=shape), THESIS_TANK.domain, None, np.random.default_rng(0))
        for shape in ("matern12", "matern32", "matern52")
    ]
    assert parts[0].variance > 10.0 * parts[1].variance > 100.0 * parts[2].variance >= 0.0
