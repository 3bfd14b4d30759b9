"""A robot that cameras see: which fixes it takes, how late they may be, and what it claims."""

import math
from dataclasses import fields, replace
from datetime import timedelta

import numpy as np
import pytest

from autonomy.estimation.config import EstimatorConfig
from autonomy.site import TANK
from onboard.flight.navigation import OwnWay
from onboard.flight.outside_fix import OutsideFixes
from robot_link.clock import SystemClock
from robot_link.transport.opening import open_transport
from simulator.aboard import computer_of
from simulator.fleet import MINI_1, RobotDefinition
from tests.onboard.camera_fixes import VARIANCE_M2, Road, SeenLife, fix_at, seen
from tests.simulator.flight import EPOCH, Life, mission, two_dives

NOW = EPOCH
HERE = (1.0, 0.5, 0.3)
DEPTH_M = 0.3
DIVES = range(4)
"""Drawn dives of each kind."""


def fixes(surface_depth_m: float = 1.2) -> OutsideFixes:
    return OutsideFixes(TANK, surface_depth_m)


@pytest.mark.parametrize(
    ("fix", "reason"),
    [
        (fix_at(NOW - timedelta(seconds=1.6), HERE), "1.6 s old"),
        (fix_at(NOW + timedelta(seconds=0.2), HERE), "0.2 s ahead"),
        (fix_at(NOW, (TANK.water.x_max_m + 0.6, 0.5, 0.3)), "outside"),
        (fix_at(NOW, (1.0, TANK.water.y_min_m - 0.6, 0.3)), "outside"),
        (fix_at(NOW, (1.0, 0.5, TANK.water.depth_max_m + 0.6)), "outside"),
        (fix_at(NOW, (1.0, 0.5, -0.6)), "outside"),
        (fix_at(NOW - timedelta(days=20_000), HERE), "old"),  # a time since boot
    ],
)
def test_fix_that_cannot_be_of_this_robot_now_is_refused_and_the_reason_kept(fix, reason):
    desk = fixes()
    desk.hear(fix, NOW, DEPTH_M)
    assert desk.take(NOW) is None
    assert (desk.refused, desk.taken) == (1, 0)
    assert reason in desk.reason


def test_fix_at_the_limits_is_taken_with_its_age():
    for age_s in (1.5, 0.0, -0.1):
        desk = fixes()
        desk.hear(fix_at(NOW - timedelta(seconds=age_s), HERE), NOW, DEPTH_M)
        late = desk.take(NOW)
        assert late is not None
        assert late.age_s == max(age_s, 0.0)
        assert desk.take(NOW) is None


def test_fix_that_comes_twice_or_was_overtaken_is_taken_once():
    desk = fixes()
    newest = fix_at(NOW, HERE)
    for fix in (newest, newest, fix_at(NOW - timedelta(seconds=0.2), HERE)):
        desk.hear(fix, NOW, DEPTH_M)
    assert desk.take(NOW) is not None
    assert desk.refused == 2
    assert "not newer" in desk.reason


def test_fix_of_a_robot_deeper_than_its_surface_depth_does_not_count():
    desk = fixes(0.05)
    desk.hear(fix_at(NOW, HERE), NOW, DEPTH_M)
    assert desk.take(NOW) is None
    assert "0.30 m deep" in desk.reason


def test_a_clock_that_is_set_back_costs_no_fix():
    desk = fixes()
    desk.hear(fix_at(NOW, HERE), NOW, DEPTH_M)
    assert desk.take(NOW) is not None
    before = NOW - timedelta(seconds=60)
    desk.hear(fix_at(before, HERE), before, DEPTH_M)
    assert desk.take(before) is not None
    assert desk.refused == 0


def test_why_no_fix_is_taken_is_told_once_until_one_is_and_at_most_every_10_s():
    desk, told = fixes(0.05), []
    for step in range(600):
        now, time_s = NOW + timedelta(seconds=0.1 * step), 0.1 * step
        depth_m = 0.0 if 20.0 <= time_s < 22.0 else DEPTH_M + 0.01 * (step % 7)
        desk.hear(fix_at(now, HERE), now, depth_m)
        desk.hear(fix_at(now, HERE), now, 0.0)  # this one came twice, or was overtaken
        desk.take(now)
        if reason := desk.due_reason(time_s):
            told.append((time_s, reason))
    assert told == []  # the copies at no depth were taken all the time
    for step in range(600, 1200):
        now, time_s = NOW + timedelta(seconds=0.1 * step), 0.1 * step
        is_up = 80.0 <= time_s < 82.0
        desk.hear(fix_at(now, HERE), now, 0.0 if is_up else DEPTH_M + 0.01 * (step % 7))
        desk.take(now)
        if reason := desk.due_reason(time_s):
            told.append((time_s, reason))
    times = [time_s for time_s, _ in told]
    assert times == pytest.approx([61.9, 83.9])
    assert all("m deep; fixes count to 0.05 m" in reason for _, reason in told)


