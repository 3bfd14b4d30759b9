"""Which pictures of several cameras belong together; pure, times are of the station's clock."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Final

from robot_link.camera.sighting import Sighting
from server.camera.moment import OLDEST_S

HOLD: Final = timedelta(milliseconds=250)
"""So long a moment waits for cameras whose pictures come later."""
OLDEST: Final = timedelta(seconds=OLDEST_S)
"""Older pictures tell nobody where a robot is."""
LATELY: Final = timedelta(seconds=2)
"""A camera that brought nothing for so long is not waited for."""


@dataclass(frozen=True, slots=True)
class Picture:
    """What one camera saw."""

    taken_at: datetime
    arrived_at: datetime
    sighting: Sighting


@dataclass(slots=True)
class Gathering:
    """Brings pictures of one moment together.

    A moment is complete once each camera has shown that it has nothing more of it, by a picture
    of it or a later one, or after ``HOLD``.
    """

    together: timedelta
    """Pictures that were taken within this time are of one moment."""
    dropped: int = 0
    """Pictures that came too late, whose times went back, or that the same camera's next one of the
    same moment replaced."""
    _waiting: list[Picture] = field(default_factory=list[Picture])
    """In order of time."""
    _newest: dict[str, Picture] = field(default_factory=dict[str, Picture])

    def add(self, picture: Picture) -> None:
        """Take a picture."""
        camera = picture.sighting.camera
        before = self._newest.get(camera)
        is_back = before is not None and picture.taken_at <= before.taken_at
        if is_back or picture.arrived_at - picture.taken_at > OLDEST:
            self.dropped += 1
            return
        self._newest[camera] = picture
        self._waiting.append(picture)
        self._waiting.sort(key=lambda one: one.taken_at)

    def complete(self, now: datetime) -> list[Picture] | None:
        """Return the oldest moment if nothing more is to come of it, else None.

        It has one picture of each camera, the newest.
        """
        if not self._waiting:
            return None
        first = self._waiting[0].taken_at
        moment = [one for one in self._waiting if one.taken_at - first <= self.together]
        cameras = {one.sighting.camera for one in moment}
        waits = any(
            camera not in cameras and newest.taken_at - first <= self.together
            for camera, newest in self._newest.items()
            if now - newest.arrived_at <= LATELY
        )
        if waits and now < self._due(moment):
            return None
        self._waiting = [one for one in self._waiting if one not in moment]
        newest = {one.sighting.camera: one for one in moment}
        self.dropped += len(moment) - len(newest)
        return list(newest.values())

    def due_at(self) -> datetime | None:
        """Return when the oldest moment is complete whatever comes, None where none waits."""
        if not self._waiting:
            return None
        first = self._waiting[0].taken_at
        return self._due(one for one in self._waiting if one.taken_at - first <= self.together)

    def _due(self, moment: Iterable[Picture]) -> datetime:
        return min(one.arrived_at for one in moment) + HOLD


@dataclass(slots=True)
class Pace:
    """Lets through at most so many a second of what comes about evenly."""

    period: timedelta
    _due: datetime | None = None

    def lets(self, moment: datetime) -> bool:
        """Tell whether one of this moment is let through; counted if it is."""
        if self._due is None:
            self._due = moment
        if moment < self._due - self.period / 2:
            return False
        self._due = max(self._due, moment) + self.period
        return True
