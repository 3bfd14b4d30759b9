import asyncio

import pytest

from simulator.background import alongside


async def test_work_ends_with_its_context():
    ended = asyncio.Event()

    async def work() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            ended.set()

    async with alongside(work(), "work"):
        await asyncio.sleep(0)
        assert not ended.is_set()
    assert ended.is_set()


async def test_failed_work_is_logged_at_once_and_raised_at_the_end(caplog):
    async def work() -> None:
        raise RuntimeError("the tape is full")

    with pytest.raises(RuntimeError, match="tape"):  # noqa: PT012 - what is logged meanwhile
        async with alongside(work(), "recorder"):
            await asyncio.sleep(0.01)
            assert "recorder has failed" in caplog.text
