"""Where the robot was a while ago, for ranges that come late."""

from collections import deque

from autonomy.tracking.filter.late_range import LONGEST_AGE_S, SAME_TIME_S
from autonomy.tracking.reading import Pair, RangeHeard


class OwnWay:
    """The robot's positions of the last while.

    Args:
        own_ne_m: Where the robot is at time 0.
    """

    def __init__(self, own_ne_m: Pair) -> None:
        self._places: deque[tuple[float, float, float]] = deque([(0.0, *own_ne_m)])

    def add(self, now_s: float, own_ne_m: Pair) -> None:
        """Take where the robot is now, and forget what no range can be as old as."""
        self._places.append((now_s, *own_ne_m))
        while self._places[0][0] < now_s - LONGEST_AGE_S:
            self._places.popleft()

    def placed(self, ranges: tuple[RangeHeard, ...]) -> list[tuple[float, Pair, float]]:
        """Return when each range held, where the robot was then, and the range; oldest first.

        What held before the first place that is remembered is left out.

        Args:
            ranges: As of the newest place; finite, not negative, as are their ages.
        """
        now_s = self._places[-1][0]
        earliest_s = self._places[0][0] - SAME_TIME_S
        held = sorted((now_s - heard.age_s, heard.range_m) for heard in ranges)
        return [(at_s, self._at(at_s), range_m) for at_s, range_m in held if at_s >= earliest_s]

    def _at(self, time_s: float) -> Pair:
        """Return where the robot was, by the straight line between two steps."""
        after_s, north, east = self._places[-1]
        for before_s, before_north, before_east in reversed(self._places):
            if before_s <= time_s:
                share = (time_s - before_s) / (after_s - before_s) if after_s > before_s else 0.0
                return (
                    before_north + share * (north - before_north),
                    before_east + share * (east - before_east),
                )
            after_s, north, east = before_s, before_north, before_east
        return north, east
