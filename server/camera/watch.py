"""Watches whether cameras still are where the calibration left them, and where the water stands.

Once a second a worker holds what was seen of the fixed tags against the calibration
(``watch_task``); what that means is decided here, and told in words.
"""

import asyncio
import logging
import math
from collections import Counter, deque
from collections.abc import Callable, Coroutine, Mapping
from datetime import datetime, timedelta
from typing import Any, Final

import msgspec
from sqlalchemy.orm import Session

from autonomy.vision.constants import GREATEST_CHANGE_M, GREATEST_SPREAD_M
from autonomy.vision.tag import TANK_IDS
from db.fault import StoreUnavailableError
from db.query.station.events import add_event
from robot_link.camera.config import CameraConfig
from robot_link.camera.sighting import Sighting
from server.base.foundation import Foundation
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.camera.event import PictureSeen, RigChanged
from server.camera.rig import CameraRig
from server.camera.status import CameraStatuses, Stand
from server.camera.task import WATCH, LevelFound, StandFound, Watched, WatchProblem

log = logging.getLogger(__name__)
PERIOD_S: Final = 1.0
NEWEST, LONGER = timedelta(seconds=3.0), timedelta(seconds=10.0)
"""Over so long cameras are judged, and the water."""
FEWEST_TAGS: Final = 3
TOLD_AFTER: Final = 10
"""A tag that is there twice in so many pictures in a row is told."""
_APPLIED_M: Final = 0.0003
_PLATE_CHECKS: Final = 3
_ROUGH_RAD: Final = math.radians(1.0)
_LEVEL, _ROUGH = "camera-level", "camera-ripples"
_CAUSES = ("camera-moved:", "camera-plate:", "camera-twice:", _LEVEL, _ROUGH)


