"""Fixes that somebody outside sends by radio: which are taken, and how late they are."""

from dataclasses import dataclass
from datetime import datetime
from typing import Final

from autonomy.site import Site
from robot_link.camera.received_fix import AGE_MAX_S, ReceivedFix

AHEAD_MAX_S: Final = 0.1
"""So much may the station be wrong of the robot's clock."""
OUTSIDE_MAX_M: Final = 0.5
"""Nobody swims farther outside of the water."""


@dataclass(frozen=True, slots=True)
class LateFix:
    """A fix, and how long ago it was measured."""

    fix: ReceivedFix
    age_s: float


class OutsideFixes:
    """Judges fixes as they come, counts those that it refuses, and keeps the newest for a step.

    Args:
        site: Where the robot works.
        surface_depth_m: A robot that reads a greater depth takes no fix.
    """

    def __init__(self, site: Site, surface_depth_m: float) -> None:
        self._site = site
        self._surface_depth_m = surface_depth_m
        self._newest: ReceivedFix | None = None
        self._newest_at: datetime | None = None
        self.taken = 0
        """Fixes that were handed to the filters so far."""
        self.refused = 0
        """Fixes that were refused so far."""
        self.reason = ""
        """Why the last of those was refused, a sentence."""

    def hear(self, fix: ReceivedFix, now: datetime, depth_m: float | None) -> None:
        """Take a fix or refuse it.

        Args:
            fix: What came.
            now: The robot's clock.
            depth_m: What its depth sensor reads; None where the depth does not matter, as for
                its own camera.
        """
        if reason := self._refusal(fix, now, depth_m):
            self.refuse(reason)
            return
        self._newest, self._newest_at = fix, fix.measured_at

    def refuse(self, reason: str) -> None:
        """Count a fix that is none, or not for this robot."""
        self.refused += 1
        self.reason = reason

    @property
    def are_waiting(self) -> bool:
        """Whether a fix came since the last step."""
        return self._newest is not None

    def take(self, now: datetime) -> LateFix | None:
        """Return the fix that came since the last step, once; None without one."""
        fix, self._newest = self._newest, None
        if fix is None:
            return None
        self.taken += 1
        return LateFix(fix, max(0.0, (now - fix.measured_at).total_seconds()))

    def _refusal(self, fix: ReceivedFix, now: datetime, depth_m: float | None) -> str:
        age_s = (now - fix.measured_at).total_seconds()
        north, east, down = fix.ned_m
        if age_s > AGE_MAX_S:
            return f"the fix is {age_s:.1f} s old; it may be {AGE_MAX_S:g} s"
        if age_s < -AHEAD_MAX_S:
            return f"the fix is {-age_s:.1f} s ahead of the robot's clock; {AHEAD_MAX_S:g} s may be"
        if self._newest_at is not None and fix.measured_at <= self._newest_at:
            return "the fix is not newer than the last one"
        above_m = max(-down, down - self._site.water.depth_max_m)
        if max(-self._site.clearance_m(north, east), above_m) > OUTSIDE_MAX_M:
            return f"the fix lies more than {OUTSIDE_MAX_M:g} m outside of the water"
        if depth_m is not None and depth_m > self._surface_depth_m:
            return f"the robot is {depth_m:.2f} m deep; fixes count to {self._surface_depth_m:g} m"
        return ""
