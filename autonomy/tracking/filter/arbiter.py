"""Holds a filter bank against the cloud of all places that the ranges allow."""

import numpy as np

from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.filter.cloud import TargetCloud
from autonomy.tracking.filter.late_range import Timeline
from autonomy.tracking.filter.own_way import OwnWay
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
        self._way = OwnWay(own_ne_m)

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
        self._way.add(now_s, own_ne_m)
        usable = self._way.placed(ranges)
        for held_s, own_then_ne_m, range_m in usable:
            self._cloud.hear(held_s, own_then_ne_m, range_m)
        if usable:
            self._judge(own_ne_m, timeline)

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
