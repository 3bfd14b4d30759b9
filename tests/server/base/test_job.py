"""Long work: progress, outcome, and calling it off."""

import asyncio

import pytest

from server.base.event_bus import JobChanged
from server.base.job import JobError, JobPerKey, JobProgress, ThreadWork, WorkStoppedError
from server.base.problem import Problem
from tests.server.station_app import running, signed_in


@pytest.fixture
async def app(tmp_path):
    async with running(tmp_path) as app:
        yield app


@pytest.fixture
def jobs(app):
    return app.state.foundation.jobs


async def ended(jobs, job):
    async with asyncio.timeout(60):
        while (found := await jobs.get(job.id)).state == "running":  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    return found


async def test_progress_is_seen_while_the_work_goes_on(app, jobs):
    go_on = asyncio.Event()

    async def work(progress):
        progress.report(0.4, "Examined 12 candidates")
        await go_on.wait()
        return {"answer": 42}

    job = await jobs.start("test", work, by="ann")
    async with signed_in(app) as client:
        seen = (await client.get(f"/api/jobs/{job.id}")).json()
        assert (seen["state"], seen["progress"]) == ("running", 0.4)
        assert seen["message"] == "Examined 12 candidates"
        go_on.set()
        await ended(jobs, job)
        [seen] = (await client.get("/api/jobs")).json()["jobs"]
    assert (seen["state"], seen["progress"], seen["result"]) == ("done", 1.0, {"answer": 42})
    assert jobs.running == []


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (JobError("The file is empty.", {"errors": []}), "The file is empty."),
        (ZeroDivisionError("secret"), "The station failed at this; its log says why."),
    ],
)
async def test_work_that_fails_says_why(jobs, error, message):
    async def work(progress):
        raise error

    found = await ended(jobs, await jobs.start("test", work, by="ann"))
    assert (found.state, found.message) == ("failed", message)


async def test_a_job_is_called_off_at_once(app, jobs):
    stopped = []

    async def work(progress):
        try:
            await asyncio.sleep(60)
        finally:
            stopped.append(True)

    job = await jobs.start("test", work, by="ann")
    async with signed_in(app) as client:
        cancelled = await client.delete(f"/api/jobs/{job.id}")
        assert cancelled.json()["state"] == "cancelled"
        assert stopped == [True]
        again = await client.delete(f"/api/jobs/{job.id}")
    assert again.status_code == 409
    assert again.json()["detail"] == f"{job.id} is cancelled already."


async def test_a_job_can_be_called_off_before_its_first_step(jobs):
    async def work(progress):
        await asyncio.sleep(60)

    job = await jobs.start("test", work, by="ann")
    assert (await jobs.cancel(job.id)).state == "cancelled"


async def test_work_that_never_began_holds_its_place_no_more(app, jobs):
    place = JobPerKey[str](jobs, "test")
    begun: list[str] = []

    def call_off_the_first(told):
        if not begun:
            begun.append(told.job.id)
            # the task is made after this was told
            asyncio.get_running_loop().call_soon(lambda: jobs._tasks[told.job.id].cancel())  # noqa: PLW0108

    app.state.foundation.bus.subscribe(JobChanged, call_off_the_first)

    async def work(progress):
        return {}

    await place.start_alone("lake", work, refusal="busy", by="ann")
    second = await place.start_alone("lake", work, refusal="busy", by="ann")
    assert second not in begun
    assert (await ended(jobs, await jobs.get(second))).state == "done"


async def test_a_second_one_of_the_same_is_refused_while_the_first_goes_on(jobs):
    place, go_on = JobPerKey[str](jobs, "test"), asyncio.Event()

    async def work(progress):
        await go_on.wait()
        return {}

    first = await place.start_alone("lake", work, refusal="busy", by="ann")
    with pytest.raises(Problem, match="busy"):
        await place.start_alone("lake", work, refusal="busy", by="ann")
    assert await place.start("lake", work, by="ann") == first
    go_on.set()
    assert (await ended(jobs, await jobs.get(first))).state == "done"


async def test_work_under_way_at_the_end_is_noted(tmp_path):
    async def work(progress):
        await asyncio.sleep(60)

    async with running(tmp_path) as app:
        job = await app.state.foundation.jobs.start("test", work, by="ann")
    async with running(tmp_path) as app:
        assert (await app.state.foundation.jobs.get(job.id)).state == "cancelled"


@pytest.mark.parametrize(("ends", "said"), [(WorkStoppedError, 0), (OSError, 1)])
async def test_thread_that_stops_as_it_was_told_leaves_no_word_in_the_log(ends, said, caplog):
    thread = ThreadWork(JobProgress(lambda progress, message: None))
    began = asyncio.Event()

    async def until_stopped():
        began.set()
        while True:
            await asyncio.sleep(0.0)
            try:
                thread.go_on()
            except WorkStoppedError:
                raise ends from None

    work = asyncio.create_task(until_stopped())
    waiting = asyncio.create_task(thread.result(work))
    await began.wait()
    await asyncio.sleep(0.0)
    waiting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await waiting
    assert not work._log_traceback, "asyncio would tell of an error that nobody took"
    assert [record.exc_info[0] for record in caplog.records] == [ends] * said
