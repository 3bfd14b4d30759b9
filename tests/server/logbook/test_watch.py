"""Shifts and signed pages: what was signed stays, and what was changed all the same shows."""

import asyncio
import json
import sqlite3
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from db.deployment_span import Period
from db.query.log_book.check import complaints
from db.query.log_book.pages import get_page
from db.query.log_book.shifts import begin_shift, end_shift, shifts_in
from server.access.role import Role
from server.checklist.checklists import ListStanding
from server.checklist.delivered import DELIVERED
from server.checklist.templates import KnownTemplate
from server.logbook.handover import RobotStandView, not_looked_at, overdue_robots
from server.logbook.page import page_view
from server.logbook.span import last_two_shifts, my_shift
from tests.server.checklist.begun import begin, tick
from tests.server.cli.test_cli import grace
from tests.server.conftest import DATABASE, MINI
from tests.server.logbook.conftest import browser
from tests.server.logbook.test_entries import read, texts, write

CALM = {"wind_m_s": 3.5, "wind_from_deg": 270, "wave_height_m": 0.2, "sky": "clear"}


async def seen(client):
    answer = await client.get("/api/logbook/handover")
    assert answer.status_code == 200, answer.text
    return answer.json()


async def sign(client, **more):
    body = {"seen": (await seen(client))["seen"], "weather": CALM} | more
    return await client.post("/api/logbook/pages", json=body)


async def signed(client, **more):
    answer = await sign(client, **more)
    assert answer.status_code == 201, answer.text
    return answer.json()


async def take(client, page):
    path = f"/api/logbook/pages/{page['id']}/take"
    return await client.post(path, json={"sha256": page["sha256"]})


async def test_a_watch_is_handed_over_and_its_hours_are_told(ann, ben, station):
    assert (await ann.post("/api/logbook/shifts")).status_code == 201
    assert (await ann.post("/api/logbook/shifts")).status_code == 409
    await station.foundation.alarms.raise_("leak", "mini-1 leaks.", level="critical", robot=MINI)
    await write(ann, "Ballast **set**.", robot=MINI)
    page = await signed(ann, remarks="Watch the *leak*.")
    content = page["content"]
    assert page["left_by"] == "ann"
    assert [one["text"] for one in content["entries"]] == ["Ballast **set**."]
    assert [one["text"] for one in content["standing"]["alarms"]] == ["mini-1 leaks."]
    assert {one["robot"] for one in content["standing"]["robots"]} == {"mini-1", "grace-1"}
    assert [one["person"] for one in content["people"]] == ["ann"]
    assert content["remarks_html"] == "<p>Watch the <em>leak</em>.</p>\n"
    assert content["weather"] == CALM | {"note": ""}
    (shift,) = (await ann.get("/api/logbook/shifts")).json()
    assert shift["ended_at"] is not None
    taken = await take(ben, page)
    assert (taken.status_code, taken.json()["taken_by"]) == (200, "ben")
    assert taken.json()["content"] == content
    (running,) = [
        one for one in (await ben.get("/api/logbook/shifts")).json() if not one["ended_at"]
    ]
    assert running["person"] == "ben"
    following = await seen(ben)
    assert (following["entries"], following["previous"]) == ([], page["id"])
    assert following["began_at"] == page["ended_at"]


async def test_an_entry_of_a_signed_page_is_corrected_and_never_changed(ann, ben):
    entry = await write(ann, "Depth 12 m.")
    page = await signed(ann)
    path = f"/api/logbook/entries/{entry['id']}"
    for client in (ann, ben):
        changed = await client.patch(path, json={"version": 1, "text": "Depth 21 m."})
        struck = await client.delete(path, params={"version": 1})
        for refused in (changed, struck):
            assert refused.status_code == 409
            assert page["id"] in refused.json()["detail"]
            assert "corrects it" in refused.json()["detail"]
    right = await write(ben, "Depth 21 m.", corrects=entry["id"])
    told = (await ann.get(path)).json()
    assert (told["entry"]["corrected_by"], len(told["versions"])) == ([right["id"]], 1)
    assert (await ann.get(f"/api/logbook/pages/{page['id']}")).json()["content"] == page["content"]
    for method in ("PUT", "PATCH", "DELETE", "POST"):
        answer = await ann.request(method, f"/api/logbook/pages/{page['id']}", json={})
        assert answer.status_code == 405


