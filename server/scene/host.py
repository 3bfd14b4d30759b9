"""Keeps the 3D scenes that somebody looks at, and brings them up to date ten times a second."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from robot_link.messages import RobotId
from webui.scene.server import RobotScene
from webui.scene.source import SceneSource
from webui.scene.view import SceneChange, SceneState

UPDATE_S = 0.1
T = TypeVar("T")


class SceneHost:
    """Starts a robot's scene when it is first asked for; all of them are drawn in one thread.

    A scene that nobody looks at is not drawn, and one that was skipped catches up at once, because
    a source is asked for what is new since the last drawing.
    """

    def __init__(
        self,
        source_of: Callable[[RobotId], SceneSource | None],
        on_change: Callable[[RobotId], None],
    ) -> None:
        self.source_of = source_of
        self._on_change = on_change
        self._told: dict[RobotId, SceneState] = {}
        self._scenes: dict[RobotId, RobotScene] = {}
        self._drawing = ThreadPoolExecutor(max_workers=1, thread_name_prefix="scene")
        self._starting = asyncio.Lock()

    async def state(self, robot: RobotId) -> SceneState | None:
        """Return what a robot's view shows, ``None`` for an unknown robot."""
        scene = await self.scene(robot)
        return None if scene is None else await self._in_thread(lambda: scene.state)

    async def change(self, robot: RobotId, change: SceneChange) -> SceneState | None:
        """Let everybody who looks at a robot see something else; ``None`` for an unknown robot."""
        scene = await self.scene(robot)
        if scene is None:
            return None
        await self._in_thread(lambda: scene.change(change))
        return self._tell(robot, await self._in_thread(lambda: scene.state))

    async def scene(self, robot: RobotId) -> RobotScene | None:
        """Return a robot's scene, ``None`` for an unknown robot."""
        async with self._starting:
            scene = self._scenes.get(robot)
            if scene is None:
                source = self.source_of(robot)
                if source is None:
                    return None
                scene = await self._in_thread(lambda: _opened(source))
                self._scenes[robot] = scene
        return scene

    async def run(self) -> None:
        """Draw until cancelled."""
        while True:
            watched = {robot: one for robot, one in self._scenes.items() if one.is_watched}
            if watched:
                states = await self._in_thread(lambda scenes=watched: _update(scenes))
                for robot, state in states.items():
                    self._tell(robot, state)
            await asyncio.sleep(UPDATE_S)

    async def stop(self) -> None:
        """Close every scene and its socket."""
        for scene in self._scenes.values():
            await self._in_thread(scene.stop)
        self._scenes.clear()
        self._drawing.shutdown()

    def _tell(self, robot: RobotId, state: SceneState) -> SceneState:
        if self._told.get(robot) != state:
            self._told[robot] = state
            self._on_change(robot)
        return state

    async def _in_thread(self, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._drawing, work)


def _opened(source: SceneSource) -> RobotScene:
    scene = RobotScene(source)
    scene.update()
    return scene


def _update(scenes: dict[RobotId, RobotScene]) -> dict[RobotId, SceneState]:
    for scene in scenes.values():
        scene.update()
    return {robot: scene.state for robot, scene in scenes.items()}
