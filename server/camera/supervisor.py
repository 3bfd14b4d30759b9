"""Keeps the process of one camera running: starts it anew when it ends, is silent or confused.

======================================  ======================  =============================
what happens                            state                   what follows
======================================  ======================  =============================
its clock runs above 4 times the wall   too_fast                nothing until it is changed
the extra is not installed              not_installed           nothing until a restart
started                                 starting                waits for its first word
it reports                              as it says              waits for its next picture
no picture for ``silent_s``             silent                  ended, started again later
the same picture for ``silent_s``       silent                  ended, started again later
it ends, or speaks nonsense             silent                  ended, started again later
======================================  ======================  =============================

*Later* is after 1, 2, 4 .. 60 s; after a picture it is 1 s again.
"""

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Final, Protocol

from robot_link.camera.config import CameraConfig
from robot_link.camera.extra import CameraExtraMissingError, check_extra
from robot_link.camera.sighting import BoardView, Order, Region, Sighting, SourceReport
from robot_link.camera.sighting import SourceSettings as Settings
from robot_link.camera.wire import CameraWireError, FromCamera
from robot_link.clock import Clock, monotonic_s
from server.base.alarm_board import AlarmBoard
from server.base.lifetime import Background
from server.camera import child
from server.camera.child import CameraChild
from server.camera.moment import TOLD_AFTER, PictureMoments
from server.camera.status import CameraStatus
from server.camera.view import CameraState

SPEED_MAX: Final = 4.0
"""A clock that runs faster multiplies every delay of the pictures too much."""
PAUSE_MAX_S: Final = 60.0
START_S: Final = 30.0
"""A process that loads its libraries says its first word within this time."""
NONSENSE: Final = "nonsense"
_REPORT_TELLS_S: Final = 1.0


class _StandsStillError(Exception):
    """The same picture comes again and again: no two of a camera are alike to the last digit."""


