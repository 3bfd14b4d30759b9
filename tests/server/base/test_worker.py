import asyncio
import os
import queue
import signal
import threading
import time
import weakref
from collections.abc import AsyncIterator, Callable

import pytest
import pytest_asyncio

from server.base import worker as worker_module
from server.base import worker_process
from server.base.worker import WorkerEndedError, WorkerPool, WorkerSpentError, WorkerTaskError

HERE = __name__


def double(payload: int, report: Callable[[int], None], _: Callable[[], bool]) -> int:
    print("printing in a task does not disturb the pipe")  # noqa: T201
    report(1)
    report(2)
    return 2 * payload


def fail(payload: str, _: Callable[[int], None], __: Callable[[], bool]) -> None:
    raise ValueError(payload)


class Large:
    """Notes the threads that pack it here and unpack what comes back."""

    packed_by: int | None = None
    unpacked_by: int | None = None

    def __getstate__(self) -> dict[str, bytes]:
        Large.packed_by = threading.get_ident()
        return {"body": bytes(1 << 17)}

    def __setstate__(self, state: dict[str, bytes]) -> None:
        Large.unpacked_by = threading.get_ident()
        self.body = state["body"]


def give_back(payload: Large, _: Callable[[int], None], __: Callable[[], bool]) -> Large:
    return payload


def wait_for_cancel(_: None, report: Callable[[int], None], cancelled: Callable[[], bool]) -> str:
    report(os.getpid())
    while not cancelled():
        time.sleep(0.01)
    return "noticed"


def rest(payload: float, _: Callable[[int], None], is_over: Callable[[], bool]) -> bool:
    time.sleep(payload)
    return is_over()


def toil(_: None, report: Callable[[int], None], is_over: Callable[[], bool]) -> None:
    while not is_over():
        pass
    raise RuntimeError("told to stop")


def break_off(_: None, report: Callable[[int], None], cancelled: Callable[[], bool]) -> None:
    wait_for_cancel(None, report, cancelled)
    raise RuntimeError("told to stop")


