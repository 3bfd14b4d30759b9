"""A station that is killed before, while or after it calls a service tells everybody.

At least once; twice only where no answer is known, and then the message says so.
"""

import asyncio
import signal
import sys
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from datetime import timedelta
from pathlib import Path

import pytest

from server.notice.delivery import REPEATED
from tests.server.conftest import until
from tests.server.fake_link import World
from tests.server.notice.conftest import NoticeStation, move, notice_station, words
from tests.server.notice.receiver import Taken, WebService, web_service

pytestmark = pytest.mark.process
ROOT = Path(__file__).parents[3]


@asynccontextmanager
async def doomed(
    folder: Path, service: WebService, moment: str, *more: str
) -> AsyncGenerator[asyncio.subprocess.Process]:
    """Run a station until the block ends or it killed itself."""
    child = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "tests.server.notice.doomed_station",
        str(folder), service.url, moment, *more,
        cwd=ROOT, stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        yield child
        if moment not in ("written", "answered"):
            child.kill()
        await asyncio.wait_for(child.communicate(), 200)
        assert child.returncode == -signal.SIGKILL
    finally:
        if child.returncode is None:
            child.kill()
            await child.communicate()


async def is_kept(child: asyncio.subprocess.Process, event: str) -> None:
    """Wait until a station says that it has kept an event of a notice."""
    assert child.stdout is not None
    async with asyncio.timeout(200):
        while (line := (await child.stdout.readline()).decode().strip()) != event:
            assert line, "the station ended before"


async def leak(here: NoticeStation) -> dict[str, object] | None:
    """Return the notice of the leak once a service took it."""
    told = [one for one in await here.told() if "It leaks." in one["title"]]
    assert len(told) == 1
    return told[0] if told[0]["state"] == "handed" else None


async def are_handed(here: NoticeStation) -> bool:
    """Tell whether it is kept that services took the leak's notices, of everybody who was told."""
    states = [one["state"] for one in await here.told() if "It leaks." in one["title"]]
    return states == ["handed", "handed"]


def those_of(service: WebService, told: dict[str, object]) -> list[Taken]:
    """Return what a service took of one notice; on a slow machine it may be told of more."""
    return [one for one in service.taken if one.headers["idempotency-key"] == told["id"]]


def about(service: WebService, title: str) -> list[Taken]:
    """Return what a service took in which an alarm stands."""
    return [one for one in service.taken if title in words(one)]


def is_marked(taken: Taken) -> bool:
    assert (taken.json["repeated"] == "maybe") == words(taken).startswith(REPEATED)
    return taken.json["repeated"] == "maybe"


async def test_one_that_was_written_and_not_sent_is_sent_and_is_no_repetition(
    tmp_path: Path, world: World
):
    async with web_service() as service:
        async with doomed(tmp_path, service, "written"):
            pass
        assert service.calls == 0
        async with notice_station(tmp_path, world) as here:
            told = await until(lambda: leak(here))
    (taken,) = those_of(service, told)
    assert not is_marked(taken)


@pytest.mark.parametrize("mode", ["hang", "mute"])
async def test_one_whose_service_never_answered_is_sent_again_and_says_that_it_may_be_a_repetition(
    tmp_path: Path, world: World, mode: str
):
    async with web_service(mode) as service:
        async with doomed(tmp_path, service, "called"):
            await service.until_called(timeout_s=200.0)
        before = len(service.taken)
        service.mode = "take"
        async with notice_station(tmp_path, world) as here:
            told = await until(lambda: leak(here))
        assert told["unanswered"] == 1
        taken = those_of(service, told)
        assert len(taken) == before + 1
    assert is_marked(taken[-1])


async def test_one_that_was_taken_before_that_could_be_kept_comes_again_with_its_mark(
    tmp_path: Path, world: World
):
    async with web_service() as service:
        async with doomed(tmp_path, service, "answered"):
            pass
        async with notice_station(tmp_path, world) as here:
            told = await until(lambda: leak(here))
        first, second = those_of(service, told)
    assert (is_marked(first), is_marked(second)) == (False, True)


@pytest.mark.parametrize("mode", ["refuse", "break", "closed"])
async def test_one_that_was_surely_not_taken_is_sent_again_and_is_no_repetition(
    tmp_path: Path, world: World, mode: str
):
    async with web_service(mode) as service:
        async with doomed(tmp_path, service, "refused") as child:
            await is_kept(child, "notice.not_taken")
        assert service.taken == []
        service.mode = "take"
        if mode == "closed":
            await service.listen()
        async with notice_station(tmp_path, world) as here:
            told = await until(lambda: leak(here))
        assert (told["attempts"], told["unanswered"]) == (2, 0)
        (taken,) = those_of(service, told)
    assert not is_marked(taken)


async def test_one_whose_answer_was_kept_is_not_sent_again(tmp_path: Path, world: World):
    async with web_service() as service:
        async with doomed(tmp_path, service, "kept") as child:
            await is_kept(child, "notice.handed")
        async with notice_station(tmp_path, world) as here:
            await here.alarms.raise_("hot", "It is hot.", level="critical")
            hot = await until(lambda: next(iter(about(service, "It is hot.")), None))
            assert await leak(here)
    assert len(about(service, "It leaks.")) == 1
    assert not is_marked(hot)


async def test_an_escalation_goes_on_where_it_was_and_tells_nobody_twice(
    tmp_path: Path, world: World, moving: list[timedelta]
):
    async with web_service() as first, web_service() as on:
        async with doomed(tmp_path, first, "kept", on.url) as child:
            await is_kept(child, "notice.handed")
        moving[0] = timedelta(minutes=5)
        async with notice_station(tmp_path, world) as here:
            await move(here, moving, minutes=0)
            assert about(on, "It leaks.") == []
            await move(here, moving, minutes=6)
            called = await until(lambda: next(iter(about(on, "It leaks.")), None))
            await until(lambda: are_handed(here))
        assert "Nobody has acknowledged this yet." in words(called)
        async with notice_station(tmp_path, world) as here:
            await move(here, moving, minutes=60)
        assert [len(about(one, "It leaks.")) for one in (first, on)] == [1, 1]


async def test_a_test_that_was_in_hand_ends_with_the_station(tmp_path: Path, world: World):
    async with web_service("hang") as service:
        async with notice_station(tmp_path, world) as here:
            await here.person("ann")
            contact = await here.contact("ann", service.url)
            test = asyncio.create_task(here.notices.deliveries.test(contact))
            await service.until_called()
            here.notices.deliveries._settle = lambda *_: asyncio.Event().wait()
        test.cancel()
        async with notice_station(tmp_path, world) as here:
            (told,) = await here.told()
        assert (told["state"], told["unanswered"]) == ("given_up", 1)
        assert told["reply"] == "The station stopped before the answer came."
