"""Whom to follow: the bank, which is fine, or the joint filter, which knows more.

The bank takes its target for one that hardly changes its velocity, and bends itself to whatever
ranges come: misplaced by tens of metres, it still explains them by a false velocity. The joint
filter forgets no motion that all ranges allow, but is coarse. So the bank is followed while the
joint filter is sure of one place and has it there; otherwise the joint filter is.
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.filter import hypothesis_kernel as hk
from autonomy.tracking.filter.bank import PLACED, BankInput
from autonomy.tracking.filter.filter_kernel import pack_filter, start_covariance
from autonomy.tracking.filter.joint import Belief, JointFilter
from autonomy.tracking.filter.late_range import Timeline
from autonomy.tracking.reading import Pair, RangeHeard, TrackerStart

AGREED, REFUTED = 4.0, 16.0
"""Squared distance of the two estimates over their covariance: below the first the bank is followed
again, beyond the second it is not any more."""
STEADY_RATIO, MOVING_RATIO = 0.1, 0.15
"""Speed of the target against the robot's cap up to which the bank is followed again, and from
which on it is not any more."""
LEAST_STD = 0.5
"""Difference of the two that is none, in standard deviations of a range."""
PAUSE_S = 20.0
"""Time between two corrections of the bank."""


@dataclass(frozen=True, slots=True)
class Heard:
    """What became of the ranges by the joint filter's account."""

    silence_s: float
    streak: int
    is_searching: bool
    rejected: int
    """Ranges that were not believed."""


class Arbiter:
    """Runs the joint filter beside a bank, and says which of them holds the target.

    Args:
        config: Of the whole mission.
        start: Where the robot is at time 0, and how it moves.
        generator: Of the joint filter's random numbers.
    """

    def __init__(
        self, config: TrackingConfig, start: TrackerStart, generator: np.random.Generator
    ) -> None:
        self._joint = JointFilter(config, start.own_ne_m, generator)
        self._belief = self._joint.belief()
        self._floor_m2 = LEAST_STD**2 * config.ranging.variance_m2
        self._cap_m_s = config.motion.speed_max_m_s
        self._q = pack_filter(config)
        self._own = np.zeros(hk.SIZE)
        """Own heading and speed by what was measured of them alone: ranges to a target that is
        misplaced bend the bank's."""
        self._own[2:4] = start.heading_rad, start.speed_m_s
        self._own[hk.COVARIANCE : hk.VELOCITY] = start_covariance(1.0, self._q)
        self._corrected_s = -PAUSE_S
        self._streak = 0
        self._heard_s = 0.0
        self._now_s = 0.0
        self._is_searching = False
        self.follows_bank = True
        """Whether the bank is followed."""

    @property
    def belief(self) -> Belief:
        """What the joint filter believes now."""
        return self._belief

    @property
    def own(self) -> FloatArray:
        """Own heading and speed, shape ``(2,)``."""
        return self._own[2:4]

    @property
    def heard(self) -> Heard:
        """What became of the ranges."""
        return Heard(
            self._now_s - self._heard_s, self._streak, self._is_searching, self._joint.rejected
        )

    def step(
        self,
        now_s: float,
        own_ne_m: Pair,
        given: BankInput,
        ranges: tuple[RangeHeard, ...],
        timeline: Timeline,
    ) -> None:
        """Let time pass, take in ranges as they arrive, and decide.

        What is older than the bank's memory, or held before time 0, is left out here as there.

        Args:
            now_s: Time since the tracker began.
            own_ne_m: Where the robot is.
            given: What the bank was given, but for ranges.
            ranges: Finite, not negative, as are their ages.
            timeline: Of the bank, which may be made to follow another place.
        """
        self._now_s = now_s
        hk.pass_time(self._own, *given.command, given.dt_s, 0.0, 0.0, 0.0, self._q)
        hk.hear_own(self._own, given.heading_rad, given.speed_m_s, self._q)
        heading, speed = float(self._own[2]), float(self._own[3])
        rate = (speed * math.cos(heading), speed * math.sin(heading))
        self._joint.step(now_s, own_ne_m, abs(speed), rate)
        count = self._joint.note(ranges)
        self._belief = belief = self._joint.belief()
        if count:
            self._note(own_ne_m, count)
        if self._joint.has_heard:
            self._decide(belief, own_ne_m, timeline)

    def _note(self, own_ne_m: Pair, count: int) -> None:
        belief = self._belief
        if self._joint.is_contradicted:
            self._streak = 0
        else:
            self._streak += count
            self._heard_s = self._now_s
        distance = math.dist(belief.place_ne_m, own_ne_m)
        least = 2.0 * math.sqrt(self._floor_m2) / LEAST_STD
        if self._joint.restarts_at_s == self._now_s:
            self._is_searching = True
        elif belief.worst_std_m < max(PLACED * distance, least):
            self._is_searching = False

    def _decide(self, belief: Belief, own_ne_m: Pair, timeline: Timeline) -> None:
        bank = timeline.bank
        h = bank.best.h
        off = (
            own_ne_m[0] - float(h[0]) - belief.place_ne_m[0],
            own_ne_m[1] - float(h[1]) - belief.place_ne_m[1],
        )
        nn, ne, ee = (
            ours + its
            for ours, its in zip(belief.covariance_m2, bank.best.place_covariance_m2, strict=True)
        )
        nn, ee = nn + self._floor_m2, ee + self._floor_m2
        squared = (ee * off[0] ** 2 - 2.0 * ne * off[0] * off[1] + nn * off[1] ** 2) / (
            nn * ee - ne * ne
        )
        limit = REFUTED if self.follows_bank else AGREED
        ratio = math.hypot(*belief.velocity_ne_m_s) / self._cap_m_s
        is_slow = ratio < (MOVING_RATIO if self.follows_bank else STEADY_RATIO)
        is_settled = is_slow and belief.is_sure and not bank.hearing.is_searching
        self.follows_bank = is_settled and squared < limit
        is_due = self._now_s - self._corrected_s >= PAUSE_S
        if belief.is_sure and not self.follows_bank and is_due:
            self._corrected_s = self._now_s
            north, east = belief.place_ne_m
            relative = (own_ne_m[0] - north, own_ne_m[1] - east)
            timeline.follow_instead(relative, belief.covariance_m2, belief.velocity_ne_m_s)
