"""Keeps the 3D scenes of past moments that were asked for last."""

import asyncio
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final

from autonomy.vehicle.hull import Hull
from robot_link.messages import RobotId
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, unprocessable
from server.fleet.fleet import Fleet
from server.scene.past import PastKnowledge, PastSceneSource, known_at
from server.vehicle.vehicles import Vehicles
from webui.scene.server import RobotScene

OPEN_MAX: Final = 8
"""Each scene has a socket and a thread, and holds a map."""
_EARLIEST: Final = datetime(2000, 1, 1, tzinfo=UTC)
_FULL = f"{OPEN_MAX} past views are looked at already; close one of them and try again."


@dataclass(frozen=True, slots=True)
class PastScene:
    """A robot at a moment, drawn."""

    known: PastKnowledge
    scene: RobotScene


class PastScenes:
    """Draws a robot at a moment once, when it is first asked for. Belongs to one event loop.

    Whoever looks moves their own camera, and nothing else: no order and no switch goes through it.
    """

    def __init__(self, foundation: Foundation, fleet: Fleet, vehicles: Vehicles) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._vehicles = vehicles
        self._open: OrderedDict[tuple[RobotId, datetime], PastScene] = OrderedDict()
        """Those asked for last stand last."""
        self._drawing = ThreadPoolExecutor(max_workers=1, thread_name_prefix="past scene")
        self._starting = asyncio.Lock()

    async def known(self, robot: RobotId, at: datetime) -> PastKnowledge:
        """Return what the station knew of a robot at a moment.

        Raises:
            UnknownIdError: If there is no such robot.
            Problem: 422 for a moment that has not come yet, or is before any robot's.
        """
        status = self._fleet.status(robot)
        if at > self._foundation.clock.now():
            raise unprocessable("1 field is wrong.", [_wrong("it has not come yet")])
        if at < _EARLIEST:
            raise unprocessable("1 field is wrong.", [_wrong(f"it is before {_EARLIEST:%Y}")])
        at = at.astimezone(UTC)
        channels = self._foundation.channels.catalogue
        return await self._foundation.store.query(
            lambda session: known_at(session, status, at, channels)
        )

    async def scene(self, robot: RobotId, at: datetime) -> PastScene:
        """Return the scene of a robot at a moment.

        Raises:
            UnknownIdError: If there is no such robot.
            Problem: 422 for a moment that has not come yet, 503 if too many are looked at.
        """
        async with self._starting:
            found = self._open.get((robot, at))
            if found is not None:
                self._open.move_to_end((robot, at))
                return found
            known = await self.known(robot, at)
            await self._make_room()
            status = self._fleet.status(robot)
            vehicle = self._vehicles.find(status.record.model)
            hull = Hull() if vehicle is None else vehicle.hull
            source = PastSceneSource(known, hull, status.track.thresholds_m)
            loop = asyncio.get_running_loop()
            scene = await loop.run_in_executor(self._drawing, _drawn, source)
            self._open[robot, at] = PastScene(known, scene)
            return self._open[robot, at]

    async def stop(self) -> None:
        """Close every scene and its socket."""
        for one in self._open.values():
            await self._close(one)
        self._open.clear()
        self._drawing.shutdown()

    async def _make_room(self) -> None:
        while len(self._open) >= OPEN_MAX:
            unseen = next(
                (key for key, one in self._open.items() if not one.scene.is_watched), None
            )
            if unseen is None:
                raise Problem(503, _FULL)
            await self._close(self._open.pop(unseen))

    async def _close(self, one: PastScene) -> None:
        await asyncio.get_running_loop().run_in_executor(self._drawing, one.scene.stop)


def _wrong(message: str) -> FieldError:
    return FieldError(loc=["at"], msg=message)


def _drawn(source: PastSceneSource) -> RobotScene:
    scene = RobotScene(source)
    scene.update()
    return scene
