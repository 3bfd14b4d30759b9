"""A unicycle and a target in still water, and what the robot measures there."""

import math

import numpy as np

from autonomy.tracking.config import RangingConfig, TargetConfig, TrackingConfig
from autonomy.tracking.tracker import RangeHeard, Tracker, TrackerReading, TrackerStart
from reproduction.tracking import unicycle

DT_S = 0.1
NOISE_STD = np.sqrt([0.1, 0.0175, 0.1])
QUICK = RangingConfig(period_s=0.1, lost_after_s=8.0, give_up_after_s=40.0)
"""Gives up soon, so that tests are short."""


def settings(guess_ne_m=(0.0, 0.0), guess_std_m=0.4, ranging=QUICK, **parts):
    target = TargetConfig(north_m=guess_ne_m[0], east_m=guess_ne_m[1], guess_std_m=guess_std_m)
    return TrackingConfig(target=target, ranging=ranging, **parts)


class Water:
    """A robot at ``pose`` (north, east, heading, speed) that obeys its tracker, and a target."""

    def __init__(self, config, pose=(-3.0, 1.0, 0.5, 0.2), target=(0.0, 0.0), seed=1):
        self.pose, self.target, self.velocity = pose, np.array(target), np.zeros(2)
        self.noise = np.random.default_rng(seed)
        self.tracker = Tracker(config, TrackerStart(pose[:2], pose[2], pose[3]))
        self.time_s, self.newest, self.steps = 0.0, None, []
        self.is_moved = True

    @property
    def distance(self):
        return float(np.hypot(*(np.array(self.pose[:2]) - self.target)))

    @property
    def error(self):
        return math.dist(self.newest.hypotheses[0].position_ne_m, self.target)

    def measured(self, change=lambda range_m: (RangeHeard(range_m),)):
        range_m, heading, speed = self.noise.standard_normal(3) * NOISE_STD
        ranges = change(abs(self.distance + range_m))
        return TrackerReading(self.pose[:2], self.pose[2] + heading, self.pose[3] + speed, ranges)

    def swim(self, duration_s, change=lambda range_m: (RangeHeard(range_m),)):
        """Let the tracker command for a while; ``change`` is what the water does to a range."""
        for _ in range(round(duration_s / DT_S)):
            reading = self.measured(change)
            self.newest = self.tracker.step(reading, DT_S if self.steps else 0.0)
            assert np.isfinite(self.newest.command).all()
            self.steps.append(self.newest)
            if self.is_moved:
                self.pose = unicycle.advance(self.pose, *self.newest.command, DT_S)
            self.target = self.target + DT_S * self.velocity
        return self.newest


def silent(_range_m):
    return ()
