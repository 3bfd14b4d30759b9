import asyncio
import gc
import json
import weakref
from contextlib import asynccontextmanager
from datetime import UTC, datetime

import pytest
import pytest_asyncio
from sqlalchemy.exc import OperationalError

from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import SystemClock
from server.base.event_bus import EventBus, EventLogged, JobChanged
from server.base.event_log import EventLog
from server.base.job import JobBoard
from server.base.live_feed import (
    AT_FULL_RATE,
    EVENTS_IN_MEMORY,
    LONGER_S,
    QUIET_S,
    TICK_S,
    LiveFeed,
)
from tests.server.conftest import until


@pytest.fixture
def store(tmp_path):
    store = Store.open(f"sqlite:///{tmp_path / 'station.sqlite3'}")
    yield store
    store.close()


def feed_of(store, alarms=0):
    """Return a live stream, and the reader of the log that tells it of events."""
    bus = EventBus()
    log = EventLog(store, bus)
    feed = LiveFeed(store, SystemClock(), lambda _: alarms, log)
    bus.subscribe(EventLogged, feed.take)
    return feed, log


@asynccontextmanager
async def beating(feed, log):
    tasks = [asyncio.create_task(feed.run()), asyncio.create_task(log.run())]
    yield feed
    feed.close()
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


@pytest_asyncio.fixture
async def feed(store):
    async with beating(*feed_of(store, alarms=3)) as feed:
        await until(lambda: feed._ticks)
        yield feed


class Client:
    """Keeps what it gets; ``pause`` makes it slow."""

    def __init__(self, feed, robots=None, after=None):
        self.batches = []
        self.taken_s = []
        self.free = asyncio.Event()
        self.free.set()
        self.task = asyncio.create_task(feed.follow(self.take, robots, after))

    async def take(self, text):
        self.taken_s.append(asyncio.get_running_loop().time())
        self.batches.append(json.loads(text))
        await self.free.wait()

    @property
    def events(self):
        return [event["text"] for batch in self.batches for event in batch["events"]]

    def last(self, job):
        told = [batch["jobs"][job] for batch in self.batches if job in batch["jobs"]]
        return told[-1] if told else {}

    async def until(self, condition):
        await until(condition)


async def happen(store, *texts):
    at = datetime.now(UTC)
    await store.write(lambda session: [add_event(session, at, "test", text) for text in texts])


async def test_first_batch_has_every_part_and_later_ones_only_what_changed(feed):
    feed.put("robots", "mini-1", lambda: {"depth_m": 1.0}, "mini-1")
    feed.put("robots", "grace-1", lambda: {"depth_m": 5.0}, "grace-1")
    await until(lambda: not feed._due)
    client = Client(feed)
    await client.until(lambda: client.batches)
    assert client.batches[0]["robots"] == {"mini-1": {"depth_m": 1.0}, "grace-1": {"depth_m": 5.0}}
    assert client.batches[0]["alarms"] == {"unacknowledged": 3}
    feed.put("robots", "mini-1", lambda: {"depth_m": 1.1}, "mini-1")
    await client.until(lambda: any(batch["robots"] for batch in client.batches[1:]))
    (changed,) = [batch["robots"] for batch in client.batches[1:] if batch["robots"]]
    assert changed == {"mini-1": {"depth_m": 1.1}}


async def test_slow_client_conflates_gauges_but_gets_every_event_in_order(feed, store):
    client = Client(feed)
    await client.until(lambda: client.batches)
    client.free.clear()
    for number in range(30):
        feed.put("robots", "mini-1", lambda number=number: {"depth_m": number}, "mini-1")
        await happen(store, f"event {number}")
        await asyncio.sleep(0.02)
    await asyncio.sleep(0.2)
    client.free.set()
    await client.until(lambda: len(client.events) == 30)
    assert client.events == [f"event {number}" for number in range(30)]

    def depths():
        told = [batch["robots"] for batch in client.batches if batch["robots"]]
        return [robots["mini-1"]["depth_m"] for robots in told]

    await client.until(lambda: depths() and depths()[-1] == 29)
    assert len(depths()) < 10


