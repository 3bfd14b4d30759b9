"""Whether a fix is to be believed, and how far the fixes that end dives believe the filter.

A filter states how uncertain it is from what it was told of the water, the compass and itself. The
fixes are the only witnesses of whether that is so. Of the last dives each gives the squared
distance of its first fix from where it was expected, by the stated covariance: 2 on average where
all is as told. The scale of the covariance is taken as unknown, with a prior worth
``PRIOR_FREEDOM`` degrees of freedom that it is one; its posterior mean is the doubt squared.
"""

import math
from collections import deque
from enum import Enum, auto

from autonomy.estimation.config import MOST_DOUBT

DIVES = 8
"""So many dives are remembered."""
PRIOR_FREEDOM = 4.0
"""Worth two dives that went as expected."""
SHORTEST_DIVE_S = 10.0
"""A shorter time without a fix tells nothing of the water."""
SURPRISE = 5.99
"""One honest dive in twenty is farther off."""
DOUBTED_DIVES = 2
"""So many dives stand for a doubt that a robot begins with: few, so that it soon learns better."""
DISTANCES = 5.0
"""Two fixes of one place lie within so many standard deviations of their difference."""


class FixWatch:
    """Tells by how much larger the standard deviations are to be stated.

    One strange dive alone is no rule: the largest distance counts at most as the second largest, or
    as one that every twentieth honest dive exceeds. The doubt is never less than one.
    """

    def __init__(self, least_doubt: float = 1.0) -> None:
        self._least = least_doubt
        self._seen: deque[tuple[float, float]] = deque(maxlen=DIVES)

    @property
    def dives(self) -> int:
        """How many dives the doubt is judged by."""
        return len(self._seen)

    @property
    def doubt(self) -> float:
        """Factor on the standard deviations, 1 or more."""
        if not self._seen:
            return self._least
        largest = sorted(squared for squared, _ in self._seen)
        cap = max(SURPRISE, largest[-2] if len(largest) > 1 else 0.0)
        freedom = PRIOR_FREEDOM + sum(2.0 * weight for _, weight in self._seen)
        total = PRIOR_FREEDOM + sum(min(squared, cap) * weight for squared, weight in self._seen)
        return min(max(self._least, math.sqrt(total / freedom)), MOST_DOUBT)

    def take(self, squared: float, weight: float = 1.0) -> None:
        """Take in a dive.

        Args:
            squared: Squared distance of its first fix from the expected place, by the filter's own
                covariance (two coordinates), before it was taken in.
            weight: How much of that covariance will be there in the next dive too, 0 to 1: what a
                fix tells of a current is learned, and says little of the rest.
        """
        self._seen.append((squared, weight))

    def begin_with(self, doubt: float) -> None:
        """Begin with a doubt that was found before; one is none."""
        if doubt > 1.0:
            for _ in range(DOUBTED_DIVES):
                self.take(doubted_distance(doubt))


def doubted_distance(doubt: float) -> float:
    """Return the squared distance at which ``DOUBTED_DIVES`` dives alone make for a doubt."""
    freedom = PRIOR_FREEDOM + 2.0 * DOUBTED_DIVES
    return (freedom * doubt**2 - PRIOR_FREEDOM) / DOUBTED_DIVES


class Verdict(Enum):
    """What becomes of a fix."""

    BELIEVED = auto()
    REFUSED = auto()
    REOPENED = auto()
    """Believed although it lies too far off, because those before it say the same."""


class FixGate:
    """Refuses fixes that lie too far off, until so many in a row agree that the filter was wrong.

    Args:
        limit: Squared distance in standard deviations beyond which a fix lies too far off.
        patience: So many in a row that agree re-open the question.
        greatest_speed_m_s: How fast the robot may move over ground.
        fix_std_m: Of a fix, per axis.
    """

    def __init__(
        self, limit: float, patience: int, greatest_speed_m_s: float, fix_std_m: float
    ) -> None:
        self._limit = limit
        self._patience = patience
        self._speed = greatest_speed_m_s
        self._std_m = fix_std_m
        self._strange: tuple[float, float] | None = None
        self._in_a_row = 0
        self.refused = 0
        """Fixes that were refused so far."""

    def judge(
        self,
        fix_ne: tuple[float, float],
        squared: float,
        away_m: float,
        since_s: float,
        std_m: float | None = None,
    ) -> Verdict:
        """Judge a fix.

        Args:
            fix_ne: Northing and easting.
            squared: Its squared distance from the expected place in standard deviations.
            away_m: Its distance from the last fix that was believed.
            since_s: Time since then.
            std_m: Of this fix, per axis; None where it is as usual.
        """
        alike_m = DISTANCES * math.sqrt(2.0) * (self._std_m if std_m is None else std_m)
        reach_m = self._speed * since_s + alike_m
        if squared <= self._limit and away_m <= reach_m:
            self._strange, self._in_a_row = None, 0
            return Verdict.BELIEVED
        before, self._strange = self._strange, fix_ne
        # fixes come often, so those of one place lie near each other
        near_m = self._speed * 2.0 + alike_m
        agrees = before is not None and math.dist(before, fix_ne) <= near_m
        self._in_a_row = self._in_a_row + 1 if agrees else 1
        if self._in_a_row >= self._patience:
            self._strange, self._in_a_row = None, 0
            return Verdict.REOPENED
        self.refused += 1
        return Verdict.REFUSED
