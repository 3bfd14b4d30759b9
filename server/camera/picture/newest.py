"""The newest picture of each camera, which is asked for only while somebody looks.

It is in memory alone: nothing here writes one down (``keeping.py`` does, when a pilot says so).
"""

import asyncio
from collections import defaultdict
from collections.abc import Callable
from typing import Final

from robot_link.camera.sighting import Sighting
from robot_link.clock import monotonic_s
from server.base.problem import Problem
from server.camera.status import CameraStatuses

LOOKS_S: Final = 5.0
"""Who asked for a picture counts as looking for so long."""
PATIENCE_S: Final = 3.0
_FRESH_S: Final = 0.6
Want = Callable[[str, bool], None]
Listener = Callable[[str, bytes], None]


class Picture:
    """One picture and what was seen in it."""

    def __init__(self, jpeg: bytes, sighting: Sighting | None) -> None:
        self.jpeg = jpeg
        self.sighting = sighting
        self.came_s = monotonic_s()


class Pictures:
    """Belongs to one event loop."""

    def __init__(self, statuses: CameraStatuses) -> None:
        self._statuses = statuses
        self._newest: dict[str, Picture] = {}
        self._came: defaultdict[str, asyncio.Event] = defaultdict(asyncio.Event)
        self._looks: dict[str, asyncio.TimerHandle] = {}
        self._kept_for: dict[str, Listener] = {}
        self._want: Want | None = None

    def on_want(self, want: Want) -> None:
        """Have the processes told whether somebody looks."""
        self._want = want

    def is_wanted(self, camera: str) -> bool:
        """Tell whether pictures of a camera are asked for."""
        return camera in self._looks or camera in self._kept_for

    def hear(self, camera: str, jpeg: bytes) -> None:
        """Take a picture; one that nobody wants is dropped."""
        if not self.is_wanted(camera):
            return
        self._newest[camera] = Picture(jpeg, self._statuses.of(camera).sighting)
        self._came.pop(camera, asyncio.Event()).set()
        if camera in self._kept_for:
            self._kept_for[camera](camera, jpeg)

    def listen(self, camera: str, listener: Listener | None) -> None:
        """Have each picture of a camera handed to somebody, or to nobody any more."""
        if listener is None:
            self._kept_for.pop(camera, None)
        else:
            self._kept_for[camera] = listener
        self._tell(camera)

    async def newest(self, camera: str) -> Picture:
        """Return a picture of now.

        Raises:
            Problem: 503 if none comes in a few seconds.
        """
        if camera in self._looks:
            self._looks[camera].cancel()
        loop = asyncio.get_running_loop()
        self._looks[camera] = loop.call_later(LOOKS_S, self._nobody_looks, camera)
        self._tell(camera)
        known = self._newest.get(camera)
        if known is not None and monotonic_s() - known.came_s < _FRESH_S:
            return known
        try:
            async with asyncio.timeout(PATIENCE_S):
                await self._came[camera].wait()
        except TimeoutError:
            words = self._statuses.of(camera).words
            raise Problem(503, words or f"{camera} sends no pictures.") from None
        return self._newest[camera]

    def drop(self, camera: str) -> None:
        """Forget a camera that is gone."""
        self._newest.pop(camera, None)
        self._kept_for.pop(camera, None)
        if camera in self._looks:
            self._looks.pop(camera).cancel()

    def stop(self) -> None:
        """Wait for nobody any more."""
        for camera in list(self._looks):
            self.drop(camera)

    def _nobody_looks(self, camera: str) -> None:
        del self._looks[camera]
        if not self.is_wanted(camera):
            self._newest.pop(camera, None)
        self._tell(camera)

    def _tell(self, camera: str) -> None:
        if self._want is not None:
            self._want(camera, self.is_wanted(camera))
