"""Brings what cameras see together and has robots found in it.

A process of its own finds them (``fusion_task``), one moment after another. What comes meanwhile
waits; pictures that are older than a second by then are dropped.
"""

import asyncio
import logging
import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final

from autonomy.site import Site
from autonomy.vision.constants import TELEMETRY_S
from autonomy.vision.tag import LATENCY_IDS, Layout
from robot_link.camera.config import CameraConfig
from robot_link.camera.fix import CameraFix
from robot_link.clock import set_or_after
from robot_link.messages import RobotId
from robot_link.station.gateway.address import camera_tags, is_cameras
from server.base.foundation import Foundation
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.camera.event import PictureSeen
from server.camera.rig import CameraRig
from server.fix.event import FixFound
from server.fix.fusion_call import Box, FusionAnswer, FusionCall, Pictured, Words
from server.fix.gathering import OLDEST, Gathering, Pace, Picture
from server.fix.sight import CameraSight
from server.fleet.disabled_links import DisabledLinks
from server.fleet.fleet import Fleet
from server.fleet.status import RobotStatus

log = logging.getLogger(__name__)
TASK: Final = "server.fix.fusion_task:fuse"
STORED_PERIOD: Final = timedelta(seconds=0.2)
"""Fixes of a robot are told, kept and sent at most so often."""
_TOLD_PERIOD_S: Final = 1.0
"""So often the age of what cameras know is told."""
_RIM_M: Final = 1.0
"""Fixed tags lie at most so far outside of the water."""
_FAULT, _TOO_MANY = "fusion", "fusion:robots"


@dataclass(frozen=True, slots=True)
class Stranger:
    """A tag that nobody knows."""

    tag: int
    camera: str
    seen_at: datetime