def test_why_no_fix_is_taken_is_in_the_robots_log_and_said_to_the_station(tmp_path, monkeypatch):
    life, said = Life(seen(0.05)), []
    program = life.robot.program
    radio = open_transport("udp://127.0.0.1:9")
    computer = computer_of(
        life.robot.definition,
        program,
        radio=radio,
        clock=SystemClock(),
        memory=tmp_path,
        satellite=None,
    )
    monkeypatch.setattr(computer.link, "say", said.append)
    deep = replace(program._readings, depth_m=0.3)
    for _ in range(60):
        program._readings = deep
        program.hear_fix(fix_at(program.now, HERE))
        computer.step()
    computer.log.close()
    why = "ixes are not taken: the robot is 0.30 m deep; fixes count to 0.05 m"
    assert said == [f"F{why}"]
    (events,) = (tmp_path / "log").glob("events-*")
    assert events.read_text().count(f"f{why}") == 1


def test_way_since_a_moment_leaves_out_what_fixes_corrected():
    way = OwnWay(0.1)
    for step in range(40):
        if step == 30:
            way.correct((5.0, -5.0))
        moved = 5.0 if step >= 30 else 0.0
        way.add((0.01 * step + moved, -0.02 * step - moved), 0.003 * step, 3.1 + 0.01 * step)
    assert way.since(1.55) == pytest.approx([0.155, -0.31, 0.0465, 0.155])
    assert way.since(0.0) == pytest.approx(np.zeros(4))
    assert way.since(60.0) == pytest.approx(way.since(3.0))


def by(method: str, surface_depth_m: float) -> RobotDefinition:
    """Return the Miniglider in front of cameras, with one of the methods on board."""

    class Chosen(RobotDefinition):
        @property
        def estimator(self) -> EstimatorConfig:
            return super().estimator.model_copy(update={"method": method})

    definition = seen(surface_depth_m)
    return Chosen(**{field.name: getattr(definition, field.name) for field in fields(definition)})


def dive(
    method: str, seed: int, surface_depth_m: float = 1.2, **conditions
) -> tuple[np.ndarray, SeenLife]:
    """Return the track of a drawn dive, and the life that it was part of."""
    road = Road(np.random.default_rng([seed, 7]), **conditions)
    life = SeenLife(by(method, surface_depth_m), seed, road)
    life.live(20.0)
    track = life.fly(mission(*two_dives()))
    assert track[:, 7].max() > 0.3
    return track, life


def errors_m(track: np.ndarray) -> np.ndarray:
    return np.hypot(track[:, 1] - track[:, 5], track[:, 2] - track[:, 6])


METHODS = pytest.mark.parametrize("method", ["model", "position", "tags"])


@METHODS
def test_estimate_stays_within_2_cm_of_the_truth_through_a_dive_and_its_claim_is_honest(method):
    errors, normalized = [], []
    for seed in DIVES:
        track, life = dive(method, seed)
        assert life.estimate.is_by_cameras
        assert track[:, 4].min() >= 0.999 * math.sqrt(VARIANCE_M2)
        errors.append(errors_m(track))
        normalized.append(np.mean(errors_m(track) ** 2 / track[:, 4] ** 2))
    assert np.quantile(np.concatenate(errors), 0.95) < 0.014
    if method != "tags":  # which does not know how the robot swims, and so not when it turns
        assert np.quantile([one.max() for one in errors], 0.8) < 0.02
    assert 0.7 < np.mean(normalized) < 3.5  # two coordinates: 2 where the claim is exact


