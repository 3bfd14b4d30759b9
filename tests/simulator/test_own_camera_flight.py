"""A robot of the tank dives by its own camera alone: what it then believes, held against truth."""

from collections import deque
from dataclasses import replace
from datetime import timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from onboard.own_camera_file import read_own_camera
from onboard.own_camera_listener import OwnCameraListener
from robot_link.clock import ScaledClock
from robot_link.messages import OnboardPlanState
from simulator.fleet import MINI_1
from simulator.own_camera import PERIOD_S, SimulatedEye, pose_of_state, write_files
from tests.simulator.flight import EPOCH, Life, mission, vee

SEEING = replace(MINI_1, has_own_camera=True).fixed_by_cameras(None)
LATE_S = 0.2
SETTLES_S = 20.0
SILENT = SimpleNamespace(subscribe=lambda _topic: None, note=lambda _sentence: None)


class Dive:
    """A robot with its eye, stepped together: a picture twice a second, solved 0.2 s later."""

    def __init__(self, folder, seed):
        write_files(folder)
        self.life = Life(SEEING, seed)
        self.plant, self.program = self.life.robot.body.plant, self.life.robot.program
        rng = np.random.default_rng([seed, 4])
        eye = SimulatedEye(lambda: None, lambda: 0.0, ScaledClock(EPOCH, EPOCH, 1.0), rng)
        self.truth, self.rng = eye.truth, rng
        setup = read_own_camera(folder)
        self.listener = OwnCameraListener(
            self.program, SILENT, setup, lambda count_s: EPOCH + timedelta(seconds=count_s), SILENT
        )
        self.coming = deque()
        self.next_s = 0.0
        self.rows = []

    def look(self):
        """Take a picture if one is due, solve those that are due, and write down how it fares."""
        now_s = self.program.time_s
        if now_s >= self.next_s - 1e-6:
            self.next_s = now_s + PERIOD_S
            seen = self.truth.seen(pose_of_state(self.plant.state), 0.0, self.rng)
            tags = [
                {"id": tag.id, "corners_px": tag.corners_px, "sigma_px": tag.sigma_px}
                for tag in seen
            ]
            self.coming.append({"count_s": now_s, "tags": tags})
        while self.coming and self.coming[0]["count_s"] <= now_s - LATE_S + 1e-6:
            self.listener.take(self.coming.popleft())
        estimate, state = self.life.estimate, self.program.state_report()
        off_m = np.subtract(estimate.position_ned[:2], self.plant.position_ned[:2])
        depth_m = self.plant.position_ned[2]
        self.rows.append(
            (*off_m, estimate.position_std_m, depth_m, state.has_fix and state.is_by_cameras)
        )
        return False

    def fly(self):
        """Find itself, dive, and return a row for each step from then on."""
        self.life.live_until(self.look, SETTLES_S)
        before = len(self.rows)
        north, east, _ = self.plant.position_ned
        self.life.start(mission(*vee((north, east)), max_uncertainty_m=3.0))
        running = OnboardPlanState.RUNNING
        self.life.live_until(
            lambda: self.look() or self.life.executive.plan_state is not running, 400.0
        )
        return np.array(self.rows[before:], dtype=float)


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    return [Dive(tmp_path_factory.mktemp("memory"), seed).fly() for seed in range(6)]


def test_a_robot_under_water_is_fixed_by_its_own_camera_and_says_so(flights):
    for rows in flights:
        going_down = rows[: int(np.argmax(rows[:, 3]))]
        under = going_down[going_down[:, 3] > 0.2]
        assert len(under) > 50
        assert under[:, 4].mean() > 0.9


def test_while_it_sees_tags_its_position_stays_within_centimetres(flights):
    rows = np.concatenate(flights)
    errors = np.hypot(rows[:, 0], rows[:, 1])[rows[:, 4] > 0.0]
    assert np.median(errors) < 0.02
    assert np.quantile(errors, 0.95) < 0.04


def test_with_its_nose_up_it_sees_no_tag_says_so_and_claims_less(flights):
    rows = np.concatenate(flights)
    sees, told_m = rows[:, 4] > 0.0, rows[:, 2]
    assert 0.1 < np.mean(~sees) < 0.5
    assert told_m[~sees].mean() > 2.0 * told_m[sees].mean()


def test_what_it_claims_is_honest(flights):
    """A flight has one mount, one survey and one lens: what they err stays from fix to fix."""
    rows = np.concatenate(flights)
    squares = (rows[:, 0] ** 2 + rows[:, 1] ** 2) / rows[:, 2] ** 2
    assert 0.2 < np.mean(squares) < 4.0
