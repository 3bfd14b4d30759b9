"""A kernel that was told wrong, and what a survey's dives say of it."""

import math

import numpy as np
import pytest

from autonomy.field.config import FieldConfig, KernelParameters
from autonomy.field.grid import Grid
from autonomy.field.live.live_map import LiveMap
from autonomy.field.model.adaptation import adapted, left_out_density, scaled_kernel
from autonomy.field.model.kernel import covariance
from autonomy.field.model.model import condition
from autonomy.field.samples import FieldSamples
from autonomy.field.score import score
from autonomy.site import TANK

TRUE = KernelParameters(
    signal_variance=0.8, length_x_m=1.2, length_y_m=1.0, length_z_m=0.9, noise_variance=0.0025
)
DIVES, EACH = 12, 12
MEAN = 5.0


def surveyed(seed):
    """Straight dives through a field drawn from the true kernel, and the field elsewhere."""
    rng = np.random.default_rng(seed)
    low, high = np.zeros(3), np.array([2.75, 1.37, 0.65])
    ends = rng.uniform(low, high, (DIVES, 2, 3))
    share = np.linspace(0.0, 1.0, EACH)[:, None]
    points = np.concatenate([(1.0 - share) * a + share * b for a, b in ends])
    targets = rng.uniform(low, high, (120, 3))
    both = np.concatenate([points, targets])
    drawn = np.linalg.cholesky(covariance(both, both, TRUE) + 1e-8 * np.eye(len(both)))
    field = drawn @ rng.standard_normal(len(both))
    values = field[: len(points)] + 0.05 * rng.standard_normal(len(points))
    samples = FieldSamples.of(
        points, np.exp(MEAN + values), np.zeros(len(points)), dive=np.repeat(np.arange(DIVES), EACH)
    )
    return samples, values, targets, field[len(points) :]


def test_the_density_of_dives_left_out_is_that_of_predicting_each_from_the_others():
    samples, values, _, _ = surveyed(0)
    total = covariance(samples.points, samples.points, TRUE) + 0.0025 * np.eye(len(values))
    groups = [np.flatnonzero(samples.dive == number) for number in range(DIVES)]
    expected = 0.0
    for mine in groups:
        rest = np.setdiff1d(np.arange(len(values)), mine)
        gain = np.linalg.solve(total[np.ix_(rest, rest)], total[np.ix_(rest, mine)]).T
        error = values[mine] - gain @ values[rest]
        left = total[np.ix_(mine, mine)] - gain @ total[np.ix_(rest, mine)]
        expected -= 0.5 * (
            error @ np.linalg.solve(left, error)
            + np.linalg.slogdet(left)[1]
            + len(mine) * math.log(2.0 * math.pi)
        )
    assert left_out_density(total, values, groups) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("wrong", [0.1, 8.0])
def test_a_signal_variance_that_was_told_wrong_is_found_out(wrong):
    told, right = [], []
    for seed in range(4):
        samples, _, targets, truth = surveyed(seed)
        config = FieldConfig(
            single=scaled_kernel(TRUE, wrong, 1.0), levels=(TRUE,) * 3, prior_mean=MEAN
        )
        for scores, adapts in ((told, False), (right, True)):
            model = condition(config.model_copy(update={"adapts": adapts}), samples)
            scores.append(score(model.mean(targets) - MEAN, model.covariance(targets), truth).wmse)
    assert abs(math.log(np.mean(told))) > math.log(3.0)
    assert abs(math.log(np.mean(right))) < math.log(1.6)


def test_few_dives_leave_the_kernel_as_it_was_told():
    samples, values, _, _ = surveyed(0)
    few = samples.dive < 5
    kernel = scaled_kernel(TRUE, 8.0, 1.0)
    nothing = np.zeros((few.sum(), few.sum()))
    assert adapted(kernel, samples.points[few], values[few], samples.dive[few], nothing) == kernel


def test_a_rebuilt_map_shows_and_predicts_with_the_same_adapted_kernel():
    samples, _, targets, _ = surveyed(1)
    config = FieldConfig(single=scaled_kernel(TRUE, 8.0, 1.0), levels=(TRUE,) * 3, prior_mean=MEAN)
    live = LiveMap(config, Grid.over(TANK.domain, config.grid))
    live.replace(samples)
    model = condition(config, samples)
    np.testing.assert_allclose(live.mean, model.mean(live.grid.points), atol=1e-8)
    np.testing.assert_allclose(live.std**2, model.variance(live.grid.points), atol=1e-8)
    prediction = live.predict(targets)
    np.testing.assert_allclose(prediction.mean, model.mean(targets), atol=1e-8)
    np.testing.assert_allclose(prediction.covariance, model.covariance(targets), atol=1e-8)
