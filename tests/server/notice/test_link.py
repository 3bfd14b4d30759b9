"""Links that acknowledge: once, by a button, only what was told; hostile ones do nothing."""

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from urllib.parse import urlsplit

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy.orm import Session

from db.query.station.events import events_after
from db.query.station.people import change_person
from robot_link.clock import SystemClock
from server.notice.link import link_word, read_word
from tests.server.conftest import application, until
from tests.server.notice.conftest import NoticeStation
from tests.server.notice.receiver import WebService, web_service

KEY = bytes(range(32))


@asynccontextmanager
async def stranger() -> AsyncIterator[httpx.AsyncClient]:
    """Somebody who is not signed in, as a phone or a mail filter is."""
    transport = httpx.ASGITransport(application(), raise_app_exceptions=False)
    async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8000") as client:
        yield client


async def link_of(service: WebService, number: int = 1) -> str:
    taken = (await service.until_taken(number))[number - 1]
    found = re.search(r"http://127\.0\.0\.1:8000/ack/\S+", taken.json["message"])
    assert found is not None
    return urlsplit(found[0]).path


async def told_link(here: NoticeStation, service: WebService) -> str:
    await here.contact("ann", service.url)
    await here.alarms.raise_("leak", "Leak <script>.", level="critical")
    return await link_of(service)


def leak(here: NoticeStation):
    return next(alarm for alarm in here.alarms.open if alarm.cause == "leak")


async def test_the_button_acknowledges_once_in_the_name_of_who_was_told(here: NoticeStation):
    async with web_service() as service, stranger() as phone:
        path = await told_link(here, service)
        page = await phone.get(path)
        assert page.status_code == 200
        assert "Acknowledge this alarm as ann" in page.text
        assert "Leak &lt;script&gt;." in page.text
        done = await phone.post(path)
        assert "Acknowledged by ann" in done.text
        assert (leak(here).state, leak(here).acknowledged_by) == ("acknowledged", "ann")
        again = await phone.post(path)
        assert (again.status_code, "used already" in again.text) == (410, True)
        assert "used already" in (await phone.get(path)).text
    events = await here.foundation.store.query(lambda session: events_after(session, 0))
    used = next(event for event in events if event.kind == "notice.link_used")
    assert (used.by, used.by_kind) == ("ann", "person")


async def test_scanners_that_open_links_acknowledge_nothing(here: NoticeStation):
    async with web_service() as service, stranger() as scanner:
        path = await told_link(here, service)
        for method in ("GET", "HEAD", "OPTIONS", "PUT", "DELETE", "PATCH"):
            for _ in range(3):
                await scanner.request(method, path)
        await scanner.get(path, headers={"X-HTTP-Method-Override": "POST"})
        assert leak(here).state == "unacknowledged"
        assert "Acknowledged by ann" in (await scanner.post(path)).text


async def test_the_page_lets_nobody_frame_or_script_it_or_learn_its_address(here: NoticeStation):
    async with web_service() as service, stranger() as phone:
        page = await phone.get(await told_link(here, service))
        policy = page.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy
        assert page.headers["referrer-policy"] == "no-referrer"
        assert page.headers["cache-control"] == "no-store"
        assert "<script" not in page.text
        assert (await phone.get("/ack/style.css")).headers["content-type"].startswith("text/css")


async def test_a_forged_or_cut_link_is_told_so_and_does_nothing(here: NoticeStation):
    async with web_service() as service, stranger() as phone:
        path = await told_link(here, service)
        number, moment, signature = path.removeprefix("/ack/").split(".")
        forged = [
            f"{number}.{moment}.{'A' * len(signature)}",
            f"{number}.{int(moment) + 1}.{signature}",
            f"{int(number) + 1}.{moment}.{signature}",
            f"{number}.{moment}.{signature[:-1]}",
            f"{number}.{moment}",
            "x",
            f"{'9' * 400}.1.x",
            "%F0%9F%90%9F.1.x",
        ]
        for word in forged:
            answer = await phone.post(f"/ack/{word}")
            assert (answer.status_code, "not one that this station wrote" in answer.text) == (
                410,
                True,
            ), word
        assert leak(here).state == "unacknowledged"


