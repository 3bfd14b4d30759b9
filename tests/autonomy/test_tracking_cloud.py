"""The cloud of places that all ranges allow, and what it does about a bank that they refute."""

import math

import numpy as np
import pytest

from autonomy.tracking.config import TRACKING_PRESETS, BarrierConfig, FilterConfig
from autonomy.tracking.filter import cloud_kernel
from autonomy.tracking.filter.arbiter import Arbiter
from autonomy.tracking.filter.bank import Bank, BankInput
from autonomy.tracking.filter.cloud import PERSISTENCE, WALK_M_SQRT_S, TargetCloud
from autonomy.tracking.filter.filter_kernel import full_covariance
from autonomy.tracking.filter.late_range import Timeline
from autonomy.tracking.reading import RangeHeard, TrackerReading, TrackerStart
from autonomy.tracking.tracker import Tracker
from reproduction.tracking import unicycle
from tests.autonomy.tracking_water import settings

LAKE = TRACKING_PRESETS["grace3"]
TARGET = (LAKE.target.north_m + 6.0, LAKE.target.east_m - 4.0)
START = (LAKE.target.north_m, LAKE.target.east_m - 24.0)
STD_M = math.sqrt(LAKE.ranging.variance_m2)
SPEED_M_S = 0.12


def mirrored(place):
    """Return the place across the eastward course from ``START``."""
    return (2.0 * START[0] - place[0], place[1])


def courses(*legs):
    """Return a pose each second along legs of a heading and a time, and whither each leads."""
    pose, way = (*START, 0.0, SPEED_M_S), []
    for heading, seconds in legs:
        pose = (pose[0], pose[1], heading, SPEED_M_S)
        for _ in range(seconds):
            way.append(pose)
            pose = unicycle.advance(pose, 0.0, 0.0, 1.0)
    return way


EAST = (0.5 * math.pi, 60)
NORTH = (0.0, 90)


def heard_along(way, seed=1):
    noise = np.random.default_rng(seed)
    return [abs(math.dist(pose[:2], TARGET) + STD_M * noise.standard_normal()) for pose in way]


def cloud_after(way, cloud_seed=1, config=LAKE):
    cloud = TargetCloud(config, np.random.default_rng(cloud_seed))
    for n, (pose, range_m) in enumerate(zip(way, heard_along(way), strict=True)):
        cloud.hear(float(n), pose[:2], range_m)
    return cloud


def test_a_straight_course_leaves_the_cloud_of_two_minds_and_a_turn_decides():
    straight = cloud_after(courses(EAST))
    assert straight.share_near(TARGET) > 0.15
    assert straight.share_near(mirrored(TARGET)) > 0.15
    way = courses(EAST, NORTH)
    turned = cloud_after(way)
    assert turned.share_near(mirrored(TARGET)) < 0.05
    likeliest = turned.likeliest(way[-1][:2])
    assert likeliest.share > 0.8
    assert math.dist(likeliest.place_ne_m, TARGET) < 3.0
    assert math.hypot(*likeliest.velocity_ne_m_s) < 0.06


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
    likeliest = cloud.likeliest(newest[:2])
    variances = np.array(likeliest.covariance_m2)[[0, 2]] - WALK_M_SQRT_S**2
    assert variances == pytest.approx(bank.best.h[[4, 8]], rel=0.15)
    place = np.array(newest[:2]) - bank.best.h[:2]
    assert math.dist(place, likeliest.place_ne_m) < math.sqrt(variances.min())
    assert math.hypot(*place) < 3.0 * math.sqrt(variances.max())


def test_the_same_ranges_and_generator_give_the_same_cloud():
    way = courses(EAST, NORTH)
    first, again, other = (cloud_after(way[:80], cloud_seed=seed) for seed in (1, 1, 2))
    assert first.likeliest(START) == again.likeliest(START)
    assert first.likeliest(START) != other.likeliest(START)


@pytest.mark.parametrize("gate", [1.0, 4.0, 20.0])
@pytest.mark.parametrize("wrong_m", [0.0, 70.0])
def test_ranges_that_contradict_every_place_begin_a_ring_anew(wrong_m, gate):
    way = courses(EAST, NORTH)
    ranging = LAKE.ranging.model_copy(update={"gate": gate})
    cloud = cloud_after(way, config=LAKE.model_copy(update={"ranging": ranging}))
    own = way[-1][:2]
    for n in range(10):
        cloud.hear(150.0 + n, own, math.dist(own, TARGET) + wrong_m)
    assert (cloud.likeliest(own).share < 0.5) is (wrong_m > 0.0)


