"""Entries of the log book: only ever added to, found again, and interleaved with what happened."""

import csv
import io
import signal
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from db.query.log_book.entries import LogFilter, Place, newest_entries
from db.store import Store
from server.access.role import Role
from server.logbook.question import place_text
from tests.server.conftest import DATABASE, GRACE, MINI, api_client, until


async def write(client, text, **more):
    answer = await client.post("/api/logbook/entries", json={"text": text, **more})
    assert answer.status_code == 201, answer.text
    return answer.json()


async def read(client, **query):
    answer = await client.get("/api/logbook", params=query)
    assert answer.status_code == 200, answer.text
    return answer.json()


def texts(part):
    return [one["entry"]["newest"]["text"] for one in part["items"] if one["entry"]]


async def test_an_entry_tells_who_wrote_it_when_about_which_moment(client, still):
    at = (still - timedelta(minutes=3)).isoformat()
    entry = await write(client, "Oil on the *water*.", robot=MINI, at=at, tags=["Water", "water"])
    newest = entry["newest"]
    assert entry["written_by"] == "test admin"
    assert (datetime.fromisoformat(newest["at"]), newest["robot"]) == (
        datetime.fromisoformat(at),
        MINI,
    )
    assert datetime.fromisoformat(newest["written_at"]) == still
    assert newest["tags"] == ["water"]
    assert newest["html"] == "<p>Oil on the <em>water</em>.</p>\n"
    assert newest["deployment"] == "deployment-1"
    elsewhere = await write(client, "Tea.")
    assert (elsewhere["newest"]["robot"], elsewhere["newest"]["deployment"]) == (None, None)


async def test_an_edit_adds_a_version_and_an_outdated_one_is_refused(client):
    entry = await write(client, "It leaks.")
    path = f"/api/logbook/entries/{entry['id']}"
    changed = await client.patch(path, json={"version": 1, "text": "It drips."})
    assert changed.status_code == 200, changed.text
    assert (changed.json()["newest"]["number"], changed.json()["newest"]["text"]) == (
        2,
        "It drips.",
    )
    late = await client.patch(path, json={"version": 1, "text": "It pours."})
    assert (late.status_code, "changed" in late.json()["detail"]) == (409, True)
    told = (await client.get(path)).json()
    assert [one["text"] for one in told["versions"]] == ["It leaks.", "It drips."]


async def test_a_deleted_entry_stays_struck_out_with_who_and_when(client):
    entry = await write(client, "Wrong boat.")
    path = f"/api/logbook/entries/{entry['id']}"
    struck = (await client.delete(path, params={"version": 1})).json()["newest"]
    assert (struck["is_struck"], struck["text"]) == (True, "Wrong boat.")
    assert struck["written_by"] == "test admin"
    (shown,) = [one["entry"] for one in (await read(client))["items"] if one["entry"]]
    assert shown["newest"]["is_struck"]
    again = await client.patch(path, json={"version": 2, "text": "Right boat."})
    assert (again.status_code, "struck" in again.json()["detail"]) == (409, True)
    assert (await client.delete(path, params={"version": 2})).status_code == 409


async def test_a_correction_and_what_it_corrects_know_of_each_other(client):
    wrong = await write(client, "Depth 12 m.")
    right = await write(client, "Depth 21 m.", corrects=wrong["id"])
    assert right["corrects"] == wrong["id"]
    told = (await client.get(f"/api/logbook/entries/{wrong['id']}")).json()
    assert told["entry"]["corrected_by"] == [right["id"]]
    body = {"text": "?", "corrects": "entry-99"}
    assert (await client.post("/api/logbook/entries", json=body)).status_code == 404


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"text": " \n"}, "text"),
        ({"text": "x" * 20_001}, "text"),
        ({"text": "a\u202eb"}, "text"),
        ({"text": "a\x00b"}, "text"),
        ({"text": "a", "tags": ["a,b"]}, "tags"),
        ({"text": "a", "tags": [str(n) for n in range(13)]}, "tags"),
        ({"text": "a", "at": "2026-01-01T00:00:00"}, "at"),
        ({"text": "a", "at": "2099-01-01T00:00:00Z"}, "at"),
        ({"text": "a", "attachments": [{"sha256": "0" * 64, "name": "x"}]}, "attachments"),
        ({"text": "a", "attachments": [{"sha256": "../secret", "name": "x"}]}, "attachments"),
    ],
)
async def test_what_is_wrong_with_an_entry_is_named(client, body, field):
    answer = await client.post("/api/logbook/entries", json=body)
    assert answer.status_code == 422, answer.text
    assert answer.json()["errors"][0]["loc"][0] == field
    assert texts(await read(client)) == []


