"""When pictures were taken by the station's clock, and which of them are not believed."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from robot_link.camera.sighting import Sighting
from robot_link.clock import Clock

OLDEST_S: Final = 1.0
"""A picture that is older when it arrives makes no fix."""
_AHEAD_S: Final = 0.05
TOLD_AFTER: Final = 10
"""So many in a row are not believed before somebody is told."""

OLD: Final = "arrive more than 1 s after they were taken"
AHEAD: Final = "were taken later than now"
BACK: Final = "go back"


@dataclass(slots=True)
class PictureMoments:
    """Judges the times of one camera's pictures, in the order in which they arrive."""

    clock: Clock
    _last: datetime | None = None
    doubted: int = 0
    """Pictures in a row whose times were not believed."""

    def taken_at(self, sighting: Sighting, wall_now: datetime) -> datetime | str:
        """Return when a picture was taken by the station's clock, or why that is not believed.

        Args:
            sighting: What was seen; its times are the wall's.
            wall_now: The wall's time of its arrival.
        """
        fault = self._fault(sighting, wall_now)
        self._last = sighting.taken_at
        if fault is not None:
            self.doubted += 1
            return fault
        self.doubted = 0
        age_s = (wall_now - sighting.taken_at).total_seconds()
        return self.clock.now() - timedelta(seconds=max(age_s, 0.0) * self.clock.speed)

    def _fault(self, sighting: Sighting, wall_now: datetime) -> str | None:
        age_s = (wall_now - sighting.taken_at).total_seconds()
        if age_s > OLDEST_S:
            return OLD
        if age_s < -_AHEAD_S or sighting.taken_at > sighting.arrived_at:
            return AHEAD
        if self._last is not None and sighting.taken_at <= self._last:
            return BACK
        return None
