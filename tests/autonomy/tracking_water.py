"""A unicycle and a target in still water, and what the robot measures there."""

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from autonomy.configuration import Configuration
from autonomy.tracking.config import RangingConfig, TargetConfig, TrackingConfig
from autonomy.tracking.tracker import RangeHeard, Tracker, TrackerReading, TrackerStart, TrackerStep
from reproduction.tracking import unicycle

PositionNe: TypeAlias = tuple[float, float]
Pose: TypeAlias = tuple[float, float, float, float]
Change: TypeAlias = Callable[[float], tuple[RangeHeard, ...]]
"""What the water does to a range."""

DT_S = 0.1
NOISE_STD = np.sqrt([0.1, 0.0175, 0.1])
QUICK = RangingConfig(period_s=0.1, lost_after_s=8.0, give_up_after_s=40.0)
"""Gives up soon, so that tests are short."""


def settings(
    guess_ne_m: PositionNe = (0.0, 0.0),
    guess_std_m: float = 0.4,
    ranging: RangingConfig = QUICK,
    **parts: Configuration,
) -> TrackingConfig:
    target = TargetConfig(north_m=guess_ne_m[0], east_m=guess_ne_m[1], guess_std_m=guess_std_m)
    return TrackingConfig.model_validate({"target": target, "ranging": ranging, **parts})


def whole(range_m: float) -> tuple[RangeHeard, ...]:
    """Every range is heard as it is."""
    return (RangeHeard(range_m),)


class Water:
    """A robot at ``pose`` (north, east, heading, speed) that obeys its tracker, and a target."""

    newest: TrackerStep
    """What the tracker said last."""

    def __init__(
        self,
        config: TrackingConfig,
        pose: Pose = (-3.0, 1.0, 0.5, 0.2),
        target: PositionNe = (0.0, 0.0),
        seed: int = 1,
    ) -> None:
        self.pose, self.target, self.velocity = pose, np.array(target), np.zeros(2)
        self.noise = np.random.default_rng(seed)
        self.tracker = Tracker(config, TrackerStart(pose[:2], pose[2], pose[3]))
        self.time_s = 0.0
        self.steps: list[TrackerStep] = []
        self.is_moved = True

    @property
    def distance(self) -> float:
        return float(np.hypot(*(np.array(self.pose[:2]) - self.target)))

    @property
    def error(self) -> float:
        return math.dist(self.newest.hypotheses[0].position_ne_m, self.target)

    def measured(self, change: Change = whole) -> TrackerReading:
        range_m, heading, speed = self.noise.standard_normal(3) * NOISE_STD
        ranges = change(abs(self.distance + range_m))
        return TrackerReading(self.pose[:2], self.pose[2] + heading, self.pose[3] + speed, ranges)

    def swim(self, duration_s: float, change: Change = whole) -> TrackerStep:
        """Let the tracker command for a while."""
        for _ in range(round(duration_s / DT_S)):
            reading = self.measured(change)
            self.newest = self.tracker.step(reading, DT_S if self.steps else 0.0)
            assert np.isfinite(self.newest.command).all()
            self.steps.append(self.newest)
            if self.is_moved:
                turn_rate, acceleration = self.newest.command
                self.pose = unicycle.advance(self.pose, turn_rate, acceleration, DT_S)
            self.target = self.target + DT_S * self.velocity
        return self.newest


def silent(_range_m: float) -> tuple[RangeHeard, ...]:
    return ()
