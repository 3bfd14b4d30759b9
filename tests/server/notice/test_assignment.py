"""Alarms that a person is asked to look after: that person is told, once, and nobody else."""

from datetime import timedelta
from pathlib import Path

import httpx
import pytest

from server.access import register
from server.access.role import Role
from tests.server.conftest import GRACE, MINI, until
from tests.server.fake_link import World
from tests.server.notice.conftest import NoticeStation, move, notice_station, words
from tests.server.notice.receiver import web_service
from tests.server.station_app import bearer, token_of

NOTHING = dict.fromkeys(("alarm", "contact", "battery", "station"), "none")
"""Who wants to hear of no alarm."""


async def assign(here: NoticeStation, alarm: str, person: str | None, note: str = ""):
    body = {"person": person, "note": note}
    return await here.client.post(f"/api/alarms/{alarm}/assign", json=body)


async def assigned(here: NoticeStation, alarm: str, person: str | None, note: str = ""):
    answer = await assign(here, alarm, person, note)
    assert answer.status_code == 200, answer.text
    return answer.json()


async def raised(here: NoticeStation, robot: str | None = MINI, level: str = "warning"):
    """Raise an alarm of which nobody wants to hear."""
    for name in ("ann", "ben"):
        await here.wish(name, alarms=NOTHING)
    return (await here.alarms.raise_("leak", "It leaks.", level=level, robot=robot)).id


async def test_a_notice_goes_to_who_is_asked_and_to_nobody_else(here: NoticeStation):
    async with web_service() as of_ann, web_service() as of_ben:
        await here.contact("ann", of_ann.url)
        await here.contact("ben", of_ben.url)
        alarm = await raised(here)
        view = await assigned(here, alarm, "ben", "You know this pump.")
        by = view["assigned_by"]
        assert (view["assigned_to"], view["note"]) == ("ben", "You know this pump.")
        (taken,) = await of_ben.until_taken()
        asked = f"{by} asks ben to look after {alarm} (You know this pump.): It leaks."
        assert asked in words(taken)
        assert taken.json["title"].startswith("SIMULATION Assigned: ")
        await assigned(here, alarm, "ann")
        await of_ann.until_taken()
        told = [(one["person"], one["topic"]) for one in await here.told()]
        assert sorted(told) == [("ann", "assigned"), ("ben", "assigned")]
    assert (len(of_ann.taken), len(of_ben.taken)) == (1, 1)


async def test_an_assignment_is_an_event_with_author_and_note(here: NoticeStation):
    alarm = await raised(here)
    by = (await assigned(here, alarm, "ben", "Please call the boat."))["assigned_by"]
    nobody = await assigned(here, alarm, None)
    assert (nobody["assigned_to"], nobody["note"]) == (None, "Please call the boat.")
    found = (await here.client.get("/api/events")).json()["events"]
    events = [one for one in found if one["kind"] == "alarm.assigned"]
    texts = {one["text"]: (one["by"], one["data"]["to"]) for one in events}
    assert texts == {
        f"{by} asks ben to look after {alarm} (Please call the boat.): It leaks.": (by, "ben"),
        f"{by} has nobody look after {alarm} any more: It leaks.": (by, None),
    }


async def test_who_takes_an_alarm_is_not_told_so(here: NoticeStation):
    browser = await signed_in(here, "ben")
    async with web_service() as of_ben:
        await here.contact("ben", of_ben.url)
        alarm = await raised(here)
        answer = await browser.post(f"/api/alarms/{alarm}/assign", json={"person": "ben"})
        assert answer.json()["assigned_by"] == "ben", answer.text
        await assigned(here, alarm, "ann")  # and back again, by somebody else
        await assigned(here, alarm, "ben")
        await of_ben.until_taken()
        assert [one["person"] for one in await here.told()] == ["ben"]


async def signed_in(here: NoticeStation, name: str) -> httpx.AsyncClient:
    """Return the client of a person's browser."""
    at = here.foundation.clock.now()
    issued = await here.foundation.store.write(
        lambda session: register.create_sign_in_link(
            session, name, timedelta(hours=1), at=at, by="test"
        )
    )
    app = here.client._transport.app
    browser = httpx.AsyncClient(
        transport=httpx.ASGITransport(app), base_url="http://127.0.0.1:8000"
    )
    opened = await browser.post("/api/session", json={"token": issued.secret})
    assert opened.status_code == 200, opened.text
    browser.headers["X-CSRF-Token"] = opened.json()["csrf_token"]
    return browser


async def test_whoever_may_not_pilot_the_robot_is_refused_by_name(here: NoticeStation):
    await here.person("eve", Role.VIEWER)
    grants = [{"robot": MINI, "role": "pilot"}]
    await here.person("dan", Role.ADMIN)
    patched = await here.client.patch("/api/people/ben", json={"role": "none", "grants": grants})
    assert patched.status_code == 200, patched.text
    mini = await raised(here)
    grace = (await here.alarms.raise_("slow", "Slow.", robot=GRACE)).id
    station = (await here.alarms.raise_("storage", "Full.")).id
    whole = "what belongs to the station as a whole"
    for alarm, person, of in (
        (mini, "eve", MINI),
        (mini, "nobody", MINI),
        (grace, "ben", GRACE),
        (station, "ben", whole),
    ):
        refused = await assign(here, alarm, person)
        assert refused.status_code == 422, refused.text
        (fault,) = refused.json()["errors"]
        assert fault["loc"][-1] == "person"
        assert fault["msg"] == f"{person!r} may not pilot {of}."
    assert (await assigned(here, mini, "ben"))["assigned_to"] == "ben"
    listed = await here.client.get(f"/api/notices/assignees/{grace}")
    assert [one["person"] for one in listed.json()] == ["ann", "dan"]


