"""Draws the 3D scenes of replays: one for each tab of a browser, moved where its cursor goes."""

import asyncio
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Final, TypeAlias

from autonomy.vehicle.hull import Hull
from robot_link.messages import RobotId
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, unprocessable
from server.fleet.fleet import Fleet
from server.scene.replay_source import (
    Clock,
    Moment,
    Recorded,
    ReplaySource,
    map_reader,
    moment_of,
    recorded_around,
)
from server.vehicle.vehicles import Vehicles
from webui.scene.server import RobotScene
from webui.scene.source import MapView

OPEN_MAX: Final = 8
"""Each scene has a socket and a thread, and holds maps."""
_MAPS_MAX: Final = 12
_EARLIEST: Final = datetime(2000, 1, 1, tzinfo=UTC)
_FULL = f"{OPEN_MAX} replays are looked at in 3D already; close one of them and try again."
Key: TypeAlias = tuple[RobotId, str]
"""A robot, and the tab that looks at it."""


@dataclass(slots=True)
class ReplayScene:
    """A robot in the replay of one tab."""

    source: ReplaySource
    scene: RobotScene
    maps: OrderedDict[int, MapView] = field(default_factory=OrderedDict[int, MapView])
    """Kept maps that were drawn last, by their keys."""

    def note_maps(self, maps: tuple[MapView, ...]) -> None:
        """Keep what was drawn, and forget what was drawn long ago."""
        for one in maps:
            self.maps[one.version] = one
            self.maps.move_to_end(one.version)
        while len(self.maps) > _MAPS_MAX:
            self.maps.popitem(last=False)


def moment_asked(at: datetime, now: datetime) -> datetime:
    """Return a moment that can be replayed, UTC.

    Raises:
        Problem: 422 for one that has not come yet, or is before any robot's.
    """
    if at > now:
        raise unprocessable("1 field is wrong.", [_wrong("it has not come yet")])
    if at < _EARLIEST:
        raise unprocessable("1 field is wrong.", [_wrong(f"it is before {_EARLIEST:%Y}")])
    return at.astimezone(UTC)


class ReplayScenes:
    """Moves the scene of each tab to the moment that the tab asks for. Belongs to one event loop.

    It keeps what is drawn and no cursor. Whoever looks moves their own camera, and nothing else: no
    order and no switch goes through it.
    """

    def __init__(self, foundation: Foundation, fleet: Fleet, vehicles: Vehicles) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._vehicles = vehicles
        self._open: OrderedDict[Key, ReplayScene] = OrderedDict()
        """Those asked for last stand last."""
        self._drawing = ThreadPoolExecutor(max_workers=1, thread_name_prefix="replay scene")
        self._moving = asyncio.Lock()

    def find(self, robot: RobotId, tab: str) -> RobotScene | None:
        """Return the scene of a tab, ``None`` before its first moment."""
        found = self._open.get((robot, tab))
        return None if found is None else found.scene

    async def move(self, robot: RobotId, tab: str, at: datetime, clock: Clock) -> Moment:
        """Draw a robot at a moment for a tab; return once it is on its way to the browser.

        Raises:
            UnknownIdError: If there is no such robot.
            Problem: 422 for a moment that has not come yet, 503 if too many are looked at.
        """
        if self._fleet.status(robot).record.kind == "recorded":
            clock = "measured"  # nobody heard a recording
        at = moment_asked(at, self._foundation.clock.now())
        channels = self._foundation.channels.catalogue
        async with self._moving:
            shown = await self._scene(robot, tab, at)
            recorded = shown.source.recorded
            moment = await self._foundation.store.query(
                lambda session: moment_of(
                    session,
                    recorded,
                    at,
                    clock,
                    map_reader(session, robot, channels, shown.maps),
                )
            )
            shown.note_maps(moment.maps)
            await asyncio.get_running_loop().run_in_executor(self._drawing, _draw, shown, moment)
        return moment

    async def stop(self) -> None:
        """Close every scene and its socket."""
        for one in self._open.values():
            await self._close(one)
        self._open.clear()
        self._drawing.shutdown()

    async def _scene(self, robot: RobotId, tab: str, at: datetime) -> ReplayScene:
        """Return the scene of a tab; another one where the moment is of another deployment."""
        key, now = (robot, tab), self._foundation.clock.now()
        found = self._open.get(key)
        if found is not None:
            if found.source.recorded.holds(at, now):
                self._open.move_to_end(key)
                return found
            await self._close(self._open.pop(key))
        await self._make_room()
        status = self._fleet.status(robot)
        recorded: Recorded = await self._foundation.store.query(
            lambda session: recorded_around(session, status.record, at, now)
        )
        vehicle = self._vehicles.find(status.record.model)
        hull = Hull() if vehicle is None else vehicle.hull
        source = ReplaySource(recorded, hull, status.track.thresholds_m)
        loop = asyncio.get_running_loop()
        scene = await loop.run_in_executor(self._drawing, RobotScene, source)
        self._open[key] = ReplayScene(source, scene)
        return self._open[key]

    async def _make_room(self) -> None:
        while len(self._open) >= OPEN_MAX:
            unseen = next(
                (key for key, one in self._open.items() if not one.scene.is_watched), None
            )
            if unseen is None:
                raise Problem(503, _FULL)
            await self._close(self._open.pop(unseen))

    async def _close(self, one: ReplayScene) -> None:
        await asyncio.get_running_loop().run_in_executor(self._drawing, one.scene.stop)


def _draw(shown: ReplayScene, moment: Moment) -> None:
    shown.source.show(moment)
    shown.scene.update()


def _wrong(message: str) -> FieldError:
    return FieldError(loc=["at"], msg=message)