async def test_client_that_returns_with_its_cursor_misses_nothing(feed, store):
    await happen(store, *(f"event {number}" for number in range(EVENTS_IN_MEMORY + 700)))
    await asyncio.sleep(0.3)
    client = Client(feed, after=100)
    await client.until(lambda: len(client.events) == EVENTS_IN_MEMORY + 600)
    assert client.events[0] == "event 100"
    assert client.events[-1] == f"event {EVENTS_IN_MEMORY + 699}"
    assert client.batches[-1]["cursor"] == EVENTS_IN_MEMORY + 700


async def test_client_that_knows_more_than_the_feed_gets_nothing_twice(feed, store):
    await happen(store, "one", "two", "three")
    client = Client(feed, after=2)
    await client.until(lambda: client.events)
    assert client.events == ["three"]


async def test_gauges_go_on_while_the_log_cannot_be_read_and_no_event_is_lost(store, monkeypatch):
    query, is_broken = store.query, False

    async def failing(function):
        """Fail what was begun before, too."""
        found = await query(function)
        if is_broken:
            raise OperationalError("select", {}, OSError("disk I/O error"))
        return found

    monkeypatch.setattr(store, "query", failing)
    feed, log = feed_of(store)
    client = Client(feed)
    async with beating(feed, log):
        await client.until(lambda: client.batches)
        is_broken = True
        await happen(store, "while it failed")
        feed.put("robots", "mini-1", lambda: {"depth_m": 2.0}, "mini-1")
        await client.until(lambda: any(batch["robots"] for batch in client.batches))
        await asyncio.sleep(0.3)
        assert client.events == []
        is_broken = False
        await client.until(lambda: client.events == ["while it failed"])
    await asyncio.gather(client.task, return_exceptions=True)


async def test_stream_begins_once_the_log_can_be_read_and_tells_nobody_what_was_before(
    store, monkeypatch
):
    await happen(store, "long ago")
    query, tries = store.query, []

    async def fail_twice(function):
        tries.append(function)
        if len(tries) <= 2:
            raise OperationalError("select", {}, OSError("disk I/O error"))
        return await query(function)

    monkeypatch.setattr(store, "query", fail_twice)
    feed, log = feed_of(store)
    client = Client(feed)
    async with beating(feed, log):
        await client.until(lambda: client.batches)
        await happen(store, "now")
        await client.until(lambda: client.events)
        assert client.events == ["now"]
    await asyncio.gather(client.task, return_exceptions=True)


async def test_client_of_a_stream_that_never_began_is_let_go_when_it_closes(store):
    feed, _ = feed_of(store)
    client = Client(feed)
    await asyncio.sleep(0)
    feed.close()
    async with asyncio.timeout(60):
        await client.task
    assert client.batches == []


async def test_client_that_asked_for_one_robot_hears_nothing_of_another(feed):
    client = Client(feed, robots=frozenset({"mini-1"}))
    feed.put("robots", "grace-1", lambda: {"depth_m": 5.0}, "grace-1")
    feed.put("plans", "plan-1", lambda: {"state": "draft"}, "grace-1")
    feed.put("robots", "mini-1", lambda: {"depth_m": 1.0}, "mini-1")
    await client.until(lambda: any(batch["robots"] for batch in client.batches))
    assert all("grace-1" not in batch["robots"] for batch in client.batches)
    assert all(not batch["plans"] for batch in client.batches)


async def test_quiet_feed_speaks_once_a_second_so_that_a_dead_road_is_noticed(feed):
    client = Client(feed)
    await client.until(lambda: len(client.batches) == 3)
    first, second, third = client.taken_s
    assert min(second - first, third - second) > 0.5 * QUIET_S


async def test_value_is_asked_for_once_a_tick_however_often_it_changed(feed):
    asked = []
    for _ in range(50):
        feed.put("robots", "mini-1", lambda: asked.append(1) or {}, "mini-1")
    client = Client(feed)
    await client.until(lambda: any(batch["robots"] for batch in client.batches))
    assert len(asked) == 1


async def test_many_clients_share_one_encoding(feed):
    clients = [Client(feed) for _ in range(5)]
    for client in clients:
        await client.until(lambda client=client: client.batches)
    texts = []

    async def keep(text):
        texts.append(text)

    more = [asyncio.create_task(feed.follow(keep, None, None)) for _ in range(3)]
    await until(lambda: len(texts) >= 3)
    feed.put("robots", "mini-1", lambda: {"depth_m": 1.0}, "mini-1")

    def newest():
        return [text for text in texts if "depth_m" in text]

    await until(lambda: len(newest()) == 3)
    assert all(text is newest()[0] for text in newest())
    for task in more:
        task.cancel()


