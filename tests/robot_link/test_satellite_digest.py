"""Which samples travel when only few can: those that take most uncertainty from the map."""

import numpy as np
import pytest

from autonomy.field.config import KernelParameters
from autonomy.field.model.kernel import covariance
from robot_link.onboard_settings import DigestSettings
from robot_link.satellite.digest import CANDIDATES_MAX, choose, most_telling
from robot_link.satellite.record import MobileOriginatedContent, compose, read_mobile_originated
from robot_link.satellite.sample_code import packed_samples
from tests.robot_link.satellite_case import KEY, NOW, ROBOT, SYSTEM, sample

KERNEL = KernelParameters(
    signal_variance=17.6, length_x_m=30.0, length_y_m=40.0, length_z_m=5.0, noise_variance=0.08
)
SETTINGS = DigestSettings(KERNEL, (2.0, 4.0), (3.0, 0.5, 0.1))


def variance_left(points, noise, chosen) -> float:
    """Sum of the posterior variance at all points, by the textbook's formula."""
    prior = covariance(points, points, KERNEL)
    if not chosen:
        return float(np.trace(prior))
    across = prior[:, chosen]
    gram = prior[np.ix_(chosen, chosen)] + np.diag(noise[chosen])
    return float(np.trace(prior - across @ np.linalg.solve(gram, across.T)))


def track(count: int, seed: int = 0) -> np.ndarray:
    steps = np.random.default_rng(seed).normal(0.0, (4.0, 4.0, 1.0), (count, 3))
    return np.abs(np.cumsum(steps, axis=0))


def samples_at(points, std_m=2.5):
    stds = np.broadcast_to(std_m, len(points))
    return [
        sample(number, position_ned=tuple(map(float, point)), position_std_m=float(std))
        for number, (point, std) in enumerate(zip(points, stds, strict=True))
    ]


@pytest.mark.parametrize("seed", range(4))
def test_each_choice_is_the_one_that_leaves_the_least_variance(seed):
    points = track(25, seed)
    noise = np.random.default_rng(seed).uniform(0.1, 3.0, len(points))
    chosen = most_telling(points, noise, KERNEL, 8).tolist()
    for count in range(8):
        before = chosen[:count]
        left = {
            one: variance_left(points, noise, [*before, one])
            for one in range(len(points))
            if one not in before
        }
        assert left[chosen[count]] == pytest.approx(min(left.values()), rel=1e-9)


@pytest.mark.parametrize("settings", [SETTINGS, None])
@pytest.mark.parametrize(
    "broken",
    [
        {"value": float("nan")},
        {"value": 1e39},
        {"position_ned": (0.0, float("inf"), 1.0)},
        {"position_std_m": float("nan")},
        {"variable": "rumour"},
    ],
)
def test_sample_that_is_no_number_does_not_keep_the_others_from_travelling(settings, broken):
    good = samples_at(track(5))
    chosen = choose([sample(99, **broken), *good], settings, 340)
    assert {one.sequence for one in chosen} == {one.sequence for one in good}


def test_well_located_sample_is_preferred_at_the_same_place():
    points = np.repeat(track(6), 2, axis=0)
    stds = np.tile([5.0, 1.0], 6)
    chosen = choose(samples_at(points, stds), SETTINGS, 60)
    assert chosen
    assert all(one.position_std_m == 1.0 for one in chosen)


def test_chosen_samples_tell_more_than_the_newest_ones():
    points = track(200)
    noise = np.full(len(points), 0.5)
    chosen = most_telling(points, noise, KERNEL, 10).tolist()
    newest = list(range(len(points) - 10, len(points)))
    assert variance_left(points, noise, chosen) < 0.5 * variance_left(points, noise, newest)


@pytest.mark.parametrize("room", [0, 12, 40, 136, 271])
def test_choice_fits_the_bytes_that_are_allowed(room):
    samples = samples_at(track(60))
    chosen = choose(samples, SETTINGS, room)
    assert len(packed_samples(chosen)) <= room
    if room >= 40:
        assert len(packed_samples(chosen)) > room - 18


def test_record_of_the_longest_size_carries_fifteen_samples_and_more():
    chosen = choose(samples_at(track(300)), SETTINGS, 271)
    content = MobileOriginatedContent(1, samples=chosen)
    found = read_mobile_originated(compose(content, KEY, SYSTEM, 340), KEY, SYSTEM, ROBOT, NOW)
    assert {one.sequence for one in found.samples} == {one.sequence for one in chosen}
    assert len(chosen) >= 15


def test_without_settings_samples_are_spread():
    line = np.stack([np.linspace(0.0, 100.0, 101), np.zeros(101), np.zeros(101)], axis=1)
    norths = sorted(one.position_ned[0] for one in choose(samples_at(line), None, 60))
    assert len(norths) >= 3
    assert norths[-1] - norths[0] >= 50.0


def test_many_samples_at_one_place_and_none_at_all_are_no_trouble():
    assert choose([], SETTINGS, 300) == ()
    crowd = choose(samples_at(np.zeros((3 * CANDIDATES_MAX, 3))), SETTINGS, 200)
    assert len({one.sequence for one in crowd}) == len(crowd) > 5
