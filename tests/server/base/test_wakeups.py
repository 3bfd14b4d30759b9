import asyncio
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest

from robot_link.clock import ScaledClock, SystemClock
from server.base import wakeups
from server.base.wakeups import Wakeups


class SetClock:
    """A clock that stands until someone sets it."""

    speed = 1.0

    def __init__(self) -> None:
        self.at = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)

    def now(self) -> datetime:
        return self.at


async def test_what_events_named_is_looked_at_together() -> None:
    looks = Wakeups(SystemClock())
    for robot in ("mini-1", "grace-1", "mini-1"):
        looks.wake(robot)
    assert await looks.next() == ["grace-1", "mini-1"]
    with pytest.raises(TimeoutError):
        await asyncio.wait_for(looks.next(), 0.05)


async def test_an_event_wakes_who_waits_for_a_moment() -> None:
    looks = Wakeups(SystemClock())
    looks.set_due("grace-1", SystemClock().now() + timedelta(hours=1))
    waiting = asyncio.ensure_future(looks.next())
    await asyncio.sleep(0.01)
    looks.wake("mini-1")
    assert await asyncio.wait_for(waiting, 60) == ["mini-1"]


async def test_a_moment_comes_by_the_clock_and_not_by_the_wall() -> None:
    now = datetime.now(UTC)
    clock = ScaledClock(now, now, speed=3600.0)
    looks = Wakeups(clock)
    looks.set_due("mini-1", clock.now() + timedelta(minutes=3))
    assert await asyncio.wait_for(looks.next(), 60) == ["mini-1"]
    assert clock.now() >= now + timedelta(minutes=3)


async def test_a_moment_that_was_taken_back_never_comes() -> None:
    looks = Wakeups(SystemClock())
    looks.set_due("mini-1", SystemClock().now())
    looks.set_due("mini-1", None)
    with pytest.raises(TimeoutError):
        await asyncio.wait_for(looks.next(), 0.05)


async def test_a_clock_that_was_set_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wakeups, "LONGEST_S", 0.01)
    clock = SetClock()
    looks = Wakeups(clock)
    looks.set_due("mini-1", clock.at + timedelta(hours=1))
    waiting = asyncio.ensure_future(looks.next())
    await asyncio.sleep(0.03)
    clock.at += timedelta(hours=2)
    assert await asyncio.wait_for(waiting, 60) == ["mini-1"]


async def test_a_burst_is_looked_at_once_and_the_rest_is_no_delay_for_the_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looks, seen = Wakeups(SystemClock(), rest_s=0.05), list[list[str]]()
    pause, rests = asyncio.sleep, list[float]()
    rested = asyncio.Semaphore(1)

    async def rest(rest_s: float) -> None:
        rests.append(rest_s)
        await rested.acquire()

    monkeypatch.setattr(wakeups, "asyncio", SimpleNamespace(sleep=rest))

    async def follow() -> None:
        while True:
            seen.append(await looks.next())

    async def turn() -> None:
        for _ in range(10):
            await pause(0)

    following = asyncio.create_task(follow())
    await turn()
    looks.wake("mini-1")
    await turn()
    assert (seen, rests) == ([["mini-1"]], [0.05, 0.05])
    for _ in range(5):
        looks.wake("grace-1")
        looks.wake("mini-1")
        await turn()
    assert len(seen) == 1
    rested.release()
    await turn()
    following.cancel()
    assert seen[1:] == [["grace-1", "mini-1"]]
