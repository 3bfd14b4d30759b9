"""Samples carried along with the water, and what that is worth."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from autonomy.field.carriage import carried, drifted
from autonomy.field.config import FieldConfig, KernelParameters
from autonomy.field.model.kernel import covariance
from autonomy.field.model.model import condition
from autonomy.field.reckoning import ErrorScale, located_std_m, position_error_covariance
from autonomy.field.samples import FieldSamples
from autonomy.field.score import score
from autonomy.site import LAKE

KERNEL = KernelParameters(
    signal_variance=2.0, length_x_m=256.0, length_y_m=256.0, length_z_m=9.9, noise_variance=0.09
)
SURVEY_S = 6.0 * 3600.0
NOISE = 0.3


@dataclass(frozen=True)
class Way:
    mean_ne_m: np.ndarray
    cov_m2: np.ndarray


@dataclass(frozen=True)
class Steady:
    """A current that is the same everywhere, known to a standard deviation per axis."""

    current_ne_m_s: tuple[float, float]
    std_m_s: float = 0.0

    def carriage(self, place_ned, from_s, to_s):
        duration_s = to_s - from_s
        doubt = (self.std_m_s * duration_s) ** 2 * np.eye(2)
        return Way(duration_s * np.array(self.current_ne_m_s), doubt)


def lawnmower(current_ne_m_s, seed):
    """A survey of six hours of a field that moves bodily, and the field at its end."""
    rng = np.random.default_rng(seed)
    dives, each = 30, 10
    n = dives * each
    time_s = np.linspace(0.0, SURVEY_S, n)
    line = np.arange(n) / n
    north, east = 480.0 * line + 10.0, 250.0 + 240.0 * np.sin(12.0 * math.pi * line)
    depth = 8.0 + 7.0 * np.sin(2.0 * math.pi * np.arange(n) / each)
    points = np.column_stack([north, east, depth])
    targets = rng.uniform([0.0, 0.0, 0.0], [500.0, 500.0, 18.0], (150, 3))
    moved = points.copy()
    moved[:, :2] += (SURVEY_S - time_s)[:, None] * np.array(current_ne_m_s)  # the water's place now
    both = np.concatenate([moved, targets])
    drawn = np.linalg.cholesky(covariance(both, both, KERNEL) + 1e-8 * np.eye(len(both)))
    field = drawn @ rng.standard_normal(len(both))
    values = 5.0 + field[:n] + NOISE * rng.standard_normal(n)
    samples = FieldSamples.of(
        points, values, np.full(n, 1.5), dive=np.repeat(np.arange(dives), each), time_s=time_s
    )
    return samples, targets, 5.0 + field[n:]


CONFIG = FieldConfig(
    variable="chlorophyll",
    scale="linear",
    prior_mean=5.0,
    single=KERNEL,
    carriage="water",
    fidelity_thresholds_m=(2.0, 4.0),
)


def test_still_water_without_doubt_changes_nothing():
    samples, targets, _ = lawnmower((0.0, 0.0), 0)
    same = carried(samples, Steady((0.0, 0.0)), SURVEY_S, LAKE.domain)
    before, after = condition(CONFIG, samples), condition(CONFIG, same)
    np.testing.assert_allclose(after.mean(targets), before.mean(targets), atol=1e-12)
    np.testing.assert_allclose(after.variance(targets), before.variance(targets), atol=1e-12)


def test_the_doubt_of_the_way_is_an_error_that_all_samples_have_in_common():
    samples, _, _ = lawnmower((0.0, 0.0), 0)
    moved = carried(samples, Steady((0.0, 0.0), 0.004), SURVEY_S, LAKE.domain)
    first, second = np.flatnonzero(moved.dive == 0), np.flatnonzero(moved.dive == 1)
    doubt_m, next_m = (0.004 * (SURVEY_S - samples.time_s[mine].mean()) for mine in (first, second))
    before = position_error_covariance(samples, samples)[np.ix_(first, first)]
    after = position_error_covariance(moved, moved)
    np.testing.assert_allclose(after[np.ix_(first, first)], before + doubt_m**2, rtol=1e-9)
    np.testing.assert_allclose(after[np.ix_(first, second)], doubt_m * next_m, rtol=1e-9)
    std_m = located_std_m(moved, ErrorScale())[first]
    np.testing.assert_allclose(std_m, np.hypot(1.5, doubt_m))


def test_samples_whose_water_has_gone_far_outside_are_left_out():
    samples, _, _ = lawnmower((0.0, 0.0), 0)
    kept = carried(samples, Steady((0.05, 0.0)), SURVEY_S, LAKE.domain)
    assert 0 < len(kept) < len(samples)
    assert kept.points[:, 0].max() <= 1.5 * 500.0
    assert kept.time_s.min() > samples.time_s.min()


def test_carried_samples_map_moving_water_better_and_more_honestly():
    still, moved = [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        course = rng.uniform(0.0, 2.0 * math.pi)
        true = 0.01 * np.array([math.cos(course), math.sin(course)])
        believed = true + 0.004 * rng.standard_normal(2)
        samples, targets, truth = lawnmower(true, seed)
        carrier = Steady((believed[0], believed[1]), 0.004)
        there = carried(samples, carrier, SURVEY_S, LAKE.domain)
        for scores, taken in ((still, samples), (moved, there)):
            model = condition(CONFIG, taken)
            scores.append(score(model.mean(targets), model.covariance(targets), truth))
    assert np.mean([s.rmse for s in moved]) <= 0.9 * np.mean([s.rmse for s in still])
    assert np.mean([s.coverage_90 for s in moved]) > np.mean([s.coverage_90 for s in still])
    assert np.mean([s.nlpd for s in moved]) < np.mean([s.nlpd for s in still]) - 1.0


def test_the_way_of_the_oldest_quarter_is_what_is_told():
    samples, _, _ = lawnmower((0.0, 0.0), 0)
    told = drifted(samples, Steady((0.01, 0.0), 0.004), SURVEY_S)
    assert told is not None
    assert told.way_m == pytest.approx(0.01 * 0.875 * SURVEY_S, rel=0.03)
    assert told.std_m == pytest.approx(0.4 * told.way_m, rel=0.05)
    assert drifted(FieldSamples.none(), Steady((0.01, 0.0)), SURVEY_S) is None


@pytest.mark.parametrize("model", ["single", "recursive", "joint"])
def test_models_that_cannot_count_the_doubt_refuse_in_words(model):
    with pytest.raises(ValueError, match="no other counts how unsure it is"):
        FieldConfig(carriage="water", model=model)