async def test_an_expired_link_is_told_so_by_the_stations_clock(
    here: NoticeStation, monkeypatch: pytest.MonkeyPatch
):
    async with web_service() as service, stranger() as phone:
        path = await told_link(here, service)
        now = SystemClock().now()
        monkeypatch.setattr(SystemClock, "now", lambda _: now + timedelta(hours=25))
        answer = await phone.post(path, headers={"Date": "Mon, 01 Jan 2001 00:00:00 GMT"})
        assert (answer.status_code, "has expired" in answer.text) == (410, True)
        assert leak(here).state == "unacknowledged"


async def test_a_link_acknowledges_only_what_was_seen(here: NoticeStation):
    async with web_service() as service, stranger() as phone:
        path = await told_link(here, service)
        await here.alarms.clear("leak")
        await here.alarms.raise_("leak", "Leak.", level="critical")  # raised anew, unseen
        page = await phone.get(path)
        assert "changed since this message" in page.text
        assert "<button" not in page.text
        await phone.post(path)
        assert leak(here).state == "unacknowledged"


async def test_a_link_leaves_other_causes_alone(here: NoticeStation):
    async with web_service() as service, stranger() as phone:
        path = await told_link(here, service)
        await here.alarms.raise_("fire", "Fire.", level="critical")
        await phone.post(path)
        assert {alarm.cause for alarm in here.alarms.open if alarm.state == "unacknowledged"} == {
            "fire"
        }


async def test_a_digest_is_acknowledged_as_far_as_it_named_alarms(here: NoticeStation):
    async with web_service() as service, stranger() as phone:
        await here.contact("ann", service.url)
        await asyncio.gather(
            *(
                here.alarms.raise_(f"cause {number}", f"Cause {number}.", level="warning")
                for number in range(13)
            )
        )
        path = await link_of(service)
        page = await phone.get(path)
        named = page.text.count("<li>")
        assert named > 1
        await phone.post(path)
        assert await until(
            lambda: sum(one.state == "acknowledged" for one in here.alarms.open) == named
        )


async def test_who_may_not_acknowledge_any_more_cannot_by_an_old_link(here: NoticeStation):
    async with web_service() as service, stranger() as phone:
        path = await told_link(here, service)

        def disable(session: Session) -> None:
            change_person(session, "ann", disabled=True, at=here.foundation.clock.now())

        await here.foundation.store.write(disable)
        answer = await phone.post(path)
        assert (answer.status_code, "may not acknowledge" in answer.text) == (410, True)
        assert leak(here).state == "unacknowledged"


async def test_the_word_of_a_link_is_kept_nowhere(here: NoticeStation):
    async with web_service() as service:
        path = await told_link(here, service)
        signature = path.rpartition(".")[2].encode()
        await until(lambda: here.told_states(["handed"]))
        folder = here.foundation.settings.data_dir
        for file in folder.rglob("*"):
            if file.is_file():
                assert signature not in file.read_bytes(), file
        address = service.url.encode()
        kept = [file for file in folder.rglob("*") if file.is_file()]
        holding = [file for file in kept if address in file.read_bytes()]
        assert {file.parent.name for file in holding} == {"secret"}


@given(st.text(max_size=100))
def test_no_text_is_a_word_that_was_not_signed(text: str):
    assert read_word(KEY, text) is None


@given(st.integers(1, 10**9), st.integers(1, 4 * 10**9))
def test_a_signed_word_says_its_notice_and_when_it_expires(number: int, moment_s: int):
    expires_at = datetime.fromtimestamp(moment_s, UTC)
    word = link_word(KEY, f"notice-{number}", expires_at)
    assert read_word(KEY, word) == (f"notice-{number}", expires_at)
    assert read_word(bytes(32), word) is None
