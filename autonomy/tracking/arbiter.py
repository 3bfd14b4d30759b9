"""Holds a filter bank against the cloud of all places that the ranges allow."""

from collections import deque

import numpy as np

from autonomy.tracking.cloud import TargetCloud
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.late_range import LONGEST_AGE_S, Timeline
from autonomy.tracking.reading import RangeHeard

SEED = 4
"""The cloud's random numbers are the same in every mission: the same ranges give the same track."""
REFUTED = 0.1
"""An estimate near which the cloud has less than this share is not the target."""
CONVINCED = 0.6
"""Share of the cloud that must be in one place for it to be believed instead."""


class Arbiter:
    """Replaces what a bank follows where all ranges together refute it and agree on another place.

    Args:
        config: Of the whole mission.
        own_ne_m: Where the robot is at time 0.
    """

    def __init__(self, config: TrackingConfig, own_ne_m: tuple[float, float]) -> None:
        self._cloud = TargetCloud(config, np.random.default_rng(SEED))
        self._way: deque[tuple[float, float, float]] = deque([(0.0, *own_ne_m)])

    def step(
        self,
        now_s: float,
        own_ne_m: tuple[float, float],
        ranges: tuple[RangeHeard, ...],
        timeline: Timeline,
    ) -> None:
        """Take in ranges as they arrive, each where the robot was when it held.

        Args:
            now_s: Time since the tracker began.
            own_ne_m: Where the robot is.
            ranges: Finite, not negative, as are their ages.
            timeline: Of the bank, which may be made to follow another place.
        """
        self._way.append((now_s, *own_ne_m))
        while self._way[0][0] < now_s - LONGEST_AGE_S:
            self._way.popleft()
        fresh = [heard for heard in ranges if heard.age_s <= LONGEST_AGE_S]
        for heard in fresh:
            held_s = now_s - heard.age_s
            self._cloud.hear(held_s, self._own_at(held_s), heard.range_m)
        if fresh:
            self._judge(own_ne_m, timeline)

    def _own_at(self, time_s: float) -> tuple[float, float]:
        way = np.array(self._way)
        north, east = (float(np.interp(time_s, way[:, 0], way[:, axis])) for axis in (1, 2))
        return north, east

    def _judge(self, own_ne_m: tuple[float, float], timeline: Timeline) -> None:
        h = timeline.bank.best.h
        followed = (own_ne_m[0] - float(h[0]), own_ne_m[1] - float(h[1]))
        if self._cloud.share_near(followed) >= REFUTED:
            return
        likeliest = self._cloud.likeliest(own_ne_m)
        if likeliest.share >= CONVINCED:
            north, east = likeliest.place_ne_m
            relative = (own_ne_m[0] - north, own_ne_m[1] - east)
            velocity = likeliest.velocity_ne_m_s
            timeline.follow_instead(relative, likeliest.covariance_m2, velocity)
