"""Compiles the numeric kernels that setting up left, while the station runs.

A process of the lowest priority does it, as a job that the live stream shows. What needs a kernel
waits for it here, with a sentence, and does not compile it beside.
"""

import asyncio
import logging
from collections.abc import Callable, Mapping
from typing import Any

from autonomy import warm_up
from server.base.job import JobBoard, JobError, JobProgress
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.system.health_route import KERNELS_JOB

log = logging.getLogger(__name__)

COMPILE = "server.plan.machine_code:compile_all"
_LOWEST_PRIORITY = 19


class MachineCode:
    """Knows which steps of ``warm_up.STEPS`` are compiled. Belongs to one event loop."""

    def __init__(self, jobs: JobBoard) -> None:
        self._jobs = jobs
        self._done: frozenset[str] = frozenset(warm_up.STEPS)
        self._changed = asyncio.Condition()

    async def prepare(self) -> None:
        """Begin to compile what is not compiled; nothing is begun where all is."""
        if not await asyncio.to_thread(warm_up.is_complete):
            self._done = frozenset()
            await self._jobs.start(KERNELS_JOB, self._compile, by="station")

    async def wait_for(self, step: str, tell: Callable[[str], None]) -> None:
        """Return as soon as a step is compiled; meanwhile ``tell`` a sentence at each change."""
        async with self._changed:
            while step not in self._done:
                tell(self.sentence)
                await self._changed.wait()

    @property
    def sentence(self) -> str:
        """How far the preparation is, for a person."""
        return f"Preparing the planner: {len(self._done)} of {len(warm_up.STEPS)} kernels"

    async def _compile(self, progress: JobProgress) -> Mapping[str, Any]:
        pool = WorkerPool(1, _LOWEST_PRIORITY)
        pool.hurry()  # a compiler does not notice that it was cancelled, and nothing is lost
        steps: asyncio.Queue[str] = asyncio.Queue()
        following = asyncio.create_task(self._follow(steps, progress), name="compiled kernels")
        try:
            await pool.run(COMPILE, None, on_progress=steps.put_nowait)
        except WORKER_FAILURES as error:
            log.warning("the kernels were not compiled ahead: %s", error)
            raise JobError(f"{error} What needs a kernel compiles it by itself.") from error
        finally:
            following.cancel()
            await pool.stop()
            await self._note(warm_up.STEPS)
        return {}

    async def _follow(self, steps: asyncio.Queue[str], progress: JobProgress) -> None:
        while True:
            progress.report(len(self._done) / len(warm_up.STEPS), self.sentence)
            await self._note((await steps.get(),))

    async def _note(self, steps: tuple[str, ...]) -> None:
        async with self._changed:
            self._done = self._done.union(steps)
            self._changed.notify_all()


def compile_all(
    payload: None, report: Callable[[str], None], is_cancelled: Callable[[], bool]
) -> None:
    """Compile every step in a working process, report each that is done, note when all are."""
    del payload
    digest = warm_up.source_digest()
    done = warm_up.FLIGHT if warm_up.is_complete(flight_only=True) else ()
    for step in warm_up.STEPS:
        if is_cancelled():
            return
        if step not in done:
            warm_up.compile_step(step)
        report(step)
    warm_up.note_complete(digest)