async def test_what_changed_since_it_was_looked_at_is_not_signed(ann, ben):
    before = (await seen(ann))["seen"]
    await write(ben, "A late word.")
    refused = await ann.post("/api/logbook/pages", json={"seen": before, "weather": {}})
    assert (refused.status_code, "look again" in refused.json()["detail"]) == (409, True)
    assert (await ann.get("/api/logbook/pages")).json() == []


async def test_of_two_who_sign_at_once_one_does(ann, ben):
    await write(ann, "One word.")
    body = {"seen": (await seen(ann))["seen"], "weather": CALM}
    answers = await asyncio.gather(
        *(client.post("/api/logbook/pages", json=body) for client in (ann, ben))
    )
    assert sorted(one.status_code for one in answers) == [201, 409]
    (page,) = (await ann.get("/api/logbook/pages")).json()

    async def cy_takes(client):
        return (await take(client, page)).status_code

    other = ben if page["left_by"] == "ann" else ann
    assert sorted(await asyncio.gather(cy_takes(other), cy_takes(other))) == [200, 409]


async def test_who_may_not_sign_is_told_why(ann, ben, client, station):
    page = await signed(ann)
    assert "somebody else" in (await take(ann, page)).json()["detail"]
    wrong = await ben.post(f"/api/logbook/pages/{page['id']}/take", json={"sha256": "0" * 64})
    assert (wrong.status_code, "read it again" in wrong.json()["detail"]) == (409, True)
    script = await client.post(
        "/api/logbook/pages", json={"seen": (await seen(client))["seen"], "weather": {}}
    )
    assert (script.status_code, "script" in script.json()["detail"]) == (403, True)
    assert (await take(client, page)).status_code == 403
    assert (await client.post("/api/logbook/shifts")).status_code == 403
    async with browser(station, "cy", Role.VIEWER) as viewer:
        assert (await sign(viewer)).status_code == 403
        assert (await take(viewer, page)).status_code == 403
        assert (await viewer.get(f"/api/logbook/pages/{page['id']}")).status_code == 200
    assert (await take(ben, page)).status_code == 200
    again = await take(ben, page)
    assert (again.status_code, "took page-1 over" in again.json()["detail"]) == (409, True)


@pytest.mark.parametrize(
    ("weather", "field"),
    [
        ({"wind_m_s": -1}, "wind_m_s"),
        ({"wind_from_deg": 361}, "wind_from_deg"),
        ({"wave_height_m": 40}, "wave_height_m"),
        ({"sky": "green"}, "sky"),
        ({"moon": "full"}, "moon"),
    ],
)
async def test_what_is_wrong_with_the_weather_is_named(ann, weather, field):
    answer = await sign(ann, weather=weather)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["loc"] == ["weather", field]


async def test_my_shift_and_the_last_two_are_found_at_their_borders(
    ann, ben, station, still, monkeypatch
):
    now = [still - timedelta(hours=20)]
    monkeypatch.setattr(type(station.foundation.clock), "now", lambda _: now[0])

    def at(hours):
        now[0] = still - timedelta(hours=hours)

    at(18)
    await ann.post("/api/logbook/shifts")
    await write(ann, "first shift begins")
    at(10)
    await signed(ann)
    await ben.post("/api/logbook/shifts")
    await write(ben, "second shift begins")
    now[0] = still - timedelta(hours=2, microseconds=1)
    await write(ben, "second shift ends")
    at(2)
    await signed(ben)
    await write(ben, "after it")
    await ann.post("/api/logbook/shifts")
    at(0)
    await write(ann, "third shift")
    entries = {"group": "entries"}
    mine = await read(ben, shift="mine", **entries)
    assert texts(mine) == ["second shift ends", "second shift begins"]
    assert datetime.fromisoformat(mine["since"]) == still - timedelta(hours=10)
    assert texts(await read(ann, shift="mine", **entries)) == ["third shift", "after it"]
    two = texts(await read(ann, shift="two", **entries))
    assert two == ["third shift", "after it", "second shift ends", "second shift begins"]


def test_a_shift_over_the_end_of_summer_time_has_its_true_hours(memory):
    begun = datetime.fromisoformat("2026-10-25T00:30:00+02:00")
    ended = datetime.fromisoformat("2026-10-25T03:30:00+01:00")

    def keep(session):
        begin_shift(session, "dee", begun)
        end_shift(session, "dee", ended)

    memory.change(keep).result()
    with memory.read() as session:
        (shift,) = shifts_in(session, Period(begun, ended))
        assert shift.hours_in(begun, ended) == 4.0
        mine = my_shift(session, "dee")
        assert (mine.first, mine.last) == (begun, ended - timedelta(microseconds=1))
        assert my_shift(session, "nobody") is None
        assert last_two_shifts(session).first == begun


