"""The particle filter, as an independent check of the filter bank."""

import math

import numpy as np
import pytest

from autonomy.tracking import particle, unicycle
from autonomy.tracking.bank import Bank, BankInput
from autonomy.tracking.config import FilterConfig
from tests.autonomy.tracking_water import DT_S, NOISE_STD, settings

CONFIG = settings(filter=FilterConfig(target_velocity="known"))
STILL = (0.0, 0.0)
COUNT = 4000


def follow(cloud, bank, pose, turn_rate, seconds, noise, generator):
    for n in range(round(seconds / DT_S)):
        errors = noise.standard_normal(3) * NOISE_STD
        psi, v = pose[2] + errors[1], pose[3] + errors[2]
        range_m = abs(math.hypot(*pose[:2]) + errors[0])
        dt_s, command = DT_S if n else 0.0, (turn_rate, 0.0)
        cloud = particle.predict(cloud, command, dt_s, STILL, CONFIG, generator)
        cloud = particle.update(cloud, psi, v, range_m, CONFIG, generator)
        bank.step(BankInput(dt_s, command, psi, v, (range_m,), STILL))
        pose = unicycle.advance(pose, *command, DT_S)
    return cloud, pose


def test_both_filters_agree_where_the_target_is_well_observed():
    noise, generator = np.random.default_rng(1), np.random.default_rng(2)
    bank = Bank.begin(CONFIG, (-1.3, 0.2), 1.5, 0.4, 0.4)
    cloud = particle.gaussian_cloud((-1.3, 0.2, 1.5, 0.4), 0.4, COUNT, CONFIG, generator)
    cloud, pose = follow(cloud, bank, (-1.0, 0.0, 1.6, 0.4), -0.4, 20.0, noise, generator)
    std = np.sqrt(np.diag(cloud.covariance_m2))
    assert np.abs(np.array(cloud.mean_ne_m) - bank.best.h[:2]).max() < std.max()
    assert std == pytest.approx(np.sqrt(bank.best.h[[4, 8]]), rel=0.25)
    assert math.dist(cloud.mean_ne_m, pose[:2]) < 0.4


def test_on_a_straight_course_both_see_the_target_on_either_side():
    noise, generator = np.random.default_rng(4), np.random.default_rng(104)
    pose = (-2.0, 1.5, 0.0, 0.3)
    bank = Bank.begin(CONFIG, (9.0, 9.0), 0.0, 0.3, 0.4)
    first = math.hypot(*pose[:2])
    cloud = particle.ring_cloud(first, 0.0, 0.3, COUNT, CONFIG, generator)
    cloud, pose = follow(cloud, bank, pose, 0.0, 8.0, noise, generator)
    there, mirrored = pose[:2], (pose[0], -pose[1])
    assert cloud.share_within(there, 0.8) > 0.2
    assert cloud.share_within(mirrored, 0.8) > 0.2
    places = [one.h[:2] for one in bank.hypotheses]
    assert min(math.dist(place, there) for place in places) < 0.8
    assert min(math.dist(place, mirrored) for place in places) < 0.8


def test_a_turn_resolves_a_ring_in_both_to_the_same_place():
    noise, generator = np.random.default_rng(5), np.random.default_rng(6)
    pose = (-2.0, 1.5, 0.0, 0.3)
    bank = Bank.begin(CONFIG, (9.0, 9.0), 0.0, 0.3, 0.4)
    cloud = particle.ring_cloud(2.5, 0.0, 0.3, COUNT, CONFIG, generator)
    cloud, pose = follow(cloud, bank, pose, 0.5, 20.0, noise, generator)
    assert math.dist(cloud.mean_ne_m, pose[:2]) < 0.5
    assert math.dist(bank.best.h[:2], cloud.mean_ne_m) < 0.4


def test_the_same_generator_gives_the_same_cloud():
    clouds = [
        particle.gaussian_cloud((1.0, 0.0, 0.0, 0.1), 0.4, 50, CONFIG, np.random.default_rng(9))
        for _ in range(2)
    ]
    assert (clouds[0].states == clouds[1].states).all()
    assert clouds[0].weights.sum() == pytest.approx(1.0)
