"""Signs of life to who watches the station, and the alarm when they are not heard."""

import pytest

from db.fault import StoreUnavailableError
from server.notice import heartbeat as module
from server.notice.heartbeat import CAUSE, Heartbeat
from tests.server.conftest import until
from tests.server.notice.conftest import NoticeStation
from tests.server.notice.receiver import WebService, web_service


def beating(here: NoticeStation) -> Heartbeat:
    return here.foundation.services.get(Heartbeat)


async def watched_by(here: NoticeStation, service: WebService) -> dict[str, object]:
    answer = await here.client.put("/api/notices/heartbeat", json={"url": service.url})
    assert answer.status_code == 200, answer.text
    return answer.json()["heartbeat"]


def own_alarms(here: NoticeStation):
    return [alarm for alarm in here.alarms.open if alarm.cause == CAUSE]


async def test_a_sign_of_life_leaves_at_once_and_then_every_period(here: NoticeStation):
    async with web_service() as service:
        await here.set_up(heartbeat_minutes=0.1)
        shown = await watched_by(here, service)
        assert (shown["is_heard"], shown["reply"]) == (True, "HTTP 200 OK: thank you")
        assert shown["hint"] == "127.0.0.1"
        await service.until_taken(3)


async def test_a_sign_of_life_leaves_though_the_database_cannot_be_read(
    here: NoticeStation, monkeypatch: pytest.MonkeyPatch
):
    async def failing(function: object) -> None:
        raise StoreUnavailableError("The disk does not answer.")

    async with web_service() as service:
        await watched_by(here, service)
        await service.until_taken(2)
        monkeypatch.setattr(here.foundation.store, "query", failing)
        beating(here).change()
        await service.until_taken(3)


async def test_a_watcher_that_does_not_answer_is_an_alarm_until_it_does(
    here: NoticeStation, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(module, "PATIENCE_S", 0.5)
    async with web_service("hang") as service:
        shown = await watched_by(here, service)
        assert shown["reply"] == "No answer within 0 s."
        await until(lambda: own_alarms(here))
        assert service.url not in own_alarms(here)[0].text
        service.mode = "take"
        monkeypatch.setattr(module, "PATIENCE_S", 60.0)
        assert (await beating(here).beat()).is_heard
        assert all(alarm.cleared_at for alarm in own_alarms(here))


async def test_nobody_watches_once_the_address_is_forgotten(here: NoticeStation):
    async with web_service() as service:
        await watched_by(here, service)
        answer = await here.client.put("/api/notices/heartbeat", json={"url": None})
        assert answer.json()["heartbeat"]["hint"] == ""
        assert await beating(here).beat() is None


@pytest.mark.parametrize("url", ["ftp://example.org", "https://", "nothing", "https://[::1"])
async def test_what_is_no_address_is_refused_by_its_field(here: NoticeStation, url: str):
    answer = await here.client.put("/api/notices/heartbeat", json={"url": url})
    assert (answer.status_code, answer.json()["errors"][0]["loc"]) == (422, ["url"])
    assert "input" not in answer.text
