"""A fix from outside as a robot hears it, by its own clock."""

import math
from dataclasses import dataclass
from datetime import datetime
from typing import Final

AGE_MAX_S: Final = 1.5
"""An older fix is not taken, and so not sent."""
STD_MAX_M: Final = 1.0
"""A fix that is known less well, along any axis, is none."""


@dataclass(frozen=True, slots=True)
class ReceivedFix:
    """Where somebody outside saw the robot.

    Raises:
        ValueError: If a number is not finite, or a standard deviation is not within 0 .. 1 m.
    """

    measured_at: datetime
    """When it was seen, in the robot's time."""
    ned_m: tuple[float, float, float]
    """North, east, and depth below the real surface."""
    covariance_ne_m2: tuple[float, float, float]
    """Of north and east: xx, xy, yy."""
    depth_variance_m2: float
    heading_rad: float | None
    """From the frame's north; None where only the position is sure."""
    heading_std_rad: float
    roll_rad: float | None
    pitch_rad: float | None
    tilt_std_rad: float
    rms: float
    """Root mean square residual, in standard deviations; 0 where nobody tells."""
    cameras: int
    """How many saw it; 0 where nobody tells."""
    tags: int
    """Likewise."""

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        angles = (self.heading_rad or 0.0, self.roll_rad or 0.0, self.pitch_rad or 0.0)
        stds = (self.heading_std_rad, self.tilt_std_rad)
        numbers = (*self.ned_m, *self.covariance_ne_m2, self.depth_variance_m2, *angles, *stds)
        if not all(map(math.isfinite, (*numbers, self.rms))):
            raise ValueError("a number of the fix is not finite")
        xx, xy, yy = self.covariance_ne_m2
        if min(xx, yy, self.depth_variance_m2) <= 0.0 or xx * yy <= xy**2:
            raise ValueError("the covariance of the fix is not positive definite")
        if max(self.variance_m2, self.depth_variance_m2) > STD_MAX_M**2:
            raise ValueError(f"the fix is known less well than {STD_MAX_M:g} m")
        if min(stds) < 0.0:
            raise ValueError("a standard deviation of the fix is negative")

    @property
    def variance_m2(self) -> float:
        """Variance of the horizontal position along its worst direction."""
        xx, xy, yy = self.covariance_ne_m2
        return 0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy)
