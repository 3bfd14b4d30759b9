"""Own position from ranges to one beacon of known place: tracking, the other way round.

Robot minus beacon is what the filter bank estimates; where the beacon is known, that is the robot's
own place. A beacon that stays seems to move through water that flows, so the velocity filter finds
the current, which dead reckoning cannot see.
"""

import math
from dataclasses import dataclass

from autonomy.tracking.bank import Bank, BankInput
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.late_range import Timeline
from autonomy.tracking.reading import Pair, RangeHeard


@dataclass(frozen=True, slots=True)
class BeaconFix:
    """Where the robot is by its ranges to the beacon."""

    position_ne_m: Pair
    """In the frame in which the beacon's place was given."""
    covariance_m2: tuple[float, float, float]
    """Of the position: north-north, north-east, east-east."""
    weight: float
    """Probability that it is this place and no mirrored one."""
    current_ne_m_s: Pair
    """How the water moves over ground."""
    silence_s: float
    """Time since a range was believed."""
    is_sure: bool
    """Whether the ranges agree with this place."""

    @property
    def position_std_m(self) -> float:
        """Standard deviation of the position along its worst direction."""
        nn, ne, ee = self.covariance_m2
        return math.sqrt(0.5 * (nn + ee) + math.hypot(0.5 * (nn - ee), ne))


class BeaconNavigator:
    """Dead reckoning that ranges to one beacon hold in bounds.

    The robot must turn now and then: along a straight course both sides of it look alike.

    Args:
        config: Noise and gate of ranges and filter; its target's place is the beacon's.
        own_ne_m: Where the robot believes to be at the start.
        own_std_m: How well it knows that, per axis.
        heading_rad: Of the robot.
        speed_m_s: Of the robot, through the water.

    Raises:
        ValueError: If a number is not finite or ``own_std_m`` is not positive.
    """

    def __init__(
        self,
        config: TrackingConfig,
        own_ne_m: Pair,
        own_std_m: float,
        heading_rad: float,
        speed_m_s: float,
    ) -> None:
        self._beacon = (config.target.north_m, config.target.east_m)
        relative = (own_ne_m[0] - self._beacon[0], own_ne_m[1] - self._beacon[1])
        bank = Bank.begin(config, relative, heading_rad, speed_m_s, own_std_m)
        self._timeline = Timeline(bank)

    def step(
        self,
        heading_rad: float,
        speed_m_s: float,
        dt_s: float,
        *,
        turn_rate_rad_s: float = 0.0,
        acceleration_m_s2: float = 0.0,
        ranges: tuple[RangeHeard, ...] = (),
    ) -> BeaconFix:
        """Let ``dt_s`` pass, then take in what was measured at its end.

        Args:
            heading_rad: Measured; NaN where none was.
            speed_m_s: Measured, through the water; NaN where none was.
            dt_s: Time since the step before, s.
            turn_rate_rad_s: What held since then, as commanded or by the gyro.
            acceleration_m_s2: The same of the speed.
            ranges: Horizontal ranges to the beacon, late ones too; bad ones are left out.

        Raises:
            ValueError: If ``dt_s``, turn rate or acceleration is not finite, or ``dt_s`` negative.
        """
        command = (turn_rate_rad_s, acceleration_m_s2)
        if not (0.0 <= dt_s < math.inf and all(math.isfinite(value) for value in command)):
            raise ValueError("the beacon navigator needs dt_s >= 0 and finite rates")
        good = tuple(heard for heard in ranges if heard.is_good)
        self._timeline.step(BankInput(dt_s, command, heading_rad, speed_m_s), good)
        return self._fix()

    def _fix(self) -> BeaconFix:
        bank = self._timeline.bank
        h = bank.best.h
        north, east = bank.best.velocity_ne_m_s
        return BeaconFix(
            position_ne_m=(self._beacon[0] + float(h[0]), self._beacon[1] + float(h[1])),
            covariance_m2=bank.best.place_covariance_m2,
            weight=bank.best.weight,
            current_ne_m_s=(-north, -east),
            silence_s=bank.hearing.silence_s,
            is_sure=not bank.hearing.is_searching,
        )
