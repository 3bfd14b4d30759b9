"""The joint filter of place, velocity and range delay, and who is followed: it or the bank."""

import math

import numpy as np
import pytest

from autonomy.tracking.config import TRACKING_PRESETS, BarrierConfig, FilterConfig
from autonomy.tracking.filter import joint_kernel as k
from autonomy.tracking.filter.arbiter import Arbiter
from autonomy.tracking.filter.bank import Bank, BankInput
from autonomy.tracking.filter.filter_kernel import full_covariance
from autonomy.tracking.filter.joint import JointFilter
from autonomy.tracking.filter.late_range import Timeline
from autonomy.tracking.phase import SpeedClass
from autonomy.tracking.reading import RangeHeard, TrackerReading, TrackerStart
from autonomy.tracking.reference import joint as readable
from autonomy.tracking.tracker import Tracker
from tests.autonomy.lake_target import (
    EAST,
    LAKE,
    NORTH,
    SPEED_M_S,
    START,
    TARGET,
    courses,
    heard_along,
    mirrored,
)
from tests.autonomy.tracking_water import DT_S, Water, settings


def filter_after(way, seed=1, config=LAKE):
    joint = JointFilter(config, START, np.random.default_rng(seed))
    for n, (pose, range_m) in enumerate(zip(way, heard_along(way), strict=True)):
        rate = (SPEED_M_S * math.cos(pose[2]), SPEED_M_S * math.sin(pose[2]))
        joint.step(float(n), pose[:2], SPEED_M_S, rate)
        joint.note((RangeHeard(range_m),))
    return joint


def particles(seed=3, count=60):
    rng = np.random.default_rng(seed)
    drawn = rng.standard_normal((count, k.SIZE))
    drawn[:, k.DELAY] = rng.uniform(0.0, 3.0, count)
    drawn[:, k.CLASS] = rng.integers(0, 3, count)
    return rng, drawn


def test_the_compiled_steps_are_the_readable_ones():
    rng, drawn = particles()
    classes = np.column_stack([[0.9, 0.99, 0.8], [0.1, 0.05, 0.3], [0.1, 0.4, 1.0], [0.4] * 3])
    normal, uniform = rng.standard_normal((60, 6)), rng.random((60, 4))
    moved = drawn.copy()
    k.drift(moved, 0.5, 0.1, 0.02, 0.05, classes, normal, uniform)
    assert moved == pytest.approx(
        readable.drift(drawn, 0.5, 0.1, 0.02, 0.05, classes, normal, uniform), abs=1e-12
    )
    assert len(np.unique(moved[:, k.CLASS])) == 3
    weights = rng.random(60)
    weights /= weights.sum()
    way, ages = np.cumsum(rng.standard_normal((80, 2)) * 0.05, axis=0), np.array([0.0, 0.13, 1.7])
    ranges = np.array([1.0, 1.4, 0.2])
    weighed = weights.copy()
    likelihood = k.weigh(moved, weighed, np.empty(60), way, 0.1, ages, ranges, 0.4, 3.0)
    expected, mean = readable.weights_after(moved, weights, way, 0.1, ages, ranges, 0.4, 3.0)
    assert weighed == pytest.approx(expected)
    assert likelihood == pytest.approx(mean)


def test_a_turned_target_is_as_far_and_comes_as_fast():
    rng, drawn = particles()
    turned, own, rate = drawn.copy(), np.array([0.3, -0.2]), np.array([0.1, 0.4])
    k.turn(turned, *own, *rate, rng.uniform(-3.0, 3.0, 60))
    for one in (drawn, turned):
        one[:, :2] -= own
        one[:, 2:4] -= rate
    assert np.hypot(*turned[:, :2].T) == pytest.approx(np.hypot(*drawn[:, :2].T))
    closing = [(one[:, :2] * one[:, 2:4]).sum(axis=1) for one in (drawn, turned)]
    assert closing[1] == pytest.approx(closing[0])


def test_the_middle_of_what_is_near():
    _, drawn = particles()
    weights = np.full(60, 1.0 / 60)
    near = np.hypot(drawn[:, 0] - 0.5, drawn[:, 1]) < 0.8
    north, east, total = k.middle(drawn, weights, 0.5, 0.0, 0.8)
    assert total == pytest.approx(near.mean())
    assert (north, east) == pytest.approx(tuple(drawn[near, :2].mean(axis=0)))
    assert k.middle(drawn, weights, 100.0, 0.0, 0.8) == (100.0, 0.0, 0.0)


