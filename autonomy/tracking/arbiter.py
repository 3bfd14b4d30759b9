"""Holds a filter bank against the cloud of all places that the ranges allow."""

from collections import deque

import numpy as np

from autonomy.tracking.cloud import TargetCloud
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.late_range import LONGEST_AGE_S, SAME_TIME_S, Timeline
from autonomy.tracking.reading import RangeHeard

REFUTED = 0.1
"""An estimate near which the cloud has less than this share is not the target."""
CONVINCED = 0.6
"""Share of the cloud that must be in one place for it to be believed instead."""


class Arbiter:
    """Replaces what a bank follows where all ranges together refute it and agree on another place.

    Args:
        config: Of the whole mission.
        own_ne_m: Where the robot is at time 0.
        generator: Of the cloud's random numbers.
    """

    def __init__(
        self, config: TrackingConfig, own_ne_m: tuple[float, float], generator: np.random.Generator
    ) -> None:
        self._cloud = TargetCloud(config, generator)
        self._way: deque[tuple[float, float, float]] = deque([(0.0, *own_ne_m)])

    def step(
        self,
        now_s: float,
        own_ne_m: tuple[float, float],
        ranges: tuple[RangeHeard, ...],
        timeline: Timeline,
    ) -> None:
        """Take in ranges as they arrive, each where the robot was when it held.

        What is older than the bank's memory, or held before time 0, is left out here as there.

        Args:
            now_s: Time since the tracker began.
            own_ne_m: Where the robot is.
            ranges: Finite, not negative, as are their ages.
            timeline: Of the bank, which may be made to follow another place.
        """
        self._way.append((now_s, *own_ne_m))
        while self._way[0][0] < now_s - LONGEST_AGE_S:
            self._way.popleft()
        earliest_s = self._way[0][0] - SAME_TIME_S
        held = sorted((now_s - heard.age_s, heard.range_m) for heard in ranges)
        usable = [one for one in held if one[0] >= earliest_s]
        for held_s, range_m in usable:
            self._cloud.hear(held_s, self._own_at(held_s), range_m)
        if usable:
            self._judge(own_ne_m, timeline)

    def _own_at(self, time_s: float) -> tuple[float, float]:
        """Return where the robot was, by the straight line between two steps."""
        after_s, north, east = self._way[-1]
        for before_s, before_north, before_east in reversed(self._way):
            if before_s <= time_s:
                share = (time_s - before_s) / (after_s - before_s) if after_s > before_s else 0.0
                return (
                    before_north + share * (north - before_north),
                    before_east + share * (east - before_east),
                )
            after_s, north, east = before_s, before_north, before_east
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