async def test_closing_the_feed_lets_every_client_go(feed):
    client = Client(feed)
    await client.until(lambda: client.batches)
    feed.close()
    await asyncio.wait_for(client.task, 60)


async def test_running_job_is_shown_until_it_ends(feed, store):
    bus = EventBus()
    bus.subscribe(JobChanged, lambda it: feed.put("jobs", it.job.id, lambda: it.job))
    jobs = JobBoard(store, SystemClock(), bus)
    client = Client(feed)
    may_end = asyncio.Event()

    async def work(progress):
        progress.report(0.5, "half way")
        await may_end.wait()
        return {"rows": 3}

    job = await jobs.start("import", work, by="test")
    await client.until(lambda: client.last(job.id).get("message") == "half way")
    may_end.set()
    await client.until(lambda: client.last(job.id).get("state") == "done")
    assert client.last(job.id)["result"] == {"rows": 3}
    await jobs.stop()


async def test_what_changed_is_marked_with_a_number_that_grows(feed):
    client = Client(feed)
    await client.until(lambda: client.batches)

    def told(key):
        return [batch["changed"][key] for batch in client.batches if key in batch["changed"]]

    feed.mark("robots")
    feed.mark("satellite", "mini-1")
    await client.until(lambda: told("robots") and told("satellite/mini-1"))
    feed.mark("satellite", "mini-1")
    await client.until(lambda: len(told("satellite/mini-1")) == 2)
    first, second = told("satellite/mini-1")
    assert second > first
    assert len(told("robots")) == 1


async def test_client_that_comes_late_is_told_of_every_mark_however_many_there_are(feed):
    for number in range(500):
        feed.mark("drafts", f"robot-{number}")
    await until(lambda: not feed._due)
    client = Client(feed)
    await client.until(lambda: client.batches)
    assert len(client.batches[0]["changed"]) == 500


async def test_a_part_that_cannot_be_shown_silences_no_other(feed):
    def fail():
        raise KeyError("mission-1")

    client = Client(feed)
    feed.put("missions", "mission-1", fail)
    feed.put("robots", "mini-1", lambda: {"depth_m": 1.0}, "mini-1")
    await client.until(lambda: any(batch["robots"] for batch in client.batches))
    assert all(not batch["missions"] for batch in client.batches)


async def test_a_hundred_alike_get_one_text_and_one_who_does_not_read_holds_up_nobody(feed):
    assert feed.tick_s == TICK_S
    count = 4 * AT_FULL_RATE
    got = [[] for _ in range(count)]
    stalled = Client(feed)
    stalled.free.clear()
    await stalled.until(lambda: stalled.batches)

    def reader(texts):
        async def take(text):
            texts.append(text)

        return take

    tasks = [asyncio.create_task(feed.follow(reader(texts), None, None)) for texts in got]
    await until(lambda: all(got))
    feed.put("robots", "mini-1", lambda: {"depth_m": 2.0}, "mini-1")

    def told():
        return [text for texts in got for text in texts if '"depth_m":2.0' in text]

    await until(lambda: len(told()) == count)
    assert len({id(text) for text in told()}) == 1
    assert feed.tick_s == pytest.approx(TICK_S + LONGER_S * (count + 1 - AT_FULL_RATE))
    assert len(stalled.batches) == 1
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    assert feed.tick_s == TICK_S
    stalled.free.set()
    await stalled.until(lambda: len(stalled.batches) > 1)
    assert stalled.batches[1]["robots"]["mini-1"] == {"depth_m": 2.0}


async def test_what_was_said_is_not_kept_to_be_said_again(feed):
    class Plan:
        legs = "a long story"

    def put():
        plan = Plan()
        feed.put("plans", "plan-1", lambda: plan.legs, "mini-1")
        return weakref.ref(plan)

    kept = put()
    client = Client(feed)
    await until(lambda: any("plan-1" in batch.get("plans", {}) for batch in client.batches))
    gc.collect()
    assert kept() is None
    later = Client(feed)
    await until(lambda: any("plan-1" in batch.get("plans", {}) for batch in later.batches))