def test_a_straight_course_leaves_it_unsure_between_two_places_and_a_turn_decides():
    straight = filter_after(courses(EAST)).belief()
    assert not straight.is_sure
    for place in (TARGET, mirrored(TARGET)):
        off = np.subtract(straight.place_ne_m, place)
        nn, ne, ee = straight.covariance_m2
        assert off @ np.linalg.solve([[nn, ne], [ne, ee]], off) < 6.0
    turned = filter_after(courses(EAST, NORTH)).belief()
    assert turned.is_sure
    assert math.dist(turned.place_ne_m, TARGET) < 4.0
    assert turned.worst_std_m < 4.0
    assert turned.speed_class is not SpeedClass.FAST
    assert not turned.is_too_fast


def test_the_same_ranges_and_generator_give_the_same_belief():
    way = courses(EAST, NORTH)[:80]
    first, again, other = (filter_after(way, seed).belief() for seed in (1, 1, 2))
    assert first == again
    assert first != other


@pytest.mark.parametrize("wrong_m", [0.0, 70.0])
def test_ranges_that_contradict_everything_begin_a_ring_anew(wrong_m):
    way = courses(EAST, NORTH)
    joint, own = filter_after(way), way[-1][:2]
    for n in range(14):
        joint.note((RangeHeard(math.dist(own, TARGET) + wrong_m),))
        joint.step(150.0 + n, own, 0.0, (0.0, 0.0))
    assert (joint.belief().worst_std_m > 10.0) is (wrong_m > 0.0)
    assert (joint.restarts_at_s > 0.0) is (wrong_m > 0.0)


def test_a_quarter_of_another_animals_ranges_contradicts_nothing():
    rng = np.random.default_rng(3)
    way = courses(EAST, NORTH)
    joint = JointFilter(LAKE, START, np.random.default_rng(2))
    other = (TARGET[0] + 60.0, TARGET[1] - 40.0)
    contradicted = 0
    for n, (pose, range_m) in enumerate(zip(way, heard_along(way), strict=True)):
        rate = (SPEED_M_S * math.cos(pose[2]), SPEED_M_S * math.sin(pose[2]))
        joint.step(float(n), pose[:2], SPEED_M_S, rate)
        is_other = n > 5 and rng.random() < 0.25
        joint.note((RangeHeard(math.dist(pose[:2], other) if is_other else range_m),))
        contradicted += joint.is_contradicted
    assert joint.restarts_at_s < 0.0
    assert contradicted < 0.05 * len(way)
    assert joint.belief().is_sure
    assert math.dist(joint.belief().place_ne_m, TARGET) < 5.0


def test_one_outlier_moves_it_no_farther_than_a_range_that_agrees():
    way = courses(EAST, NORTH)
    places = []
    for range_m in (500.0, math.dist(way[-1][:2], TARGET)):
        joint = filter_after(way)
        joint.note((RangeHeard(range_m),))
        joint.step(151.0, way[-1][:2], 0.0, (0.0, 0.0))
        places.append(joint.belief().place_ne_m)
    assert math.dist(*places) < 1.5


def test_a_corrected_own_position_leaves_the_target_beside_the_robot():
    way = courses(EAST, NORTH)
    joint, own = filter_after(way), np.array(way[-1][:2])
    before = own - joint.belief().place_ne_m
    fixed = own + np.array([30.0, -20.0])
    joint.step(len(way) - 1.0, tuple(fixed), SPEED_M_S, (0.0, 0.0))
    after = fixed - joint.belief().place_ne_m
    assert after == pytest.approx(before, abs=1e-6)


def test_silence_widens_what_is_believed():
    way = courses(EAST, NORTH)
    joint, own = filter_after(way), way[-1][:2]
    before = joint.belief().worst_std_m
    for n in range(60):
        joint.step(150.0 + n, own, 0.0, (0.0, 0.0))
    assert joint.belief().worst_std_m > 1.1 * before


def vague(guess_std_m):
    """Return settings whose first guess is right within so much."""
    target = LAKE.target.model_copy(update={"guess_std_m": guess_std_m})
    return LAKE.model_copy(update={"target": target})


def test_without_one_place_it_is_sure_of_none():
    joint = JointFilter(vague(500.0), START, np.random.default_rng(1))
    joint.note((RangeHeard(1000.0),))
    joint.step(1.0, START, SPEED_M_S, (0.0, 0.0))
    assert not joint.belief().is_sure