def test_one_outlier_moves_the_cloud_no_farther_than_a_range_that_agrees():
    way = courses(EAST, NORTH)
    places = []
    for range_m in (500.0, math.dist(way[-1][:2], TARGET)):
        cloud = cloud_after(way)
        cloud.hear(150.0, way[-1][:2], range_m)
        places.append(cloud.likeliest(way[-1][:2]).place_ne_m)
    assert math.dist(*places) < 1.0


def vague(guess_std_m):
    """Return settings whose first guess is right within so much."""
    target = LAKE.target.model_copy(update={"guess_std_m": guess_std_m})
    return LAKE.model_copy(update={"target": target})


def test_a_cloud_without_one_place_is_sure_of_none():
    cloud = TargetCloud(vague(500.0), np.random.default_rng(1))
    cloud.hear(0.0, START, 1000.0)
    assert cloud.likeliest(START).share == 0.0


def test_a_place_is_never_known_without_an_error():
    cloud = TargetCloud(vague(1e-9), np.random.default_rng(1))
    cloud.hear(0.0, START, math.dist(START, (LAKE.target.north_m, LAKE.target.east_m)))
    likeliest = cloud.likeliest(START)
    north_north, north_east, east_east = likeliest.covariance_m2
    covariance = [[north_north, north_east], [north_east, east_east]]
    assert np.linalg.eigvalsh(covariance).min() > 1e-4
    timeline = Timeline(misled(TARGET))
    timeline.follow_instead((6.0, 8.0), likeliest.covariance_m2, likeliest.velocity_ne_m_s)
    for n in range(20):
        given = BankInput(0.1, (0.01, 0.0), 0.5 * math.pi, SPEED_M_S)
        timeline.step(given, (RangeHeard(10.0 + 0.1 * n),))
        for one in timeline.bank.hypotheses:
            assert np.linalg.eigvalsh(full_covariance(one.h[4:14])).min() > 0.0


def misled(place):
    """Return a bank that is sure of a place, as seen from ``START``."""
    relative = (START[0] - place[0], START[1] - place[1])
    return Bank.begin(LAKE, relative, 0.5 * math.pi, SPEED_M_S, 1.0)


def judged(place, way):
    """Let an arbiter watch a bank that is sure of a place; return where it ends by its account."""
    arbiter, timeline = Arbiter(LAKE, START, np.random.default_rng(4)), Timeline(misled(place))
    for n, (pose, range_m) in enumerate(zip(way, heard_along(way), strict=True)):
        timeline.step(BankInput(1.0 if n else 0.0, (0.0, 0.0), pose[2], SPEED_M_S), ())
        arbiter.step(float(n), pose[:2], (RangeHeard(range_m),), timeline)
    h = timeline.bank.best.h
    return (pose[0] - float(h[0]), pose[1] - float(h[1]))


def test_a_mirrored_estimate_is_replaced_after_the_turn_and_not_before():
    place = mirrored(TARGET)
    assert math.dist(judged(place, courses(EAST)), place) < 1.0
    assert math.dist(judged(place, courses(EAST, NORTH)), TARGET) < 3.0


def test_an_estimate_that_the_ranges_allow_is_left_to_the_bank():
    place = (TARGET[0] + 2.0, TARGET[1])
    assert math.dist(judged(place, courses(EAST, NORTH)), place) < 1.0


def test_a_range_counts_where_the_robot_was_when_it_held():
    way = courses(EAST, NORTH)
    shares = []
    for believed_age_s in (20.0, 0.0):
        arbiter, timeline = (
            Arbiter(LAKE, START, np.random.default_rng(4)),
            Timeline(misled(mirrored(TARGET))),
        )
        for n, pose in enumerate(way):
            range_m = math.dist(way[max(n - 20, 0)][:2], TARGET)
            timeline.step(BankInput(1.0 if n else 0.0, (0.0, 0.0), pose[2], SPEED_M_S), ())
            age_s = min(believed_age_s, float(n))
            arbiter.step(float(n), pose[:2], (RangeHeard(range_m, age_s),), timeline)
        h = timeline.bank.best.h
        shares.append(math.dist((pose[0] - h[0], pose[1] - h[1]), TARGET))
    assert shares[0] < 1.5
    assert shares[0] < shares[1]


def arbitrated(*steps):
    """Return where an arbiter ends that is given ranges at each second."""
    arbiter = Arbiter(LAKE, START, np.random.default_rng(4))
    timeline = Timeline(misled(mirrored(TARGET)))
    for n, ranges in enumerate(steps):
        timeline.step(BankInput(1.0 if n else 0.0, (0.0, 0.0), 0.0, SPEED_M_S), ())
        arbiter.step(float(n), (START[0] + 2.0 * n, START[1]), ranges, timeline)
    return timeline.bank.best.h.tolist()