@pytest_asyncio.fixture
async def pool(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[WorkerPool]:
    monkeypatch.setattr(worker_module, "CANCEL_GRACE_S", 60.0)
    pool = WorkerPool()
    yield pool
    await pool.stop()


async def test_task_returns_its_result_and_reports_progress_in_order(pool: WorkerPool) -> None:
    seen: list[int] = []
    assert await pool.run(f"{HERE}:double", 21, on_progress=seen.append) == 42
    assert seen == [1, 2]


async def test_second_task_reuses_the_warm_process(pool: WorkerPool) -> None:
    await pool.run(f"{HERE}:double", 1)
    first = pool.process_ids()
    await pool.run(f"{HERE}:double", 1)
    assert pool.process_ids() == first


async def test_all_processes_but_one_end_when_they_have_nothing_to_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(worker_module, "UNUSED_S", 0.05)
    monkeypatch.setattr(worker_module, "CANCEL_GRACE_S", 60.0)
    several = WorkerPool(3)
    started: asyncio.Queue[int] = asyncio.Queue()
    tasks = [
        asyncio.create_task(
            several.run(f"{HERE}:wait_for_cancel", None, on_progress=started.put_nowait)
        )
        for _ in range(3)
    ]
    pids = {await started.get() for _ in tasks}
    assert set(several.process_ids()) == pids
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    while len(several.process_ids()) > 1 or several._ending:  # noqa: ASYNC110 - nothing tells it
        await asyncio.sleep(0.01)
    (kept,) = several.process_ids()
    for ended in pids - {kept}:
        with pytest.raises(ProcessLookupError):
            os.kill(ended, 0)
    assert await several.run(f"{HERE}:double", 4) == 8
    assert several.process_ids() == (kept,)
    await several.stop()


async def test_what_is_large_is_packed_and_unpacked_beside_the_event_loop(pool: WorkerPool) -> None:
    found = await pool.run(f"{HERE}:give_back", Large())
    assert len(found.body) == 1 << 17
    assert Large.packed_by not in {None, threading.get_ident()}
    assert Large.unpacked_by not in {None, threading.get_ident()}


async def test_error_in_a_task_reaches_the_caller_and_spares_the_process(pool: WorkerPool) -> None:
    with pytest.raises(WorkerTaskError, match="ValueError: no such box"):
        await pool.run(f"{HERE}:fail", "no such box")
    assert await pool.run(f"{HERE}:double", 1) == 2


async def test_killed_process_is_told_and_the_next_task_gets_a_new_one(pool: WorkerPool) -> None:
    started: asyncio.Queue[int] = asyncio.Queue()
    task = asyncio.create_task(
        pool.run(f"{HERE}:wait_for_cancel", None, on_progress=started.put_nowait)
    )
    pid = await started.get()
    os.kill(pid, signal.SIGKILL)
    with pytest.raises(WorkerEndedError, match="nothing was changed"):
        await task
    assert await pool.run(f"{HERE}:double", 4) == 8
    assert pid not in pool.process_ids()


async def test_cancelled_task_stops_and_leaves_its_process_warm(pool: WorkerPool) -> None:
    started: asyncio.Queue[int] = asyncio.Queue()
    task = asyncio.create_task(
        pool.run(f"{HERE}:wait_for_cancel", None, on_progress=started.put_nowait)
    )
    pid = await started.get()
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert await pool.run(f"{HERE}:double", 4) == 8
    assert pool.process_ids() == (pid,)


async def test_a_task_that_is_cancelled_before_its_process_is_ready_leaves_none(
    pool: WorkerPool, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[asyncio.subprocess.Process] = []
    is_awaited = asyncio.Event()

    async def never_ready(worker: worker_module._Process) -> tuple[object, ...]:
        started.append(worker.process)
        is_awaited.set()
        await asyncio.Event().wait()
        return ()

    monkeypatch.setattr(worker_module._Process, "receive", never_ready)
    task = asyncio.create_task(pool.run(f"{HERE}:double", 1))
    await is_awaited.wait()
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert [process.returncode for process in started] == [-signal.SIGKILL]
    monkeypatch.undo()
    assert await pool.run(f"{HERE}:double", 4) == 8


async def test_a_task_that_only_waits_for_a_processor_has_used_nothing_of_its_limit(
    pool: WorkerPool,
) -> None:
    assert await pool.run(f"{HERE}:rest", 0.6, processor_limit_s=0.3) is False


async def test_a_task_is_told_to_stop_by_the_processor_time_that_it_used(pool: WorkerPool) -> None:
    await pool.run(f"{HERE}:double", 1)
    first = pool.process_ids()
    with pytest.raises(WorkerSpentError):
        await pool.run(f"{HERE}:toil", None, processor_limit_s=0.05)
    assert await pool.run(f"{HERE}:double", 4) == 8
    assert pool.process_ids() == first


async def test_worker_ends_when_the_station_closes_its_pipe(pool: WorkerPool) -> None:
    await pool.run(f"{HERE}:double", 1)
    (pid,) = pool.process_ids()
    await pool.stop()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


async def test_task_that_was_told_to_stop_leaves_no_trace_in_the_log_and_one_that_fails_does(
    pool: WorkerPool, capfd: pytest.CaptureFixture[str]
) -> None:
    started: asyncio.Queue[int] = asyncio.Queue()
    task = asyncio.create_task(pool.run(f"{HERE}:break_off", None, on_progress=started.put_nowait))
    await started.get()
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    with pytest.raises(WorkerTaskError):
        await pool.run(f"{HERE}:fail", "broken")
    said = capfd.readouterr().err
    assert ("told to stop" in said, "broken" in said) == (False, True)


async def test_a_process_without_work_gives_memory_back_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls: queue.Queue[tuple[str]] = queue.Queue()
    trimmed: list[int] = []

    def trim() -> None:
        trimmed.append(calls.qsize())
        calls.put(("late",))

    monkeypatch.setattr(worker_process, "trim", trim)
    monkeypatch.setattr(worker_process, "IDLE_S", 0.01)
    assert await asyncio.to_thread(worker_process._next, calls) == ("late",)
    assert trimmed == [0]


async def test_a_process_that_has_work_does_it_first(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: queue.Queue[tuple[str]] = queue.Queue()
    calls.put(("waiting",))
    monkeypatch.setattr(worker_process, "trim", lambda: pytest.fail("there is work"))
    assert await asyncio.to_thread(worker_process._next, calls) == ("waiting",)


def test_a_process_that_waits_holds_nothing_of_the_task_that_it_did() -> None:
    class Held:
        pass

    held = Held()
    gone = weakref.ref(held)
    messages: list[tuple[object, ...]] = [(worker_process.CALL, "task", held, None)]
    del held
    calls: queue.Queue[tuple[object, ...]] = queue.Queue()

    class Pipe:
        def receive(self) -> tuple[object, ...]:
            if messages:
                return messages.pop()
            assert calls.get_nowait()[0] == "task"
            assert gone() is None
            raise EOFError

    with pytest.raises(EOFError):
        worker_process._listen(Pipe(), calls, threading.Event())  # pyright: ignore[reportArgumentType]