def test_a_place_is_never_known_without_an_error():
    joint = JointFilter(vague(1e-9), START, np.random.default_rng(1))
    joint.note((RangeHeard(math.dist(START, (LAKE.target.north_m, LAKE.target.east_m))),))
    joint.step(1.0, START, SPEED_M_S, (0.0, 0.0))
    belief = joint.belief()
    nn, ne, ee = belief.covariance_m2
    assert np.linalg.eigvalsh([[nn, ne], [ne, ee]]).min() > 1e-4
    timeline = Timeline(misled(TARGET))
    timeline.follow_instead((6.0, 8.0), belief.covariance_m2, belief.velocity_ne_m_s)
    for n in range(20):
        given = BankInput(0.1, (0.01, 0.0), 0.5 * math.pi, SPEED_M_S)
        timeline.step(given, (RangeHeard(10.0 + 0.1 * n),))
        for one in timeline.bank.hypotheses:
            assert np.linalg.eigvalsh(full_covariance(one.h[4:14])).min() > 0.0


def misled(place):
    """Return a bank that is sure of a place, as seen from ``START``."""
    relative = (START[0] - place[0], START[1] - place[1])
    return Bank.begin(LAKE, relative, 0.5 * math.pi, SPEED_M_S, 1.0)


def arbiter_at(heading=0.5 * math.pi):
    return Arbiter(LAKE, TrackerStart(START, heading, SPEED_M_S), np.random.default_rng(4))


def judged(place, way):
    """Let an arbiter watch a bank that is sure of a place; return it, and the place it follows."""
    arbiter, timeline = arbiter_at(), Timeline(misled(place))
    for n, (pose, range_m) in enumerate(zip(way, heard_along(way), strict=True)):
        given = BankInput(1.0 if n else 0.0, (0.0, 0.0), pose[2], SPEED_M_S)
        timeline.step(given, ())
        arbiter.step(float(n), pose[:2], given, (RangeHeard(range_m),), timeline)
    h = timeline.bank.best.h
    if arbiter.follows_bank:
        return arbiter, (pose[0] - float(h[0]), pose[1] - float(h[1]))
    return arbiter, arbiter.belief.place_ne_m


def test_a_mirrored_estimate_is_not_followed_and_the_mean_is_until_the_turn_decides():
    place = mirrored(TARGET)
    arbiter, followed = judged(place, courses(EAST))
    assert not arbiter.follows_bank
    assert math.dist(followed, place) > 2.0
    _, followed = judged(place, courses(EAST, NORTH))
    assert math.dist(followed, TARGET) < 4.0


def test_an_estimate_that_the_joint_filter_has_too_is_left_to_the_bank():
    water = Water(settings(guess_ne_m=(0.3, -0.2)))
    water.swim(40.0)
    assert water.tracker._arbiter.follows_bank


def test_a_range_counts_where_the_robot_was_when_it_held():
    way = courses(EAST, NORTH)
    off = []
    for believed_age_s in (20.0, 0.0):
        arbiter, timeline = arbiter_at(), Timeline(misled(mirrored(TARGET)))
        for n, pose in enumerate(way):
            range_m = math.dist(way[max(n - 20, 0)][:2], TARGET)
            given = BankInput(1.0 if n else 0.0, (0.0, 0.0), pose[2], SPEED_M_S)
            timeline.step(given, ())
            heard = (RangeHeard(range_m, min(believed_age_s, float(n))),)
            arbiter.step(float(n), pose[:2], given, heard, timeline)
        off.append(math.dist(arbiter.belief.place_ne_m, TARGET))
    assert off[0] < 2.0
    assert off[0] < off[1]


def arbitrated(*steps):
    """Return what an arbiter believes in the end that is given ranges at each second."""
    arbiter, timeline = arbiter_at(0.0), Timeline(misled(mirrored(TARGET)))
    for n, ranges in enumerate(steps):
        given = BankInput(1.0 if n else 0.0, (0.0, 0.0), 0.0, SPEED_M_S)
        timeline.step(given, ())
        arbiter.step(float(n), (START[0] + 2.0 * n, START[1]), given, ranges, timeline)
    nothing = BankInput(1.0, (0.0, 0.0), 0.0, SPEED_M_S)
    end = float(len(steps))
    arbiter.step(end, (START[0] + 2.0 * end, START[1]), nothing, (), timeline)
    return arbiter.belief


def test_ranges_that_arrive_at_once_count_in_the_order_in_which_they_held():
    silence = ((),) * 25
    late = [RangeHeard(math.dist((START[0] + 2.0 * n, START[1]), TARGET), 25.0 - n) for n in (5, 9)]
    late += [RangeHeard(math.dist((START[0] + 50.0, START[1]), TARGET))]
    in_order = arbitrated(*silence, tuple(late))
    backwards = arbitrated(*silence, tuple(reversed(late)))
    assert backwards.place_ne_m == pytest.approx(in_order.place_ne_m, abs=1e-6)
    assert in_order != arbitrated(*silence, ())


