"""Own position from ranges to one beacon of known place: tracking, the other way round.

To a robot that reckons wrongly, a beacon that stays seems to stand where its own error puts it, and
to move as the current does that dead reckoning does not see. The cloud of the places where a target
may be finds both; what it says of the beacon, turned round, is where the robot is.
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.filter.cloud import TargetCloud
from autonomy.tracking.filter.own_way import OwnWay
from autonomy.tracking.reading import Pair, RangeHeard


@dataclass(frozen=True, slots=True)
class BeaconFix:
    """Where the robot is by its ranges to the beacon."""

    position_ne_m: Pair
    """Mean, in the frame in which the beacon's place was given."""
    covariance_m2: tuple[float, float, float]
    """Of the position: north-north, north-east, east-east; wide while two places are possible."""
    current_ne_m_s: Pair
    """How the water moves over ground beyond what dead reckoning knows."""
    silence_s: float
    """Time since a range held."""

    @property
    def position_std_m(self) -> float:
        """Standard deviation of the position along its worst direction."""
        nn, ne, ee = self.covariance_m2
        return math.sqrt(0.5 * (nn + ee) + math.hypot(0.5 * (nn - ee), ne))


class BeaconNavigator:
    """Dead reckoning that ranges to one beacon hold in bounds.

    The robot must turn now and then: along a straight course both sides of it look alike.

    Args:
        config: Noise of ranges; its target's place is the beacon's, its target's speed the current.
        own_ne_m: Where the robot believes to be at the start.
        own_std_m: How well it knows that, per axis.
        generator: Source of the cloud's random numbers.

    Raises:
        ValueError: If a number is not finite or ``own_std_m`` is negative.
    """

    def __init__(
        self,
        config: TrackingConfig,
        own_ne_m: Pair,
        own_std_m: float,
        generator: np.random.Generator,
    ) -> None:
        _check(own_ne_m, own_std_m, 0.0)
        self._beacon = (config.target.north_m, config.target.east_m)
        self._cloud = TargetCloud(config, generator, guess_std_m=own_std_m)
        self._moments = self._cloud.moments()
        self._way = OwnWay(own_ne_m)
        self._now_s = self._heard_s = 0.0
        self._own_variance_m2 = own_std_m**2
        self._strayed_m2 = 0.0
        """What dead reckoning has lost since the newest range."""

    def step(
        self,
        own_ne_m: Pair,
        own_std_m: float,
        dt_s: float,
        ranges: tuple[RangeHeard, ...] = (),
    ) -> BeaconFix:
        """Let ``dt_s`` pass, then take in the ranges that came.

        Args:
            own_ne_m: Where the robot is by dead reckoning, without this navigator's fixes.
            own_std_m: How well that is known, per axis; what it grows by is doubted of the place.
            dt_s: Time since the step before, s.
            ranges: Horizontal ranges to the beacon, late ones too; bad ones are left out.

        Raises:
            ValueError: If a number is not finite, or ``own_std_m`` or ``dt_s`` is negative.
        """
        _check(own_ne_m, own_std_m, dt_s)
        self._now_s += dt_s
        self._way.add(self._now_s, own_ne_m)
        self._strayed_m2 += max(own_std_m**2 - self._own_variance_m2, 0.0)
        self._own_variance_m2 = own_std_m**2
        held = self._way.placed(tuple(heard for heard in ranges if heard.is_good))
        for held_s, own_then_ne_m, range_m in held:
            self._cloud.stray(self._strayed_m2)
            self._strayed_m2 = 0.0
            self._cloud.hear(held_s, own_then_ne_m, range_m)
        if held:
            self._heard_s = max(self._heard_s, held[-1][0])
            self._moments = self._cloud.moments()
        return self._fix(own_ne_m)

    def _fix(self, own_ne_m: Pair) -> BeaconFix:
        mean, covariance = self._moments
        silence_s = self._now_s - self._heard_s
        onwards = np.hstack([np.eye(2), silence_s * np.eye(2)])
        north, east = onwards @ mean
        now = onwards @ covariance @ onwards.T + self._strayed_m2 * np.eye(2)
        return BeaconFix(
            position_ne_m=(
                own_ne_m[0] + self._beacon[0] - float(north),
                own_ne_m[1] + self._beacon[1] - float(east),
            ),
            covariance_m2=(float(now[0, 0]), float(now[0, 1]), float(now[1, 1])),
            current_ne_m_s=(-float(mean[2]), -float(mean[3])),
            silence_s=silence_s,
        )


def _check(own_ne_m: Pair, own_std_m: float, dt_s: float) -> None:
    if not all(math.isfinite(value) for value in own_ne_m):
        raise ValueError("the beacon navigator needs a finite position")
    if not (0.0 <= own_std_m < math.inf and 0.0 <= dt_s < math.inf):
        raise ValueError("the beacon navigator needs own_std_m and dt_s that are finite and >= 0")
