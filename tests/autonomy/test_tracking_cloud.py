"""The cloud of places that all ranges allow, as the beacon navigator uses it."""

import math

import numpy as np
import pytest

from autonomy.tracking.config import FilterConfig
from autonomy.tracking.filter import cloud_kernel
from autonomy.tracking.filter.bank import Bank, BankInput
from autonomy.tracking.filter.cloud import PERSISTENCE, WALK_M_SQRT_S, TargetCloud
from reproduction.tracking import unicycle
from tests.autonomy.lake_target import (
    EAST,
    LAKE,
    NORTH,
    TARGET,
    courses,
    heard_along,
    mirrored,
)
from tests.autonomy.tracking_water import settings


def cloud_after(way, cloud_seed=1, config=LAKE):
    cloud = TargetCloud(config, np.random.default_rng(cloud_seed))
    for n, (pose, range_m) in enumerate(zip(way, heard_along(way), strict=True)):
        cloud.hear(float(n), pose[:2], range_m)
    return cloud


def place(cloud):
    mean, covariance = cloud.moments()
    return mean[:2], math.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[1])


def test_a_straight_course_leaves_the_cloud_of_two_minds_and_a_turn_decides():
    mean, worst_m = place(cloud_after(courses(EAST)))
    between = 0.5 * (np.array(TARGET) + mirrored(TARGET))
    assert math.dist(mean, between) < 0.7 * math.dist(between, TARGET)
    assert worst_m > 0.7 * math.dist(between, TARGET)
    turned = cloud_after(courses(EAST, NORTH))
    mean, worst_m = place(turned)
    assert worst_m < 3.0
    assert math.dist(mean, TARGET) < 3.0
    assert math.hypot(*turned.moments()[0][2:]) < 0.06


def test_bank_and_cloud_agree_where_the_target_is_well_observed():
    """Both are given the same noise: the bank no other of its own, the cloud none that lasts."""
    own = {"heading_density_rad2_s": 1e-9, "speed_density_m2_s3": 1e-9}
    own |= {"heading_variance_rad2": 1e-9, "speed_variance_m2_s2": 1e-9}
    known = FilterConfig(target_velocity="known", position_density_m2_s=WALK_M_SQRT_S**2, **own)
    config = settings((0.3, -0.2), filter=known)
    ranging = config.ranging.model_copy(update={"variance_m2": 0.1 / PERSISTENCE})
    still = known.model_copy(update={"target_speed_std_m_s": 1e-4})
    short = config.model_copy(update={"ranging": ranging, "filter": still})
    cloud = TargetCloud(short, np.random.default_rng(1))
    noise, pose, command = np.random.default_rng(2), (-1.0, 0.0, 1.6, 0.4), (-0.4, 0.0)
    bank = Bank.begin(config, (-1.3, 0.2), *pose[2:], config.target.guess_std_m)
    for n in range(200):
        range_m = abs(math.hypot(*pose[:2]) + math.sqrt(0.1) * noise.standard_normal())
        bank.step(BankInput(0.1 if n else 0.0, command, *pose[2:], (range_m,), (0.0, 0.0)))
        cloud.hear(0.1 * n, pose[:2], range_m)
        newest, pose = pose, unicycle.advance(pose, *command, 0.1)
    mean, covariance = cloud.moments()
    variances = np.diag(covariance)[:2]
    assert variances == pytest.approx(bank.best.h[[4, 8]], rel=0.15)
    place = np.array(newest[:2]) - bank.best.h[:2]
    assert math.dist(place, mean[:2]) < math.sqrt(variances.min())
    assert math.hypot(*place) < 3.0 * math.sqrt(variances.max())


def test_the_same_ranges_and_generator_give_the_same_cloud():
    way = courses(EAST, NORTH)
    first, again, other = (cloud_after(way[:80], cloud_seed=seed) for seed in (1, 1, 2))
    assert first.moments()[0].tolist() == again.moments()[0].tolist()
    assert first.moments()[0].tolist() != other.moments()[0].tolist()


@pytest.mark.parametrize("gate", [1.0, 4.0, 20.0])
@pytest.mark.parametrize("wrong_m", [0.0, 70.0])
def test_ranges_that_contradict_every_place_begin_a_ring_anew(wrong_m, gate):
    way = courses(EAST, NORTH)
    ranging = LAKE.ranging.model_copy(update={"gate": gate})
    cloud = cloud_after(way, config=LAKE.model_copy(update={"ranging": ranging}))
    own = way[-1][:2]
    for n in range(10):
        cloud.hear(150.0 + n, own, math.dist(own, TARGET) + wrong_m)
    assert (place(cloud)[1] > 10.0) is (wrong_m > 0.0)


def test_one_outlier_moves_the_cloud_no_farther_than_a_range_that_agrees():
    way = courses(EAST, NORTH)
    places = []
    for range_m in (500.0, math.dist(way[-1][:2], TARGET)):
        cloud = cloud_after(way)
        cloud.hear(150.0, way[-1][:2], range_m)
        places.append(place(cloud)[0])
    assert math.dist(*places) < 1.0


def test_kernels_are_what_numpy_says():
    rng = np.random.default_rng(3)
    particles, noise = rng.standard_normal((50, 4)), rng.standard_normal((50, 4))
    moved = particles.copy()
    cloud_kernel.drift(moved, 0.5, 0.2, 0.9, 0.1, noise)
    places = particles[:, :2] + 0.5 * particles[:, 2:] + 0.2 * noise[:, :2]
    velocities = 0.9 * particles[:, 2:] + 0.1 * noise[:, 2:]
    assert moved == pytest.approx(np.hstack([places, velocities]))
    weights = rng.random(50)
    weights /= weights.sum()
    weighed = weights.copy()
    likelihood = cloud_kernel.weigh(particles, weighed, 0.3, 0.1, 1.2, 0.4, 2.0)
    off = np.abs(1.2 - np.hypot(particles[:, 0] - 0.3, particles[:, 1] - 0.1)) / 0.4
    expected = weights * np.exp(-0.5 * np.minimum(off, 2.0) ** 2)
    assert likelihood == pytest.approx(math.log(expected.sum()))
    assert weighed == pytest.approx(expected / expected.sum())
    chosen = np.zeros_like(particles)
    cloud_kernel.resample_into(chosen, particles, weighed, 0.4)
    index = np.searchsorted(np.cumsum(weighed), (np.arange(50) + 0.4) / 50)
    assert chosen.tolist() == particles[index].tolist()