def test_what_the_bank_is_too_late_for_the_joint_filter_does_not_hear_either():
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


def test_a_tracker_with_a_joint_filter_finds_what_its_ranges_say():
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


def test_a_mission_that_teaches_has_no_joint_filter():
    way = courses(EAST, NORTH)
    assert tracked(way, "nominal") == tracked(way, "nominal", "one")


def test_only_a_mission_that_asks_for_a_cloud_has_one():
    assert LAKE.filter.hypotheses == FilterConfig().hypotheses == "cloud"
    way = courses(EAST)
    assert tracked(way, hypotheses="two").speed_class is None
    assert tracked(way).speed_class is not None


def fish(ratio, seed, *, delay_s=0.0, seconds=80.0, turns=True):
    """Follow a target at this share of the robot's cap, whose ranges are late and say they are not.

    Returns:
        The water, the distances from target and estimate, and whether each ellipse held.
    """
    config = settings(guess_ne_m=(0.3, -0.2))
    water, late = Water(config, seed=seed), []
    speed, rows = ratio * config.motion.speed_max_m_s, []
    for n in range(round(seconds / DT_S)):
        course = 0.8 * ((n // 150) % 2) if turns else 0.4
        water.velocity = speed * np.array([math.cos(course), math.sin(course)])

        def change(range_m):
            late.append(range_m)
            behind = len(late) - 1 - round(delay_s / DT_S)
            return (RangeHeard(late[behind]),) if behind >= 0 else ()

        water.swim(DT_S, change)
        if not water.newest.hypotheses:
            continue
        best = water.newest.hypotheses[0]
        nn, ne, ee = best.covariance_m2
        off = np.array(best.position_ne_m) - (water.target - DT_S * water.velocity)
        rows.append((water.distance, water.error, off @ np.linalg.solve([[nn, ne], [ne, ee]], off)))
    return water, np.array(rows)


@pytest.mark.parametrize(("ratio", "delay_s"), [(0.5, 0.0), (0.25, 2.0)])
def test_a_fish_is_followed_and_its_ellipse_holds(ratio, delay_s):
    water, rows = fish(ratio, 3, delay_s=delay_s)
    end = rows[-200:]
    assert end[:, 0].mean() < 6.0
    assert end[:, 1].mean() < end[:, 0].mean()
    assert (rows[:, 2] < 5.99).mean() > 0.75
    if delay_s:
        assert water.newest.delay_s == pytest.approx(delay_s, abs=1.0)


def test_a_target_that_is_too_fast_is_called_so_before_it_is_lost():
    water, _ = fish(1.6, 3, seconds=60.0, turns=False)
    assert any(step.is_too_fast or "faster than" in step.reason for step in water.steps)
    slow, _ = fish(0.25, 3, seconds=60.0)
    assert not any(step.is_too_fast for step in slow.steps)


def held_of_a_circle(seed: int) -> list[bool]:
    """Follow a target that circles by ranges in the tank; tell when the ellipse held it."""
    config, rng = TRACKING_PRESETS["miniglider"], np.random.default_rng(seed)
    north, east, heading, speed, step_s = 0.5, 0.5, 1.0, 0.05, 0.2
    joint = JointFilter(config, (north, east), np.random.default_rng(10 + seed))
    held: list[bool] = []
    for n in range(1500):
        t = step_s * n
        at = (1.4 + 0.6 * math.sin(0.05 * t), 1.0 - 0.6 * math.cos(0.05 * t))
        wanted = math.atan2(at[1] - east, at[0] - north)
        off_rad = math.remainder(wanted - heading, 2.0 * math.pi)
        heading += step_s * max(-0.1, min(0.1, 0.2 * off_rad))
        rate = (speed * math.cos(heading), speed * math.sin(heading))
        north, east = north + step_s * rate[0], east + step_s * rate[1]
        joint.step(t, (north, east), speed, rate)
        noisy_m = abs(math.dist((north, east), at) + math.sqrt(0.1) * rng.standard_normal())
        joint.note((RangeHeard(noisy_m),))
        if n % 25 == 0 and n > 100:
            belief = joint.belief()
            nn, ne, ee = belief.covariance_m2
            off = np.subtract(belief.place_ne_m, at)
            held.append(bool(off @ np.linalg.solve([[nn, ne], [ne, ee]], off) < 5.99))
    return held


def test_the_ellipse_holds_a_target_that_circles():
    assert np.mean([held_of_a_circle(seed) for seed in (1, 2, 3)]) > 0.85
