"""What a robot says of its place beside what cameras saw at about the same time; pure.

The robot is moved by the velocity that it told to the moment of the fix.
"""

import math
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from robot_link.camera.fix import CameraFix
from robot_link.messages import StateReport

NEAR: Final = timedelta(seconds=0.5)
"""Report and fix that are farther apart in time are not compared."""
STDS, LEAST_M, LASTING = 5.0, 0.3, timedelta(seconds=3)
"""Robot and cameras disagree when they are apart by more than both, for so long."""


@dataclass(frozen=True, slots=True)
class Apart:
    """How far a robot is from where cameras saw it."""

    at: datetime
    distance_m: float
    std_m: float
    """Of both together, along their worst axes."""

    @property
    def is_contradiction(self) -> bool:
        """Whether it is more than both can be wrong."""
        return self.distance_m > max(STDS * self.std_m, LEAST_M)


def compared(state: StateReport, said_at: datetime, fix: CameraFix) -> Apart | None:
    """Return how far a robot is from a fix, None where they are not of one moment.

    Args:
        state: What the robot said.
        said_at: Of which moment it said that, by the station's clock.
        fix: Where cameras saw it.
    """
    after = fix.measured_at - said_at
    if fix.quality == "refused" or abs(after) > NEAR:
        return None
    after_s = after.total_seconds()
    moved = [
        place + after_s * (speed if math.isfinite(speed) else 0.0)
        for place, speed in zip(state.position_ned, state.velocity_ned, strict=True)
    ]
    distance_m = math.dist(moved, fix.ned_m)
    std_m = math.hypot(state.position_std_m, _worst_std_m(fix))
    if not math.isfinite(distance_m + std_m):
        return None
    return Apart(max(fix.measured_at, said_at), distance_m, std_m)


def _worst_std_m(fix: CameraFix) -> float:
    """Return a bound of the standard deviation along any axis: the root of the trace."""
    xx, _, _, yy, _, zz = fix.covariance_m2
    return math.sqrt(xx + yy + zz)


@dataclass(slots=True)
class Disagreement:
    """Whether a robot that says it has a fix contradicts the cameras, and since when."""

    is_told: bool = False
    _since: datetime | None = None

    def take(self, apart: Apart | None, *, has_fix: bool) -> bool | None:
        """Take a comparison; return whether to raise (True) or to end (False) the alarm."""
        if apart is None:
            return None
        if not has_fix or not apart.is_contradiction:
            self._since = None
            if self.is_told and not apart.is_contradiction:
                self.is_told = False
                return False
            return None
        self._since = self._since or apart.at
        if not self.is_told and apart.at - self._since >= LASTING:
            self.is_told = True
            return True
        return None