class CameraWatch:
    """Belongs to one event loop; ``run`` is its task."""

    def __init__(
        self,
        foundation: Foundation,
        rig: CameraRig,
        statuses: CameraStatuses,
        config: Callable[[], CameraConfig],
    ) -> None:
        self._foundation = foundation
        self._rig, self._statuses, self._config = rig, statuses, config
        self._pool = WorkerPool(1, niceness=5)
        self._seen: deque[tuple[datetime, Sighting]] = deque()
        self._news = asyncio.Event()
        self._calibration: int | None = None
        self._twice: Counter[tuple[str, int]] = Counter()
        self._off_plates: Counter[int] = Counter()
        self._told_level_m = 0.0
        self.level_words = ""
        """What is known of the water's level, in words."""
        self.ripple_deg = 0.0
        """Root mean square slope of the surface."""

    def take(self, seen: PictureSeen) -> None:
        """Take what a camera saw."""
        self._count_twice(seen.sighting)
        used = self._rig.calibrated
        if used is None or seen.camera not in used.cameras or seen.sighting.sought != "whole":
            return
        fixed = [tag for tag in seen.sighting.tags if tag.id in TANK_IDS]
        self._seen.append((seen.taken_at, msgspec.structs.replace(seen.sighting, tags=fixed)))
        while self._seen and seen.taken_at - self._seen[0][0] > LONGER:
            self._seen.popleft()
        self._news.set()

    def rig_changed(self, changed: RigChanged) -> None:
        """Begin anew where another calibration is in use."""
        del changed
        if self._rig.calibration != self._calibration:
            self._calibration = self._rig.calibration
            self._seen.clear()
            self._off_plates.clear()
            self._told_level_m = 0.0
            self.level_words = ""
            for camera in () if self._rig.calibrated is None else self._rig.calibrated.cameras:
                is_out = camera in self._rig.left_out
                self._statuses.of(camera).stand = _out_since_before(camera) if is_out else Stand()
            self._clear_all()

    async def run(self) -> None:
        """Judge once a second while cameras see something, until cancelled.

        What stood when the station last ran is told again where it still is so.
        """
        self._clear_all()
        while True:
            self._news.clear()
            await self._news.wait()
            await self._look()
            await asyncio.sleep(PERIOD_S)

    def drop(self, camera: str) -> None:
        """Forget a camera that is gone."""
        self._clear(f"camera-moved:{camera}")
        self._clear_all(f"camera-twice:{camera}:")

    async def stop(self) -> None:
        """End the process that works it out."""
        await self._pool.stop()

    async def _look(self) -> None:
        used = self._rig.calibrated
        if used is None or not self._seen:
            return
        last = self._seen[-1][0]
        newest = tuple(one for at, one in self._seen if last - at <= NEWEST)
        longer = tuple(one for _, one in self._seen)
        problem = WatchProblem(used, self._rig.layout, newest, longer, self._rig.left_out)
        try:
            watched: Watched = await self._pool.run(WATCH, problem)
        except WORKER_FAILURES as error:
            log.warning("the cameras could not be watched: %s", error)
            return
        if self._rig.calibration != used.calibration:
            return
        self._judge_cameras(watched.stands)
        self._judge_plates(watched.stands)
        await self._judge_water(watched)
        self._statuses.tell()

    def _judge_cameras(self, stands: Mapping[str, StandFound]) -> None:
        config, left_out = self._config(), set(self._rig.left_out)
        for camera, found in stands.items():
            stand = _stand(camera, found, config)
            if stand.stand == "left_out":
                left_out.add(camera)
            self._statuses.of(camera).stand = stand
            cause = f"camera-moved:{camera}"
            if camera in left_out:
                text = stand.sentence or f"{camera} was moved"
                if stand.stand != "left_out":
                    text += "; it is left out until it is adjusted again"
                self._raise(cause, f"{text}.", "warning", "Adjust this camera again.")
            elif stand.stand == "moved":
                self._raise(cause, f"{stand.sentence}.", "watch", "Adjust this camera again.")
            elif stand.stand == "holds":
                self._clear(cause)
        self._rig.leave_out(left_out)

    def _judge_plates(self, stands: Mapping[str, StandFound]) -> None:
        """Tell of plates that every camera sees elsewhere, though it holds itself."""
        limit_px = self._config().left_out_px
        seen: dict[int, list[tuple[str, float]]] = {}
        for camera, found in stands.items():
            if found.tags >= FEWEST_TAGS and self._statuses.of(camera).stand.stand == "holds":
                for tag, off in found.off_px.items():
                    seen.setdefault(tag, []).append((camera, math.hypot(*off)))
        for tag, views in seen.items():
            is_off = all(px > limit_px for _, px in views)
            self._off_plates[tag] = self._off_plates[tag] + 1 if is_off else 0
            cause = f"camera-plate:{tag}"
            if self._off_plates[tag] >= _PLATE_CHECKS:
                px, names = max(px for _, px in views), ", ".join(name for name, _ in views)
                text = (
                    f"Tag {tag} is {px:.0f} px from where it was surveyed, as {names} see it: "
                    "was its plate moved or swapped?"
                )
                self._raise(cause, text, "watch", "Survey it again, then adjust the cameras.")
            elif not is_off:
                self._clear(cause)

    async def _judge_water(self, watched: Watched) -> None:
        used = self._rig.calibrated
        if used is None:
            return
        slope = watched.ripple_slope_rad
        slope = used.ripple_slope_rad if slope is None else slope
        self.ripple_deg = math.degrees(slope)
        if slope > _ROUGH_RAD:
            text = f"The water is too rough for cameras: ripples of {self.ripple_deg:.1f} deg."
            self._raise(_ROUGH, text, "watch", "Wait until it is calm.")
        else:
            self._clear(_ROUGH)
        level = watched.level
        fault = "" if level is None else _level_fault(level)
        if fault:
            self.level_words = fault
            self._raise(_LEVEL, f"{fault}.", "warning", "Read the level, and adjust the cameras.")
        elif level is not None:
            self._clear(_LEVEL)
            self.level_words = _level_words(level)
            await self._tell_level(level)
        else:
            self.level_words = "No fixed tag under water is seen: nobody knows the level."
        applied = level if level is not None and not fault else None
        level_m = used.level_m if applied is None else applied.level_m
        std_m = used.level_std_m if applied is None else applied.std_m
        is_other = abs(level_m - used.level_m) > _APPLIED_M
        if is_other or abs(slope - used.ripple_slope_rad) > 0.1 * slope + 1e-4:
            self._rig.put_water(level_m, std_m, slope)

    async def _tell_level(self, level: LevelFound) -> None:
        """Keep in the log that the level is another one, each time it changed by enough."""
        if abs(level.change_m - self._told_level_m) < self._config().level_told_m:
            return
        at, text = self._foundation.clock.now(), f"{_level_words(level)}; this is counted."

        def write(session: Session) -> None:
            add_event(session, at, "camera.level", text, data={"change_m": level.change_m})

        try:
            await self._foundation.store.write(write)
        except StoreUnavailableError as error:
            log.warning("a change of the water's level is not in the log yet: %s", error)
        else:
            self._told_level_m = level.change_m

    def _count_twice(self, sighting: Sighting) -> None:
        """Tell of tags that are there twice in picture after picture."""
        twice = set(sighting.twice)
        known = {tag for camera, tag in self._twice if camera == sighting.camera}
        for tag in known | twice:
            key, cause = (sighting.camera, tag), f"camera-twice:{sighting.camera}:{tag}"
            if tag not in twice:
                del self._twice[key]
                self._clear(cause)
                continue
            self._twice[key] += 1
            if self._twice[key] == TOLD_AFTER:
                text = (
                    f"{sighting.camera} sees tag {tag} twice: was it printed twice, or is it "
                    "mirrored in a wall or in the surface? Neither is used."
                )
                self._raise(cause, text, "watch", "Take one of them away.")

    def _raise(self, cause: str, text: str, level: str, action: str) -> None:
        standing = self._foundation.alarms.standing(cause, None)
        if standing is None or (standing.text, standing.level) != (text, level):
            alarms = self._foundation.alarms
            self._alarm(alarms.raise_(cause, text, level=level, action=action))

    def _clear(self, cause: str) -> None:
        if self._foundation.alarms.standing(cause, None) is not None:
            self._alarm(self._foundation.alarms.clear(cause))

    def _clear_all(self, begin: str = "") -> None:
        """Clear every alarm of this watch whose cause begins so, but those of cameras left out."""
        stay = {f"camera-moved:{camera}" for camera in self._rig.left_out}
        for alarm in self._foundation.alarms.open:
            is_ours = alarm.cause.startswith(_CAUSES) and alarm.cause not in stay
            if is_ours and alarm.cause.startswith(begin):
                self._clear(alarm.cause)

    def _alarm(self, work: Coroutine[Any, Any, object]) -> None:
        self._foundation.background.start("alarm about cameras", work)


