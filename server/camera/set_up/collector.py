"""Gathers pictures of chosen cameras, in which the fixed tags were sought everywhere."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

from robot_link.camera.sighting import Sighting
from server.base.job import JobError, JobProgress
from server.camera.event import PictureSeen

PATIENCE_S: Final = 45.0
"""So long somebody waits while no camera brings the whole any further."""
SeekEverywhere = Callable[[str, bool], None]


@dataclass(slots=True, eq=False)
class _Gathering:
    """Pictures that somebody waits for."""

    count: int
    seen: dict[str, list[Sighting]]
    is_told: Callable[[Sighting], bool]
    came: asyncio.Event = field(default_factory=asyncio.Event)

    def take(self, sighting: Sighting) -> None:
        """Take a picture if it is one of those."""
        mine = self.seen.get(sighting.camera)
        if mine is not None and len(mine) < self.count and self.is_told(sighting):
            mine.append(sighting)
            self.came.set()

    @property
    def share(self) -> float:
        """How many of them are there, 0 .. 1."""
        return min(len(mine) for mine in self.seen.values()) / self.count


class Collector:
    """Belongs to one event loop."""

    def __init__(self, seek_everywhere: SeekEverywhere) -> None:
        self._seek_everywhere = seek_everywhere
        self._gatherings: list[_Gathering] = []

    def take(self, seen: PictureSeen) -> None:
        """Take what a camera saw."""
        for one in self._gatherings:
            one.take(seen.sighting)

    async def collect(
        self,
        cameras: Sequence[str],
        count: int,
        progress: JobProgress,
        is_told: Callable[[Sighting], bool] = lambda sighting: sighting.sought == "whole",
        patience_s: float = PATIENCE_S,
    ) -> tuple[Sighting, ...]:
        """Return so many pictures of each camera.

        Raises:
            JobError: If a camera does not send them in time; it is named.
        """
        gathering = _Gathering(count, {camera: [] for camera in cameras}, is_told)
        self._gatherings.append(gathering)
        for camera in cameras:
            self._seek_everywhere(camera, True)
        try:
            async with asyncio.timeout(patience_s) as patience:
                share = 0.0
                while gathering.share < 1.0:
                    gathering.came.clear()
                    await gathering.came.wait()
                    if gathering.share > share:
                        share = gathering.share
                        patience.reschedule(asyncio.get_running_loop().time() + patience_s)
                    progress.report(0.8 * gathering.share, "Gathers pictures.")
        except TimeoutError:
            fewest = min(cameras, key=lambda camera: len(gathering.seen[camera]))
            had = len(gathering.seen[fewest])
            raise JobError(
                f"{fewest} sent {had} of {count} pictures that can be used, and none for "
                f"{patience_s:.0f} s."
            ) from None
        finally:
            self._gatherings.remove(gathering)
            for camera in cameras:
                self._seek_everywhere(camera, False)
        return tuple(one for mine in gathering.seen.values() for one in mine)
