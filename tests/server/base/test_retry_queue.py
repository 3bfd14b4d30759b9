"""Work that comes back goes on after a bad moment, and says so where it does not."""

import asyncio

import pytest

from db.fault import StoreUnavailableError
from server.base.retry_queue import every, until_stored


async def test_a_failure_of_files_or_storage_leaves_it_to_the_next_time(
    caplog: pytest.LogCaptureFixture,
):
    faults = [FileNotFoundError("gone"), StoreUnavailableError("full"), PermissionError("no")]
    done = asyncio.Event()

    async def work() -> None:
        if faults:
            raise faults.pop(0)
        done.set()

    task = asyncio.create_task(every("clearing", 0.0, work))
    async with asyncio.timeout(30.0):
        await done.wait()
    assert not task.done()
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    told = [one.message for one in caplog.records]
    assert told == [f"clearing: not this time: {one}" for one in ("gone", "full", "no")]


async def test_what_nobody_foresaw_is_passed_on():
    async def work() -> None:
        raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        await every("clearing", 0.0, work)


async def test_a_storage_that_is_away_for_hours_is_told_once(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("server.base.retry_queue.RETRY_S", 0.0)
    faults = [StoreUnavailableError("away")] * 20

    async def work() -> None:
        if faults:
            raise faults.pop()

    async with asyncio.timeout(30.0):
        await until_stored("notices", work)
    told = [one.message for one in caplog.records if one.levelname == "WARNING"]
    assert told == ["notices waits for the storage: away"]