def _out_since_before(camera: str) -> Stand:
    text = f"{camera} was moved before the station began; it is left out until it is adjusted again"
    return Stand("left_out", 0.0, text)


def _stand(camera: str, found: StandFound, config: CameraConfig) -> Stand:
    if found.tags < FEWEST_TAGS:
        text = f"{camera} sees {found.tags} fixed tags: nobody knows whether it has moved"
        return Stand("unknown", 0.0, text, found.off_px)
    if found.shift_px <= config.moved_px:
        return Stand("holds", found.shift_px, "", found.off_px)
    text = (
        f"{camera} has moved, by about {found.turned_deg:.1f} deg or {1e3 * found.moved_m:.0f} mm"
    )
    if found.shift_px <= config.left_out_px:
        return Stand("moved", found.shift_px, text, found.off_px)
    text += "; it is left out until it is adjusted again"
    return Stand("left_out", found.shift_px, text, found.off_px)


def _level_fault(level: LevelFound) -> str:
    """Return why a level is not applied by itself, empty where it is."""
    if level.spread_m > GREATEST_SPREAD_M:
        return f"Cameras disagree on the water's level by {1e3 * level.spread_m:.0f} mm"
    if abs(level.change_m) > GREATEST_CHANGE_M:
        return f"{_level_words(level)}, more than is counted without being asked"
    return ""


def _level_words(level: LevelFound) -> str:
    word = "fell" if level.change_m > 0.0 else "rose"
    return f"The water {word} by {1e3 * abs(level.change_m):.0f} mm since the cameras were adjusted"
