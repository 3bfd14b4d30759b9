"""Fixes that somebody outside sends by radio: which are taken, and how late they are."""

import re
from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import Enum, auto
from typing import Final

from autonomy.site import Site
from robot_link.camera.received_fix import AGE_MAX_S, ReceivedFix

AHEAD_MAX_S: Final = 0.1
"""So much may the station be wrong of the robot's clock."""
OUTSIDE_MAX_M: Final = 0.5
"""Nobody swims farther outside of the water."""
UNFIXED_S: Final = 2.0
"""A robot that took no fix for so long says why it refuses those that come."""
TOLD_PERIOD_S: Final = 10.0
"""It says so at most so often."""
_NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?")


class FixSource(Enum):
    """Who told a robot its place."""

    SENSOR = auto()
    """A sensor of its own, such as GPS."""
    CAMERAS = auto()
    """Somebody outside who sees it."""
    OWN_CAMERA = auto()


@dataclass(frozen=True, slots=True)
class LateFix:
    """A fix, how long ago it was measured, and by whom."""

    fix: ReceivedFix
    age_s: float
    by: FixSource = FixSource.CAMERAS


class OutsideFixes:
    """Judges fixes as they come, counts those that it refuses, and keeps the newest for a step.

    Args:
        site: Where the robot works.
        surface_depth_m: A robot that reads a greater depth takes no fix from outside.
    """

    def __init__(self, site: Site, surface_depth_m: float) -> None:
        self._site = site
        self.surface_depth_m = surface_depth_m
        """A robot that reads a greater depth takes no fix from outside."""
        self._newest: tuple[ReceivedFix, FixSource] | None = None
        self._newest_at: datetime | None = None
        self.taken = 0
        """Fixes that were handed to the filters so far."""
        self.refused = 0
        """Fixes that were refused so far."""
        self.reason = ""
        """Why the last of those was refused, a sentence."""
        self._known = (0, 0)
        """Taken and refused when the newest fix was taken."""
        self._taken_s = self._told_s = -TOLD_PERIOD_S
        self._told = ""

    def hear(
        self,
        fix: ReceivedFix,
        now: datetime,
        depth_m: float,
        by: FixSource = FixSource.CAMERAS,
    ) -> None:
        """Take a fix or refuse it.

        Args:
            fix: What came.
            now: The robot's clock.
            depth_m: What its depth sensor reads; it does not matter for its own camera.
            by: Who saw it.
        """
        if reason := self._refusal(fix, now, depth_m, by):
            self.refuse(reason)
            return
        self._newest, self._newest_at = (fix, by), fix.measured_at

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
        newest, self._newest = self._newest, None
        if newest is None:
            return None
        fix, by = newest
        self.taken += 1
        return LateFix(fix, max(0.0, (now - fix.measured_at).total_seconds()), by)

    def due_reason(self, time_s: float) -> str:
        """Return why fixes that come are not taken, where that is news; "" elsewhere.

        Nobody needs to hear that one which came twice was refused while others are taken. A kind of
        reason is told once until fixes are taken again.

        Args:
            time_s: Seconds since the program began; call it at each step.
        """
        if self.taken != self._known[0]:
            self._known, self._taken_s, self._told = (self.taken, self.refused), time_s, ""
        kind = _NUMBER.sub("..", self.reason)
        is_unfixed = self.refused > self._known[1] and time_s - self._taken_s >= UNFIXED_S
        if not is_unfixed or kind == self._told or time_s - self._told_s < TOLD_PERIOD_S:
            return ""
        self._told, self._told_s = kind, time_s
        return self.reason

    def _refusal(self, fix: ReceivedFix, now: datetime, depth_m: float, by: FixSource) -> str:
        age_s = (now - fix.measured_at).total_seconds()
        north, east, down = fix.ned_m
        if age_s > AGE_MAX_S:
            return f"the fix is {age_s:.1f} s old; it may be {AGE_MAX_S:g} s"
        if age_s < -AHEAD_MAX_S:
            return f"the fix is {-age_s:.1f} s ahead of the robot's clock; {AHEAD_MAX_S:g} s may be"
        before = self._newest_at
        if before is not None and before - now > timedelta(seconds=AHEAD_MAX_S):
            before = None  # the clock was set back since: what was measured then is not newer
        if before is not None and fix.measured_at <= before:
            return "the fix is not newer than the last one"
        above_m = max(-down, down - self._site.water.depth_max_m)
        if max(-self._site.clearance_m(north, east), above_m) > OUTSIDE_MAX_M:
            return f"the fix lies more than {OUTSIDE_MAX_M:g} m outside of the water"
        deepest_m = self.surface_depth_m
        if by is not FixSource.OWN_CAMERA and depth_m > deepest_m:
            return f"the robot is {depth_m:.2f} m deep; fixes count to {deepest_m:.3g} m"
        return ""
