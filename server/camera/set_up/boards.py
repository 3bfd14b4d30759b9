"""Pictures of the calibration board: asked for one by one, until a lens can be calibrated."""

import asyncio
from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any, Final

from robot_link.camera.sighting import BoardView
from server.base.foundation import Foundation
from server.base.job import JobError, JobProgress
from server.base.worker import WORKER_FAILURES
from server.camera.task import MISSING_BOARDS, LensKind, LensProblem, Shot

WANTED, LEAST, LEAST_CORNERS, MOST = 20, 15, 20, 60
"""Pictures that are wanted, those that are needed, corners in each, and pictures at most."""
CELLS: Final = (4, 3)
"""Across and down: parts of the picture in each of which some corner should have been."""
PATIENCE_S: Final = 10.0
CORNERS_MOST: Final = 70


class Boards:
    """What each camera saw of the board since somebody began. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._foundation = foundation
        self._shots: defaultdict[str, list[Shot]] = defaultdict(list)
        self._missing: dict[str, tuple[str, ...]] = {}
        self._kinds: dict[str, LensKind] = {}
        self._waiting: dict[str, asyncio.Future[BoardView]] = {}
        self._numbers: defaultdict[str, int] = defaultdict(int)
        self._ask: Callable[[str], None] | None = None

    def on_ask(self, ask: Callable[[str], None]) -> None:
        """Have the processes asked for the board."""
        self._ask = ask

    def shots(self, camera: str) -> tuple[Shot, ...]:
        """Return the pictures that were taken."""
        return tuple(self._shots[camera])

    def missing(self, camera: str) -> tuple[str, ...]:
        """Return what is missing yet, in words; nothing if there are enough."""
        return self._missing.get(camera, (f"{WANTED} pictures of the board",))

    def cells(self, camera: str) -> list[list[int]]:
        """Return how many corners were in each part of the picture, by rows from the top."""
        across, down = CELLS
        counts = [[0] * across for _ in range(down)]
        for shot in self._shots[camera]:
            width, height = shot.size
            for corner in shot.corners:
                column = min(max(int(corner.pixel[0] / width * across), 0), across - 1)
                row = min(max(int(corner.pixel[1] / height * down), 0), down - 1)
                counts[row][column] += 1
        return counts

    def hear(self, camera: str, view: BoardView) -> None:
        """Take what a camera saw of the board; what nobody asked for is dropped."""
        waiting = self._waiting.pop(camera, None)
        if waiting is not None and not waiting.done():
            waiting.set_result(view)

    async def take(self, camera: str, kind: LensKind, progress: JobProgress) -> Mapping[str, Any]:
        """Take one picture of the board.

        Raises:
            JobError: If it shows too few corners, or there is no picture.
        """
        progress.report(0.1, "Looks for the board.")
        view = await self._view(camera)
        if any(corner.id >= CORNERS_MOST for corner in view.corners):
            raise JobError("This is another board: print the station's own.")
        if len(view.corners) < LEAST_CORNERS:
            raise JobError(
                f"{len(view.corners)} corners of the board are seen, {LEAST_CORNERS} are needed: "
                "hold all of it into the picture, still and in the light."
            )
        shots = self._shots[camera]
        if shots and shots[0].size != view.size:
            shots.clear()
        if len(shots) >= MOST:
            raise JobError(f"There are {MOST} pictures already; calibrate, or begin anew.")
        self._numbers[camera] += 1
        shots.append(Shot(self._numbers[camera], view.size, tuple(view.corners)))
        self._kinds[camera] = kind
        await self._judge(camera)
        self._foundation.feed.mark("cameras")
        return {"number": self._numbers[camera], "corners": len(view.corners)}

    async def remove(self, camera: str, number: int | None) -> None:
        """Forget one picture of the board, or all."""
        kept = [one for one in self._shots[camera] if number is not None and one.number != number]
        self._shots[camera] = kept
        await self._judge(camera)
        self._foundation.feed.mark("cameras")

    def drop(self, camera: str) -> None:
        """Forget a camera that is gone."""
        self._shots.pop(camera, None)
        self._missing.pop(camera, None)
        self._kinds.pop(camera, None)
        self._numbers.pop(camera, None)

    async def _view(self, camera: str) -> BoardView:
        waiting: asyncio.Future[BoardView] = asyncio.get_running_loop().create_future()
        self._waiting[camera] = waiting
        if self._ask is not None:
            self._ask(camera)
        try:
            async with asyncio.timeout(PATIENCE_S):
                return await waiting
        except TimeoutError:
            raise JobError(f"{camera} sent no picture.") from None
        finally:
            if self._waiting.get(camera) is waiting:
                del self._waiting[camera]

    async def _judge(self, camera: str) -> None:
        """Work out what is missing yet, for the kind of lens that was asked for last."""
        problem = LensProblem(self._kinds.get(camera, "pinhole"), self.shots(camera))
        try:
            self._missing[camera] = await self._foundation.workers.run(MISSING_BOARDS, problem)
        except WORKER_FAILURES as error:
            raise JobError(f"What is missing could not be worked out: {error}") from error
