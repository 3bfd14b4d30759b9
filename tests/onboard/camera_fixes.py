"""Fixes by cameras of a robot that flies without a radio, drawn from the covariance they state."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta

import numpy as np

from autonomy.arrays import FloatArray
from robot_link.camera.received_fix import ReceivedFix
from simulator.fleet import MINI_1, RobotDefinition
from simulator.robot import SimulatedRobot
from tests.simulator.flight import Life

NOISE_STD_M = 0.0005
CONSIDERED_STD_M = 0.0015
"""Of what stays from one fix to the next: calibration, level, index."""
VARIANCE_M2 = NOISE_STD_M**2 + CONSIDERED_STD_M**2


def fix_at(at: datetime, ned_m: tuple[float, float, float], **changes: object) -> ReceivedFix:
    fix = ReceivedFix(
        measured_at=at,
        ned_m=ned_m,
        covariance_ne_m2=(VARIANCE_M2, 0.0, VARIANCE_M2),
        depth_variance_m2=VARIANCE_M2,
        heading_rad=0.5,
        heading_std_rad=0.004,
        roll_rad=0.0,
        pitch_rad=0.0,
        tilt_std_rad=0.01,
        rms=1.2,
        cameras=3,
        tags=3,
    )
    return replace(fix, **changes)


@dataclass
class Road:
    """The way from cameras to a robot: late, lossy, doubling and overtaking."""

    generator: np.random.Generator
    delay_s: tuple[float, float] = (0.08, 0.2)
    loss: float = 0.02
    duplication: float = 0.01
    bias_ned_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    clock_off_s: float = 0.0
    considered_m: FloatArray = field(init=False)
    _on_the_way: list[tuple[float, ReceivedFix]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.considered_m = CONSIDERED_STD_M * self.generator.standard_normal(3)

    def see(self, robot: SimulatedRobot) -> None:
        """Take pictures of a robot now."""
        state = robot.body.plant.state
        error = self.considered_m + NOISE_STD_M * self.generator.standard_normal(3)
        north, east, down = (state[:3] + error + self.bias_ned_m).tolist()
        turned = float(state[5]) + 0.004 * float(self.generator.standard_normal())
        at = robot.program.now + timedelta(seconds=self.clock_off_s)
        heading = math.remainder(turned, math.tau)
        fix = fix_at(at, (north, east, down), heading_rad=heading)
        copies = 1 + int(self.generator.random() < self.duplication)
        for _ in range(copies if self.generator.random() >= self.loss else 0):
            arrives_s = robot.program.time_s + self.generator.uniform(*self.delay_s)
            self._on_the_way.append((arrives_s, fix))

    def arrived(self, time_s: float) -> Iterator[ReceivedFix]:
        """Return what has arrived by now, in the order of arrival."""
        due = [one for one in self._on_the_way if one[0] <= time_s]
        self._on_the_way = [one for one in self._on_the_way if one[0] > time_s]
        for _, fix in sorted(due, key=lambda one: one[0]):
            yield fix


class SeenLife(Life):
    """A robot that five times a second is seen by cameras, and told."""

    def __init__(
        self, definition: RobotDefinition, seed: int, road: Road, period_steps: int = 2
    ) -> None:
        self.road = road
        self._period_steps = period_steps
        super().__init__(definition, seed)
        self._steps = 0

    def live_until(self, holds: Callable[[], bool], longest_s: float) -> bool:
        def told() -> bool:
            robot = self.robot
            number = round(robot.program.time_s / 0.1)
            if number % self._period_steps == 0:
                self.road.see(robot)
            for fix in self.road.arrived(robot.program.time_s):
                robot.program.hear_fix(fix)
            return holds()

        return super().live_until(told, longest_s)


def seen(surface_depth_m: float | None) -> RobotDefinition:
    return MINI_1.fixed_by_cameras(surface_depth_m)
