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

    def __init__(self, source_of: Callable[[RobotId], SceneSource | None]) -> None:
        self._source_of = source_of
        self._scenes: dict[RobotId, RobotScene] = {}
        self._drawing = ThreadPoolExecutor(max_workers=1, thread_name_prefix="scene")
        self._starting = asyncio.Lock()

    async def port(self, robot: RobotId) -> int | None:
        """Return the loopback port of a robot's scene, ``None`` for an unknown robot."""
        scene = await self._scene(robot)
        return None if scene is None else scene.port

    async def state(self, robot: RobotId) -> SceneState | None:
        """Return what a robot's view shows, ``None`` for an unknown robot."""
        scene = await self._scene(robot)
        return None if scene is None else await self._in_thread(lambda: scene.state)

    async def change(self, robot: RobotId, change: SceneChange) -> SceneState | None:
        """Let everybody who looks at a robot see something else; ``None`` for an unknown robot."""
        scene = await self._scene(robot)
        if scene is None:
            return None
        await self._in_thread(lambda: scene.change(change))
        return await self._in_thread(lambda: scene.state)

    async def _scene(self, robot: RobotId) -> RobotScene | None:
        async with self._starting:
            scene = self._scenes.get(robot)
            if scene is None:
                source = self._source_of(robot)
                if source is None:
                    return None
                scene = await self._in_thread(lambda: _opened(source))
                self._scenes[robot] = scene
        return scene

    async def run(self) -> None:
        """Draw until cancelled."""
        while True:
            watched = [scene for scene in self._scenes.values() if scene.is_watched]
            if watched:
                await self._in_thread(lambda scenes=watched: _update(scenes))
            await asyncio.sleep(UPDATE_S)

    async def stop(self) -> None:
        """Close every scene and its port."""
        for scene in self._scenes.values():
            await self._in_thread(scene.stop)
        self._scenes.clear()
        self._drawing.shutdown()

    async def _in_thread(self, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._drawing, work)


def _opened(source: SceneSource) -> RobotScene:
    scene = RobotScene(source)
    scene.update()
    return scene


def _update(scenes: list[RobotScene]) -> None:
    for scene in scenes:
        scene.update()
