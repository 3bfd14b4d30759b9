"""Kernels compiled while the station runs: their progress, and who waits for them."""

import asyncio
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

import pytest

from autonomy import warm_up
from db.query.station.jobs import JobRecord
from server.base.job import JobWork
from server.base.worker import WorkerTaskError
from server.plan import machine_code
from server.plan.machine_code import MachineCode
from tests.server.conftest import until

SEARCH = warm_up.search_step("information_gain")


class Board:
    """Runs the work of a job, and keeps what it said."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.task: asyncio.Task[Any] | None = None

    async def start(self, kind: str, work: JobWork, *, by: str) -> JobRecord:
        self.task = asyncio.create_task(work(self))  # type: ignore[arg-type]
        return JobRecord(
            id="job-1", kind=kind, state="running", progress=0.0, message="", result=None,
            created_at=datetime.now(UTC), ended_at=None, created_by=by,
        )  # fmt: skip

    def report(self, progress: float, message: str) -> None:
        assert 0.0 <= progress <= 1.0
        self.said.append(message)


class Pool:
    """Compiles a step whenever the test says so."""

    steps: asyncio.Queue[str | Exception | None]

    def __init__(self, size: int, niceness: int) -> None:
        assert niceness == 19

    def hurry(self) -> None: ...

    async def stop(self) -> None: ...

    async def run(self, task: str, payload: None, *, on_progress: Callable[[str], None]) -> None:
        while (step := await self.steps.get()) is not None:
            if isinstance(step, Exception):
                raise step
            on_progress(step)


@pytest.fixture
async def code(monkeypatch: pytest.MonkeyPatch) -> MachineCode:
    Pool.steps = asyncio.Queue()
    monkeypatch.setattr(machine_code, "WorkerPool", Pool)
    monkeypatch.setattr(warm_up, "is_complete", lambda: False)
    return MachineCode(Board())  # type: ignore[arg-type]


async def test_a_search_waits_with_a_sentence_until_its_kernels_are_compiled(code: MachineCode):
    said: list[str] = []
    await code.prepare()
    waiting = asyncio.create_task(code.wait_for(SEARCH, said.append))
    await until(lambda: len(said) == 1)
    Pool.steps.put_nowait(warm_up.FLIGHT[0])
    await until(lambda: len(said) == 2)
    assert not waiting.done()
    Pool.steps.put_nowait(SEARCH)
    await asyncio.wait_for(waiting, 60.0)
    count = len(warm_up.STEPS)
    assert said == [f"Preparing the planner: {done} of {count} kernels" for done in (0, 1)]
    assert code._jobs.said[-1] == f"Preparing the planner: 2 of {count} kernels"
    Pool.steps.put_nowait(None)
    await code._jobs.task


async def test_nobody_waits_for_kernels_that_could_not_be_compiled_ahead(code: MachineCode):
    await code.prepare()
    waiting = asyncio.create_task(code.wait_for(SEARCH, lambda _: None))
    Pool.steps.put_nowait(WorkerTaskError("no compiler"))
    await asyncio.wait_for(waiting, 60.0)
    with pytest.raises(machine_code.JobError, match="no compiler"):
        await code._jobs.task


async def test_nothing_is_begun_where_all_is_compiled(
    code: MachineCode, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(warm_up, "is_complete", lambda: True)
    await code.prepare()
    assert code._jobs.task is None
    await asyncio.wait_for(code.wait_for(SEARCH, pytest.fail), 60.0)