async def test_who_had_no_shift_is_told_so(ann):
    answer = await ann.get("/api/logbook", params={"shift": "mine"})
    assert (answer.status_code, "ann has not begun" in answer.json()["detail"]) == (409, True)
    assert (await ann.get("/api/logbook", params={"shift": "two"})).status_code == 409


async def tampered(tmp_path, station, statement):
    """Change the database behind the station's back, and return what is wrong with it then."""
    with closing(sqlite3.connect(tmp_path / DATABASE, timeout=30)) as database, database:
        assert database.execute(statement).rowcount == 1
    with station.foundation.store.read() as session:
        return complaints(session)


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("UPDATE log_entry_version SET text = 'Depth 21 m.'", "entry-1, version 1, is not"),
        ("UPDATE log_entry_version SET at = at + 1", "entry-1, version 1, is not"),
        ("UPDATE log_entry_version SET written_by = 'ben'", "entry-1, version 1, is not"),
        ("UPDATE log_entry_version SET is_struck = 1", "entry-1, version 1, is not"),
        ("UPDATE log_entry SET written_by = 'ben'", "another author"),
        ("UPDATE log_entry SET page_key = NULL", "page-1 has other entries"),
        ("DELETE FROM log_entry", "entry-1, version 1, is missing"),
        ("UPDATE shift_page SET content = replace(content, '12', '21')", "page-1 is not what"),
        ("UPDATE shift_page SET left_by = 'ben'", "page-1 is not what"),
        ("UPDATE shift_page SET sha256 = 'x'", "page-1 is not what"),
        ("UPDATE shift_page SET taken_by = 'cy'", "page-1 tells of another"),
        ("DELETE FROM shift_page", "page-1 is missing"),
    ],
)
async def test_what_is_changed_by_plain_sql_shows(ann, ben, tmp_path, station, statement, words):
    await write(ann, "Depth 12 m.")
    page = await signed(ann)
    assert (await take(ben, page)).status_code == 200
    with station.foundation.store.read() as session:
        assert complaints(session) == []
    wrong = await tampered(tmp_path, station, statement)
    assert any(words in one for one in wrong), wrong


async def test_grace_audit_verify_looks_at_the_log_book(ann, tmp_path, station, capsys):
    await write(ann, "Depth 12 m.")
    await signed(ann)
    assert await asyncio.to_thread(grace, "audit", "verify", "--data", tmp_path) == 0
    assert "1 versions of entries, 1 signed pages" in capsys.readouterr().out
    await tampered(tmp_path, station, "UPDATE shift_page SET content = '{}'")
    assert await asyncio.to_thread(grace, "audit", "verify", "--data", tmp_path) == 1
    assert "page-1 is not what was signed" in capsys.readouterr().out


async def test_the_hash_of_a_page_is_that_of_what_is_kept(ann, tmp_path):
    page = await signed(ann)
    (event,) = (await ann.get("/api/events", params={"kind": "page.signed"})).json()["events"]
    assert event["data"] == {"page": page["id"], "sha256": page["sha256"], "by": "ann"}
    assert event["by"] == "ann"
    with closing(sqlite3.connect(tmp_path / DATABASE)) as database:
        (content,) = database.execute("SELECT content FROM shift_page").fetchone()
    assert json.loads(content)["weather"]["wind_m_s"] == 3.5