@METHODS
def test_estimate_by_late_lossy_overtaken_fixes_is_worse_and_says_so(method):
    errors, normalized = [], []
    for seed in DIVES:
        track, life = dive(method, seed, delay_s=(0.8, 1.2), loss=0.2, duplication=0.2)
        assert life.robot.program.fixes.refused > 10
        errors.append(errors_m(track))
        normalized.append(np.mean(errors_m(track) ** 2 / track[:, 4] ** 2))
    assert np.quantile(np.concatenate(errors), 0.95) < 0.05
    assert 0.7 < np.mean(normalized) < 3.5


def test_robot_that_believes_no_fix_under_water_dead_reckons():
    for seed in DIVES[:2]:
        track, life = dive("model", seed, 0.05)
        assert track[track[:, 7] > 0.2, 4].max() > 0.02
        assert life.robot.program.fixes.refused > 50


def test_robot_without_fixes_says_that_it_has_none():
    life = Life(seen(1.2))
    assert not life.estimate.has_fix
    assert life.robot.body.read().fix_ne_m is None
    assert Life(MINI_1).estimate.has_fix
    assert not Life(MINI_1).estimate.is_by_cameras


def test_station_whose_clock_of_the_robot_is_stale_fixes_nothing():
    road = Road(np.random.default_rng(7), clock_off_s=-5.0)
    life = SeenLife(by("model", 1.2), 0, road)
    life.live(10.0)
    assert life.robot.program.fixes.taken == 0
    assert life.robot.program.fixes.refused > 40
    assert not life.estimate.has_fix


def test_fixes_that_jump_aside_are_refused_by_the_filter_and_agreeing_ones_believed():
    track, life = dive("model", 1)
    before = life.estimate.current.fixes_refused
    life.road.bias_ned_m = (0.4, 0.0, 0.0)
    life.live(0.5)
    assert life.estimate.current.fixes_refused > before
    assert errors_m(life.track)[-1] < 0.05
    life.live(20.0)  # the robot was wrong, for all that it can know
    assert errors_m(life.track)[-1] > 0.3
    del track


def test_robot_says_that_cameras_fixed_it_only_where_its_filter_took_a_fix():
    for method in ("model", "position", "tags"):
        _, life = dive(method, 1)
        assert life.estimate.is_by_cameras
        life.road.loss = 1.0
        life.live(3.0)
        assert not life.estimate.has_fix
        north, east, down = life.estimate.position_ned
        program, taken = life.robot.program, life.robot.program.fixes.taken
        heading = {"heading_rad": life.estimate.heading_rad}
        program.hear_fix(fix_at(program.now, (north - 1.0, east, down), **heading))
        life.live(0.1)
        assert program.fixes.taken == taken + 1
        assert life.estimate.current.fixes_refused
        assert not life.estimate.has_fix
        assert not life.estimate.is_by_cameras
        program.hear_fix(fix_at(program.now, (north, east, down), **heading))
        life.live(0.1)
        assert life.estimate.is_by_cameras


def test_robot_says_whether_its_own_camera_or_another_fixed_it():
    life = Life(seen(0.05))
    program = life.robot.program
    place = (*life.robot.body.plant.position_ned[:2], 0.0)
    for hear, is_own in ((program.hear_fix, False), (program.hear_own_fix, True)):
        hear(fix_at(program.now, place))
        life.live(0.1)
        state = program.state_report()
        assert (state.is_by_cameras, state.is_by_own_camera) == (True, is_own)


def test_depth_by_tags_is_the_pressure_sensors_whatever_cameras_say_of_it():
    road = Road(np.random.default_rng(7), bias_ned_m=(0.0, 0.0, 0.1))
    life = SeenLife(by("tags", 1.2), 0, road)
    life.live(20.0)
    life.start(mission(*two_dives()))
    off_m = []

    def is_deep():
        off_m.append(life.estimate.depth_m - life.estimate.readings.depth_m)
        return len(off_m) > 600

    assert life.live_until(is_deep, 100.0)
    assert life.robot.program.fixes.taken > 250
    assert abs(np.mean(off_m[100:])) < 0.005


def test_fix_that_knows_little_moves_the_estimate_little():
    track, life = dive("model", 2)
    here = life.estimate.position_ned
    vague = fix_at(
        life.robot.program.now,
        (here[0] + 0.2, here[1], here[2]),
        covariance_ne_m2=(0.25, 0.0, 0.25),
    )
    life.road.loss = 1.0
    life.robot.program.hear_fix(vague)
    life.live(0.1)
    assert abs(life.estimate.position_ned[0] - here[0]) < 0.02
    assert life.estimate.position_std_m < 0.02
    del track