class Fusion:
    """Finds robots in pictures. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        disabled: DisabledLinks,
        rig: CameraRig,
        config: Callable[[], CameraConfig],
    ) -> None:
        self._bus, self._clock, self._alarms = foundation.bus, foundation.clock, foundation.alarms
        self._background = foundation.background
        self._fleet, self._disabled, self._rig, self._config = fleet, disabled, rig, config
        self._pool = WorkerPool(1)
        self._gathering = Gathering(timedelta(seconds=config().together_s))
        self._news = asyncio.Event()
        self._packed: bytes = b""
        self._tracks = b""
        self._sights: dict[RobotId, CameraSight] = {}
        self._paces: dict[RobotId, Pace] = {}
        self._left_out: tuple[RobotId, ...] = ()
        self._is_faulty = False
        self.strangers: dict[int, Stranger] = {}
        """Tags that nobody knows, since the station began."""

    def take(self, seen: PictureSeen) -> None:
        """Take what a camera saw."""
        self._gathering.together = timedelta(seconds=self._config().together_s)
        self._gathering.add(Picture(seen.taken_at, self._clock.now(), seen.sighting))
        self._news.set()

    def rig_changed(self) -> None:
        """Find robots by other cameras, or by cameras that are known otherwise."""
        self._packed = b""

    def sight(self, robot: str) -> CameraSight | None:
        """Return what cameras know of a robot, None where it has no link by cameras."""
        return self._sights.get(RobotId(robot))

    def newest(self, robot: str) -> CameraFix | None:
        """Return the newest fix of a robot that was not refused; may be asked by any thread."""
        sight = self._sights.get(RobotId(robot))
        return None if sight is None else sight.newest

    def uri(self, robot: str) -> str | None:
        """Return the link by which cameras see a robot, None where it has none or is unplugged."""
        links = self._fleet.status(robot).record.links
        uri = next((uri for uri in links if is_cameras(uri)), None)
        return uri if uri is not None and self._disabled.is_enabled(uri) else None

    async def run(self) -> None:
        """Find robots until cancelled.

        What stood when the station last ran is told again where it still is so.
        """
        for cause in (_FAULT, _TOO_MANY):
            await self._alarms.clear(cause)
        while True:
            due_at = self._gathering.due_at()
            await set_or_after(self._news, self._wait_s(due_at))
            self._news.clear()
            while moment := self._gathering.complete(self._clock.now()):
                await self._fuse(moment)

    async def tell(self) -> None:
        """Tell of each robot how old what cameras know of it is, until cancelled."""
        while True:
            self._know_links()
            for robot in self._sights:
                self._report(robot)
            if self._rig.rig is None or all(self.uri(robot) is None for robot in self._sights):
                self._set_fault("")  # nobody is sought: nothing is wrong with that any more
                self._set_left_out(())
            await asyncio.sleep(_TOLD_PERIOD_S)

    async def stop(self) -> None:
        """End the process that finds robots."""
        await self._pool.stop()

    def _wait_s(self, due_at: datetime | None) -> float | None:
        if due_at is None:
            return None
        return max((due_at - self._clock.now()).total_seconds() / self._clock.speed, 0.0)

    async def _fuse(self, moment: list[Picture]) -> None:
        now = self._clock.now()
        moment = [one for one in moment if now - one.taken_at <= OLDEST]
        self._note_strangers(moment)
        call = self._call(moment)
        if call is None:
            return
        try:
            answer: FusionAnswer = await self._pool.run(TASK, call)
        except WORKER_FAILURES as error:
            log.warning("robots were not sought in the pictures of %s: %s", now, error)
            self._set_fault(str(error))
            self._tracks = b""  # one of them may be what it failed of
            return
        self._set_fault("")
        self._take(answer, call)

    def _call(self, moment: list[Picture]) -> FusionCall | None:
        """Return what is to be found, None where nothing can be."""
        self._know_links()
        rig, registry = self._rig.rig, self._rig.registry
        robots: dict[str, RobotId] = {}
        for robot, sight in self._sights.items():
            tags, is_plugged = camera_tags(sight.uri), self.uri(robot) is not None
            sight.obstacle = "" if rig is not None else "no camera is calibrated"
            if rig is not None and is_plugged:
                sight.obstacle = self._obstacle(robot, tags)
            if rig is not None and is_plugged and not sight.obstacle:
                robots[tags] = robot
        if rig is not None and not robots:
            for camera in rig.cameras:
                self._rig.set_regions(camera, ())
        if rig is None or not robots or not moment:
            return None
        self._packed = self._packed or pickle.dumps(rig, pickle.HIGHEST_PROTOCOL)
        statuses = {tags: self._fleet.status(robot) for tags, robot in robots.items()}
        newest = max(one.taken_at for one in moment)
        return FusionCall(
            pictures=tuple(
                Pictured(one.sighting.camera, one.taken_at.timestamp(), tuple(one.sighting.tags))
                for one in moment
            ),
            rig=self._packed,
            calibration=self._rig.calibration,
            registry=registry,
            robots=robots,
            waters={tags: _box(status) for tags, status in statuses.items()},
            said=_said(statuses, newest),
            tracks=self._tracks,
            config=self._config(),
        )

    def _obstacle(self, robot: RobotId, tags: str) -> str:
        """Return why a robot cannot be sought by a set of tags, empty where it can."""
        registry = self._rig.registry
        if all(bundle.robot != tags for bundle in registry.bundles):
            return f"no tags are registered for {tags}"
        return other_water(self._fleet.status(robot).record.site, registry.layout)

    def _take(self, answer: FusionAnswer, call: FusionCall) -> None:
        self._tracks = answer.tracks
        for camera, places in answer.regions.items():
            self._rig.set_regions(camera, places)
        for tags, standing in answer.standings.items():
            if sight := self._sights.get(call.robots[tags]):
                sight.standing = standing
        for found in answer.found:
            robot = call.robots[found.tags]
            if sight := self._sights.get(robot):
                sight.take(found.fix, found.reason)
                self._publish(found.fix)
                self._report(robot)
        self._set_left_out(tuple(call.robots[tags] for tags in answer.left_out))

    def _publish(self, fix: CameraFix | None) -> None:
        if fix is None or self.uri(fix.robot) is None:
            return
        pace = self._paces.setdefault(fix.robot, Pace(STORED_PERIOD))
        if pace.lets(fix.measured_at):
            self._bus.publish(FixFound(fix))

    def _report(self, robot: RobotId) -> None:
        status, report = self._fleet.status(robot), self._sights[robot].report(self._clock.now())
        if status.links.get(report.uri) != report:
            self._fleet.take_link(report)

    def _know_links(self) -> None:
        """Take up the robots that have a link by cameras, and forget those that have none more."""
        links = {
            status.record.id: uri
            for status in self._fleet.statuses
            for uri in status.record.links
            if is_cameras(uri)
        }
        for robot, uri in links.items():
            if robot not in self._sights or self._sights[robot].uri != uri:
                self._sights[robot] = CameraSight(robot, uri)
        for robot in self._sights.keys() - links.keys():
            del self._sights[robot]

    def _note_strangers(self, moment: list[Picture]) -> None:
        registry = self._rig.registry
        for picture in moment:
            for tag in picture.sighting.tags:
                if tag.id not in LATENCY_IDS and registry.is_stranger(tag.id):
                    camera = picture.sighting.camera
                    self.strangers[tag.id] = Stranger(tag.id, camera, picture.taken_at)
        for tag_id in [one for one in self.strangers if not registry.is_stranger(one)]:
            del self.strangers[tag_id]

    def _set_fault(self, fault: str) -> None:
        if bool(fault) == self._is_faulty:
            return
        self._is_faulty = bool(fault)
        text = f"Robots are not found in the pictures of cameras: {fault}"
        change: Any = self._alarms.raise_(_FAULT, text) if fault else self._alarms.clear(_FAULT)
        self._background.start("fusion's alarm", change)

    def _set_left_out(self, left_out: tuple[RobotId, ...]) -> None:
        if left_out != self._left_out:
            self._left_out = left_out
            self._background.start("robots that are not followed", self._tell_left_out())

    async def _tell_left_out(self) -> None:
        if not self._left_out:
            await self._alarms.clear(_TOO_MANY)
            return
        names = ", ".join(self._left_out)
        text = f"More robots are in view than can be followed; these are not: {names}."
        await self._alarms.raise_(_TOO_MANY, text, level="watch")


def other_water(site: Site, layout: Layout) -> str:
    """Return why a robot of this site is not in the water under the cameras, empty where it is."""
    if site.kind != "tank":
        return f"cameras hang over a tank, and its water is {site.name}"
    water = site.water
    for tag in layout.tags:
        north, east, _ = tag.position_m
        is_north = water.x_min_m - _RIM_M <= north <= water.x_max_m + _RIM_M
        if not (is_north and water.y_min_m - _RIM_M <= east <= water.y_max_m + _RIM_M):
            return f"the fixed tag {tag.id} lies outside of its water, {site.name}"
    return ""


def _box(status: RobotStatus) -> Box:
    water = status.record.site.water
    return (water.x_min_m, water.x_max_m), (water.y_min_m, water.y_max_m), water.depth_max_m


def _said(statuses: Mapping[str, RobotStatus], at: datetime) -> dict[str, Words]:
    """Return what robots said of tilt and depth close enough to a moment."""
    said: dict[str, Words] = {}
    for tags, status in statuses.items():
        state = status.state
        if state is None:
            continue
        age_s = (at - status.at_station(state.measured_at)).total_seconds()
        if 0.0 <= age_s <= TELEMETRY_S:
            said[tags] = age_s, state.roll_rad, state.pitch_rad, state.position_ned[2]
    return said