async def test_who_may_only_look_reads_and_does_not_write(client, station):
    entry = await write(client, "Seen.")
    async with api_client(station, Role.VIEWER) as viewer:
        assert texts(await read(viewer)) == ["Seen."]
        body = {"text": "Mine."}
        assert (await viewer.post("/api/logbook/entries", json=body)).status_code == 403
        path = f"/api/logbook/entries/{entry['id']}"
        assert (await viewer.delete(path, params={"version": 1})).status_code == 403


async def test_orders_stand_between_what_people_write(client):
    await write(client, "Before.")
    answer = await client.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"})
    assert answer.status_code == 202
    await write(client, "After.")
    items = (await read(client, group=["entries", "orders"]))["items"]
    told = [one["group"] if one["event"] else one["entry"]["newest"]["text"] for one in items]
    assert [one for one in told if one in ("Before.", "After.", "orders")] == told
    assert told.index("After.") < told.index("orders") < told.index("Before.")
    assert (await read(client, group="orders", robot=GRACE))["items"] == []
    (ordered,) = [
        one["event"] for one in items if one["event"] and one["event"]["kind"] == "command.surface"
    ]
    assert ordered["by"] == "test admin"


async def test_it_is_found_by_robot_person_tag_and_words(client, station):
    await write(client, "Ballast 12 g.", robot=MINI, tags=["ballast"])
    await write(client, "100% sure_ly", robot=GRACE, tags=["trim"])
    async with api_client(station, Role.PILOT) as pilot:
        await write(pilot, "Wind from the BALLAST side.")
    ask = {"group": "entries"}
    assert texts(await read(client, **ask, robot=MINI)) == ["Ballast 12 g."]
    assert texts(await read(client, **ask, tag="trim")) == ["100% sure_ly"]
    assert texts(await read(client, **ask, author="test pilot")) == ["Wind from the BALLAST side."]
    assert len(texts(await read(client, **ask, text="ballast"))) == 2
    assert texts(await read(client, **ask, text="100%_")) == []
    assert texts(await read(client, **ask, deployment="deployment-1")) == ["Ballast 12 g."]
    words = (await client.get("/api/logbook/words")).json()
    assert words == {"authors": ["test admin", "test pilot"], "tags": ["ballast", "trim"]}
    assert (await client.get("/api/logbook", params={"robot": "nobody"})).status_code == 404


async def test_pages_of_the_list_join_even_where_all_are_of_one_moment(client, still):
    at = (still - timedelta(minutes=5)).isoformat()
    for number in range(7):
        await write(client, str(number), at=at)
    found, before = [], {}
    while True:
        part = await read(client, group="entries", limit=3, **before)
        found += texts(part)
        if not part["has_more"]:
            break
        before = {"before": part["items"][-1]["place"]}
    assert found == ["6", "5", "4", "3", "2", "1", "0"]
    foreign = place_text(Place(datetime(1970, 1, 2, tzinfo=UTC), 1, 1))
    assert texts(await read(client, before=foreign)) == []
    far = {"before": "9999999999999999.1.1"}
    assert (await client.get("/api/logbook", params=far)).status_code in (200, 422)


async def test_the_live_stream_tells_of_a_new_entry(client, station):
    def revision():
        parts = station.feed._parts["changed"]
        return parts["logbook"].changed if "logbook" in parts else 0

    before = revision()
    await write(client, "Hello.")
    await until(lambda: revision() > before)


async def test_it_is_taken_away_as_json_and_csv(client):
    await write(client, "=1+1", tags=["one", "two"])
    await write(client, 'Two "lines"\nof text.')
    query = {"group": "entries"}
    listed = (await client.get("/api/logbook/export", params=query)).json()
    assert [one["text"] for one in listed] == ['Two "lines"\nof text.', "=1+1"]
    answer = await client.get("/api/logbook/export", params=query | {"format": "csv"})
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert [row["text"] for row in rows] == ['Two "lines"\nof text.', "'=1+1"]
    assert rows[1]["tags"] == "one two"


KILLED = """
import asyncio, os, signal, sys
from pathlib import Path
from server.base.settings import Settings
from server.logbook.log_book import LogBook
from server.logbook.view import EntryText
from server.station import run_station
from tests.server.station_app import NoService

async def main():
    settings = Settings(data_dir=Path(sys.argv[1]), simulation=True, worker_processes=1)
    async with run_station(settings, NoService) as running:
        book = LogBook(running.foundation)
        await book.write(EntryText(text="Kept."), by="ann")
        os.kill(os.getpid(), signal.SIGKILL)

asyncio.run(main())
"""


def test_an_entry_that_was_answered_outlives_sigkill(tmp_path):
    ended = subprocess.run(
        [sys.executable, "-c", KILLED, str(tmp_path)],
        check=False,
        timeout=100,
        cwd=Path(__file__).parents[3],
    )
    assert ended.returncode == -signal.SIGKILL
    store = Store.open(f"sqlite:///{tmp_path / DATABASE}")
    with store.read() as session:
        assert [one.newest.text for one in newest_entries(session, LogFilter(), 9)] == ["Kept."]
    store.close()