async def test_a_hand_over_tells_open_checklists_what_is_overdue_and_asks_to_look_again(
    ann, client
):
    before = await seen(ann)
    assert before["standing"]["checklists"] == []
    assert before["standing"]["overdue"] == [], "both are in the water for less than a day"
    run = await begin(client)
    await begin(client, "daily")
    for item in ("trim", "surface", "tank"):
        await tick(client, run["id"], item)
    told = await seen(ann)
    (tank,) = [one for one in told["standing"]["checklists"] if one["id"] == run["id"]]
    assert (tank["robot"], tank["title"]) == (MINI, "Pre-dive, tank")
    assert [one["key"] for one in tank["items"] if one["is_manual"]] == ["hull", "hook"]
    blocking = [one["is_blocking"] for one in tank["items"]]
    assert blocking == sorted(blocking, reverse=True), "what blocks comes first"
    assert told["standing"]["overdue"] == []
    await tick(client, run["id"], "hull")
    again = await ann.post("/api/logbook/pages", json={"seen": told["seen"], "weather": CALM})
    assert (again.status_code, "look again" in again.json()["detail"]) == (409, True)
    page = await signed(ann)
    (kept,) = [one for one in page["content"]["standing"]["checklists"] if one["id"] == run["id"]]
    assert [one["key"] for one in kept["items"] if one["is_manual"]] == ["hook"]
    html = (await ann.get("/api/logbook/report")).text
    assert "Open checklists" in html
    assert "A hook or a line is at hand" in html


async def test_a_hand_over_tells_who_looks_after_an_alarm(ann, station):
    board = station.foundation.alarms
    leak = await board.raise_("leak", "mini-1 leaks.", level="critical", robot=MINI)
    told = await seen(ann)
    await board.assign(leak.id, "ann", "ben", "You know this pump.")
    again = await ann.post("/api/logbook/pages", json={"seen": told["seen"], "weather": CALM})
    assert (again.status_code, "look again" in again.json()["detail"]) == (409, True)
    page = await signed(ann)
    (alarm,) = page["content"]["standing"]["alarms"]
    assert alarm["assigned_to"] == "ben"
    assert "ben looks after it" in (await ann.get("/api/logbook/report")).text
    kept = await station.foundation.store.query(lambda session: get_page(session, page["id"]))
    document = kept.document
    del document["standing"]["alarms"][0]["assigned_to"]  # as pages were before
    earlier = page_view(replace(kept, content=json.dumps(document)))
    assert earlier.content.standing.alarms[0].assigned_to is None


async def test_a_page_signed_before_pages_told_of_checklists_is_read_as_it_was(ann, station):
    page = await signed(ann)
    kept = await station.foundation.store.query(lambda session: get_page(session, page["id"]))
    document = kept.document
    for later in ("checklists", "overdue"):
        del document["standing"][later]
    document["standing"]["robots"][0]["is_overdue"] = True
    told = page_view(replace(kept, content=json.dumps(document))).content.standing
    assert told.checklists is None
    assert [(one.robot, one.kind) for one in told.overdue] == [
        (document["standing"]["robots"][0]["robot"], "contact")
    ]


def test_a_robot_is_overdue_that_was_to_be_heard_or_to_be_recovered_by_now():
    now = datetime(2026, 11, 28, 4, 31, tzinfo=UTC)
    quiet = RobotStandView(
        robot="g1", name="Grace 1", deployment="deployment-1", activity="", in_charge="",
        is_overdue=False, next_contact="", battery=None, battery_at=None, recover_by=None,
    )  # fmt: skip
    spent = replace(quiet, robot="g2", name="Grace 2", recover_by=now - timedelta(hours=2))
    silent = replace(quiet, robot="g3", is_overdue=True, recover_by=now + timedelta(hours=2))
    ashore = replace(spent, robot="g4", deployment=None)
    late = {"g3": "g3 has not called."}
    found = list(overdue_robots([quiet, spent, silent, ashore], late, now))
    assert [(one.robot, one.kind, one.text) for one in found] == [
        ("g2", "recovery", "Grace 2 was to be recovered by 2026-11-28 02:31Z."),
        ("g3", "contact", "g3 has not called."),
    ]


def test_a_daily_list_is_overdue_after_its_time_in_the_water_and_not_before():
    now = datetime(2026, 11, 28, 4, 31, tzinfo=UTC)
    (key,) = [key for key, one in DELIVERED.items() if one.act == "daily"]
    template = DELIVERED[key]
    standing = ListStanding(KnownTemplate(key, template, 0, "delivered"), None, [])
    began_at = {
        "old": now - timedelta(hours=template.valid_h, minutes=1),
        "young": now - timedelta(hours=template.valid_h, minutes=-1),
    }
    names = {"old": "Grace 1", "young": "Grace 2"}
    lists = [("old", standing), ("young", standing), ("ashore", standing)]
    (found,) = not_looked_at(began_at, names, lists, now)
    assert (found.robot, found.kind) == ("old", "daily")
    assert found.text == f"{template.title} of Grace 1: nobody began it within the last 24 h."