def test_ranges_that_arrive_at_once_count_in_the_order_in_which_they_held():
    silence = ((),) * 25
    late = [RangeHeard(math.dist((START[0] + 2.0 * n, START[1]), TARGET), 25.0 - n) for n in (5, 9)]
    late += [RangeHeard(math.dist((START[0] + 50.0, START[1]), TARGET))]
    in_order = arbitrated(*silence, tuple(late))
    assert arbitrated(*silence, tuple(reversed(late))) == in_order
    assert in_order != arbitrated(*silence, ())


def test_what_the_bank_is_too_late_for_the_cloud_does_not_hear_either():
    good = tuple(
        (RangeHeard(math.dist((START[0] + 2.0 * n, START[1]), TARGET)),) for n in range(40)
    )
    assert arbitrated(*good) != arbitrated(*((),) * 40)
    too_old = [(*ranges, RangeHeard(90.0, 1e-3 + n)) for n, ranges in enumerate(good)]
    assert arbitrated(*too_old) == arbitrated(*good)


def test_ranges_from_before_another_place_was_followed_are_too_old():
    timeline = Timeline(misled(TARGET))
    for n in range(20):
        timeline.step(BankInput(0.1 if n else 0.0, (0.0, 0.0), 1.5, SPEED_M_S), ())
    timeline.follow_instead((3.0, -2.0), (0.5, 0.1, 0.4), (0.01, -0.02))
    assert timeline.bank.best.place_covariance_m2 == (0.5, 0.1, 0.4)
    nothing = BankInput(0.1, (0.0, 0.0), math.nan, math.nan)
    assert timeline.step(nothing, (RangeHeard(25.0, 0.5),)) == 1
    best = timeline.bank.best
    assert best.velocity_ne_m_s == (0.01, -0.02)
    assert best.h[:2] == pytest.approx((3.0, -2.0), abs=0.05)
    assert timeline.step(nothing, (RangeHeard(3.6, 0.0),)) == 0
    assert timeline.bank.hearing.believed == 1


def tracked(way, controller="barrier", hypotheses="cloud"):
    """Return what trackers say along a way whose target is not where the first guess is."""
    target = LAKE.target.model_copy(
        update={"north_m": mirrored(TARGET)[0], "east_m": TARGET[1], "guess_std_m": 6.0}
    )
    barrier = BarrierConfig(controller=controller)
    chosen = LAKE.filter.model_copy(update={"hypotheses": hypotheses})
    config = LAKE.model_copy(update={"target": target, "barrier": barrier, "filter": chosen})
    tracker = Tracker(config, TrackerStart(START, 0.5 * math.pi, SPEED_M_S))
    for n, (pose, range_m) in enumerate(zip(way, heard_along(way), strict=True)):
        tracker.applied((0.0, 0.0))
        reading = TrackerReading(pose[:2], pose[2], SPEED_M_S, (RangeHeard(range_m),))
        step = tracker.step(reading, 1.0 if n else 0.0)
    return step


def test_a_tracker_with_a_cloud_finds_what_its_ranges_say():
    step = tracked(courses(EAST, NORTH, NORTH))
    assert math.dist(step.hypotheses[0].position_ne_m, TARGET) < 5.0


@pytest.mark.parametrize(
    "ranges",
    [
        (RangeHeard(1e5), RangeHeard(0.0)),
        (RangeHeard(math.nan), RangeHeard(-1.0), RangeHeard(math.inf, -1.0)),
        (RangeHeard(20.0, 29.9), RangeHeard(20.0, 1e300)),
        (),
    ],
)
def test_no_range_and_no_lost_position_makes_a_command_that_is_none(ranges):
    tracker = Tracker(LAKE, TrackerStart(START, 0.5 * math.pi, SPEED_M_S))
    for n in range(40):
        own = START if n % 2 else (math.nan, math.nan)
        step = tracker.step(TrackerReading(own, math.nan, math.nan, ranges), 5.0 * (n > 0))
        assert np.isfinite(step.command).all()
        assert all(np.isfinite(one.position_ne_m).all() for one in step.hypotheses)


def test_a_mission_that_teaches_has_no_cloud():
    way = courses(EAST, NORTH)
    assert tracked(way, "nominal") == tracked(way, "nominal", "one")


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


def test_only_a_mission_that_asks_for_a_cloud_has_one():
    assert LAKE.filter.hypotheses == "cloud"
    assert FilterConfig().hypotheses == "two"