class Hears(Protocol):
    """Where what a camera says goes."""

    def sighting(self, camera: str, sighting: Sighting, taken_at: datetime) -> None:
        """Take what was seen in a picture whose time is believed."""
        ...

    def board(self, camera: str, view: BoardView) -> None:
        """Take what was seen of the calibration board."""
        ...

    def preview(self, camera: str, jpeg: bytes) -> None:
        """Take a picture."""
        ...


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What every supervisor of a station shares."""

    clock: Clock
    alarms: AlarmBoard
    background: Background
    config: Callable[[], CameraConfig]
    hears: Hears
    changed: Callable[[], None]
    """Says that somebody who looks would want to know."""


class Supervisor:
    """One camera. Belongs to one event loop; ``run`` and ``watch_silence`` are its tasks."""

    def __init__(self, settings: Settings, status: CameraStatus, around: Surroundings) -> None:
        self.settings = settings
        self.status = status
        self._around = around
        self._moments = PictureMoments(around.clock)
        self._order = Order()
        self._child: CameraChild | None = None
        self._picture_s = monotonic_s()
        self._picture_came = asyncio.Event()
        self._pictures = 0
        self._alike_since_s: float | None = None
        self._pause_s = 1.0
        self._told_s = 0.0
        self._times_doubted = False

    @property
    def process_id(self) -> int | None:
        """Of the process that runs now; None where none does."""
        return None if self._child is None else self._child.process_id

    def set_regions(self, regions: Sequence[Region]) -> None:
        """Say where robots are expected."""
        self._say(Order(list(regions), self._order.wants_previews, self._order.board_views))

    def want_previews(self, wanted: bool) -> None:
        """Say whether somebody looks."""
        if wanted != self._order.wants_previews:
            self._say(Order(self._order.regions, wanted, self._order.board_views))

    def ask_board(self) -> None:
        """Have the next picture searched for the board; its answer comes as any other word."""
        views = self._order.board_views + 1
        self._say(Order(self._order.regions, self._order.wants_previews, views))

    async def run(self) -> None:
        """Keep a process running until cancelled."""
        if not self._may_start():
            self._around.changed()
            return
        while True:
            self._put("starting", "")
            words = await self._one_life()
            self.status.restarts += 1
            self._put("silent", f"{words} It is started again in {self._pause_s:.0f} s.")
            await asyncio.sleep(self._pause_s)
            self._pause_s = min(2.0 * self._pause_s, PAUSE_MAX_S)

    async def watch_silence(self) -> None:
        """Raise and clear the alarm about a camera that sends no pictures, until cancelled."""
        cause, alarms = f"camera-silent:{self.status.camera}", self._around.alarms
        if alarms.standing(cause, None) is not None:  # since before the station began
            await self._picture_came.wait()
            await alarms.clear(cause)
        while True:
            left_s = self._picture_s + self._around.config().silent_alarm_s - monotonic_s()
            if left_s > 0.0:
                await asyncio.sleep(left_s)
                continue
            why = f": {self.status.words}" if self.status.words else "."
            text = f"{self.status.camera} sends no pictures{why}"
            await alarms.raise_(cause, text, action="Look at its cable, its power and its address.")
            self._picture_came.clear()
            await self._picture_came.wait()
            await alarms.clear(cause, text=f"{self.status.camera} sends pictures again.")

    async def clear_alarms(self) -> None:
        """Say that nothing of this camera is wrong any more: it is gone."""
        for kind in ("silent", "times"):
            await self._around.alarms.clear(f"camera-{kind}:{self.status.camera}")

    def _may_start(self) -> bool:
        speed = self._around.clock.speed
        if speed > SPEED_MAX:
            self.status.state = "too_fast"
            self.status.words = (
                f"The station's clock runs {speed:g} times as fast as the wall; cameras are used "
                f"up to {SPEED_MAX:g} times."
            )
            return False
        try:
            check_extra()
        except CameraExtraMissingError as error:
            self.status.state, self.status.words = "not_installed", f"{error}."
            return False
        return True

    async def _one_life(self) -> str:
        """Run one process to its end; return how that came, in words."""
        self._pictures, self._alike_since_s = 0, None
        try:
            running = await CameraChild.start(child.COMMAND, self.settings)
        except OSError as error:
            return f"Its process could not be started: {error.strerror}."
        self._child = running
        self._order = Order(self._order.regions, self._order.wants_previews)
        running.tell(self._order)
        try:
            async with asyncio.timeout(START_S) as patience:
                heard = False
                async with contextlib.aclosing(running.messages()) as messages:
                    async for message in messages:
                        if self._take(message) or not heard:
                            heard = True
                            silent_s = self._around.config().silent_s
                            patience.reschedule(asyncio.get_running_loop().time() + silent_s)
        except TimeoutError:
            return self.status.words or "It sends no pictures."
        except _StandsStillError:
            return "Its picture stands still: the same one comes again and again."
        except CameraWireError:
            self.status.refused[NONSENSE] += 1
            return "Its process spoke nonsense."
        finally:
            self._child = None
            await running.end()
        return self.status.words or "Its process ended."

    def _take(self, message: FromCamera) -> bool:
        """Take what the process said; tell whether that is news of a picture."""
        match message:
            case Sighting():
                self._see(message)
                return True
            case SourceReport():
                is_new = message.pictures > self._pictures
                self._report(message)
                return is_new
            case BoardView():
                self._around.hears.board(self.status.camera, message)
            case bytes():
                self._around.hears.preview(self.status.camera, message)
        return False

    def _see(self, sighting: Sighting) -> None:
        self._compare(sighting)
        taken_at = self._moments.taken_at(sighting, datetime.now(UTC))
        if isinstance(taken_at, str):
            self.status.refused[taken_at] += 1
            if self._moments.doubted == TOLD_AFTER:
                self._doubt(taken_at)
            return
        if self._times_doubted:
            self._believe()
        self.status.sighting, self.status.seen_at = sighting, taken_at
        self._around.hears.sighting(self.status.camera, sighting, taken_at)
        self._tell_now_and_then()

    def _report(self, report: SourceReport) -> None:
        if report.pictures > self._pictures:
            self._pictures = report.pictures
            if self._alike_since_s is None:
                self._picture()
        self.status.report = report
        self._put(report.state, report.words)

    def _compare(self, sighting: Sighting) -> None:
        """Note whether a picture is another one than the one before.

        Raises:
            _StandsStillError: If it has not been for a while.
        """
        before, now_s = self.status.sighting, monotonic_s()
        if before is None or not sighting.tags or before.tags != sighting.tags:
            self._alike_since_s = None
            self._picture()
        elif self._alike_since_s is None:
            self._alike_since_s = now_s
        elif now_s - self._alike_since_s > self._around.config().silent_s:
            raise _StandsStillError

    def _picture(self) -> None:
        self._picture_s, self._pause_s = monotonic_s(), 1.0
        self._picture_came.set()

    def _doubt(self, why: str) -> None:
        self._times_doubted = True
        name = self.status.camera
        text = f"The times of {name}'s pictures cannot be believed: they {why}."
        self._later(self._around.alarms.raise_(f"camera-times:{name}", text, level="watch"))

    def _believe(self) -> None:
        self._times_doubted = False
        self._later(self._around.alarms.clear(f"camera-times:{self.status.camera}"))

    def _later(self, work: Coroutine[Any, Any, object]) -> None:
        self._around.background.start(f"alarm about {self.status.camera}", work)

    def _say(self, order: Order) -> None:
        self._order = order
        if self._child is not None:
            self._child.tell(order)

    def _put(self, state: CameraState, words: str) -> None:
        if (state, words) != (self.status.state, self.status.words):
            self.status.state, self.status.words = state, words
            self._around.changed()

    def _tell_now_and_then(self) -> None:
        now_s = monotonic_s()
        if now_s - self._told_s >= _REPORT_TELLS_S:
            self._told_s = now_s
            self._around.changed()