async def test_a_viewer_assigns_nothing(here: NoticeStation):
    alarm = await raised(here)
    app = here.client._transport.app
    eve = bearer(await token_of(app, Role.VIEWER))
    path = f"/api/alarms/{alarm}/assign"
    refused = await here.client.post(path, json={"person": "ben"}, headers=eve)
    assert refused.status_code == 403
    assert (
        await here.client.get(f"/api/notices/assignees/{alarm}", headers=eve)
    ).status_code == 403
    assert here.alarms.open[0].assigned_to is None


async def test_quiet_hours_hold_it_and_taking_it_back_withdraws_it(
    moving: list[timedelta], here: NoticeStation
):
    async with web_service() as service:
        await here.contact("ben", service.url)
        alarm = await raised(here)
        now = here.foundation.clock.now()
        begin, end = now - timedelta(hours=1), now + timedelta(hours=2)
        quiet = {"begin": f"{begin:%H:%M}", "end": f"{end:%H:%M}"}
        await here.wish("ben", alarms=NOTHING, quiet=quiet)
        listed = (await here.client.get(f"/api/notices/assignees/{alarm}")).json()
        assert {one["person"]: one["told"] for one in listed} == {
            "ann": "no_contact",
            "ben": "later",
        }
        await assigned(here, alarm, "ben", "First.")
        await assigned(here, alarm, None)
        await assigned(here, alarm, "ben", "Second.")
        await move(here, moving, minutes=125)
        (taken,) = await service.until_taken()
    assert "Second." in words(taken)
    assert "First." not in words(taken)


async def test_a_grave_alarm_breaks_through_quiet_hours_as_others_do(here: NoticeStation):
    async with web_service() as service:
        await here.contact("ben", service.url)
        alarm = await raised(here, level="critical")
        await here.wish("ben", alarms=NOTHING, quiet={"begin": "00:00", "end": "23:59"})
        await assigned(here, alarm, "ben")
        await service.until_taken()


async def test_nobody_else_is_called_when_who_was_asked_is_silent(
    moving: list[timedelta], here: NoticeStation
):
    async with web_service() as of_ann, web_service() as of_ben:
        await here.contact("ann", of_ann.url)
        await here.contact("ben", of_ben.url)
        await here.set_up(
            steps=[{"people": ["ann"], "after_minutes": 10}], escalate_from="critical"
        )
        alarm = await raised(here)
        await assigned(here, alarm, "ben")
        await of_ben.until_taken()
        await move(here, moving, minutes=40)
        assert (len(of_ann.taken), len(of_ben.taken)) == (0, 1)


async def test_what_was_assigned_just_before_a_stop_is_told_once_after_it(
    tmp_path: Path, world: World
):
    async with web_service() as service:
        async with notice_station(tmp_path, world) as here:
            for name in ("ann", "ben"):
                await here.person(name)
            await here.contact("ben", service.url)
            alarm = await raised(here, robot=None)
            here.foundation.bus._handlers.clear()  # the station dies before anybody heard
            await assigned(here, alarm, "ben", "Yours.")
        async with notice_station(tmp_path, world) as again:
            (taken,) = await service.until_taken()
            assert "to look after" in words(taken)
            (kept,) = [one for one in again.alarms.open if one.id == alarm]
            assert (kept.assigned_to, kept.note) == ("ben", "Yours.")
            await until(lambda: again.told_states(["handed"]))
        async with notice_station(tmp_path, world) as third:
            third.notices._wakeups.wake()
            await third.alarms.raise_("other", "Other.", level="critical")
            await assigned(third, third.alarms.open[-1].id, "ben")
            await service.until_taken(2)
            texts = [words(one) for one in service.taken]
            assert sum(f"look after {alarm} " in text for text in texts) == 1


@pytest.mark.parametrize("ended", ["closed", "reassigned"])
async def test_one_that_is_over_before_anybody_was_told_is_told_to_nobody(
    tmp_path: Path, world: World, ended: str
):
    async with web_service() as of_ben, web_service() as of_ann:
        async with notice_station(tmp_path, world) as here:
            for name, service in (("ann", of_ann), ("ben", of_ben)):
                await here.person(name)
                await here.contact(name, service.url)
            alarm = await raised(here, robot=None)
            here.foundation.bus._handlers.clear()
            await assigned(here, alarm, "ben")
            if ended == "closed":
                await here.alarms.acknowledge(alarm, "ann")
                await here.alarms.clear("leak")
            else:
                await assigned(here, alarm, "ann")
        async with notice_station(tmp_path, world) as again:
            if ended == "closed":
                alarm = (await again.alarms.raise_("other", "Other.")).id
                await assigned(again, alarm, "ann")
            await of_ann.until_taken()
            assert of_ben.taken == []
