"""How well cameras see one robot, as its link tells it."""

from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Final

from robot_link.camera.fix import CameraFix
from robot_link.messages import LinkReport, LinkState, RobotId
from robot_link.station.gateway.address import CAMERA_CARRIER
from server.fleet.words import clock_time

LIVE: Final = timedelta(seconds=2)
"""A fix that is older is none."""
_RATE: Final = timedelta(seconds=2)
_COUNTED: Final = timedelta(seconds=10)
"""So long an age is told by seconds, then by the clock."""
_STANDINGS: Mapping[str, str] = MappingProxyType(
    {
        "unseen": "{robot} is out of every picture",
        "lost": "Cameras should see {robot} and do not find its tags",
    }
)


@dataclass(slots=True)
class CameraSight:
    """What cameras know of one robot. Belongs to one event loop."""

    robot: RobotId
    uri: str
    obstacle: str = ""
    """Why it is not sought, such as that no camera is calibrated; empty if it is."""
    standing: str = "found"
    """``found``, ``lost`` or ``unseen``."""
    refusal: str = ""
    """Why the newest set of pictures gave no fix; empty if it gave one."""
    unsent: str = ""
    """Why the newest fix is not sent to the robot; empty if it waits for its turn or was sent."""
    newest: CameraFix | None = None
    """That was taken."""
    found: int = 0
    refused: Counter[str] = field(default_factory=Counter[str])
    """Sets of pictures that gave no fix, by reason, whose numbers are left out."""
    _lately: deque[datetime] = field(default_factory=deque[datetime])

    def take(self, fix: CameraFix | None, reason: str) -> None:
        """Take what a set of pictures gave."""
        if fix is None or fix.quality == "refused":
            self.refused[reason.partition(" (")[0]] += 1
            self.refusal = reason
            return
        self.found += 1
        self.refusal, self.standing, self.newest = "", "found", fix
        self._lately.append(fix.measured_at)
        while fix.measured_at - self._lately[0] > _RATE:
            self._lately.popleft()

    def report(self, now: datetime) -> LinkReport:
        """Return the link as it is now."""
        at = None if self.newest is None else self.newest.measured_at
        is_live = at is not None and now - at <= LIVE and not self.obstacle
        state = LinkState.NEVER_HEARD if at is None else LinkState.STALE
        return LinkReport(
            robot=self.robot,
            carrier=CAMERA_CARRIER,
            state=LinkState.LIVE if is_live else state,
            heard_at=at,
            rssi_dbm=None,
            frames_received=self.found,
            frames_bad=self.refused.total(),
            uri=self.uri,
            words=self._words(now, is_live=is_live),
        )

    def _words(self, now: datetime, *, is_live: bool) -> str:
        if self.newest is None:
            why = self.obstacle or self.refusal
            never = f"Cameras never saw {self.robot}"
            return f"{never}: {why}." if why else f"{never}."
        age_s = max((now - self.newest.measured_at).total_seconds(), 0.0)
        if is_live:
            many = len(self.newest.cameras)
            cameras = "1 camera" if many == 1 else f"{many} cameras"
            unsent = f"; not sent: {self.unsent}" if self.unsent else ""
            return f"{cameras}, {self._rate(now):.0f} a second, {age_s:.1f} s old{unsent}."
        standing = _STANDINGS.get(self.standing, "Cameras see {robot} no more")
        why = self.obstacle or self.refusal
        seen = (
            f"seen {age_s:.0f} s ago"
            if timedelta(seconds=age_s) <= _COUNTED
            else f"last seen at {clock_time(self.newest.measured_at)}"
        )
        text = f"{standing.format(robot=self.robot)}; {seen}"
        return f"{text}; {why}." if why else f"{text}."

    def _rate(self, now: datetime) -> float:
        return sum(now - at <= _RATE for at in self._lately) / _RATE.total_seconds()
