"""Files of any maker: proposed, confirmed, and kept whole or not at all."""

import asyncio
import copy
import threading
from datetime import datetime
from types import SimpleNamespace

import numpy as np

from db.ingest import append_telemetry
from db.query.fleet.robots import add_robot
from db.query.measured import imported
from server.recording.foreign import folder_of, report_of
from server.recording.keep import Kept
from server.recording_file.conversion import Converted
from tests.db.conftest import robot_record
from tests.server.recording.test_card import by_radio, card_file, measurement
from tests.server.recording.test_import import until_cancelled

BEGIN_S = 1_563_751_502


def table(rows, shift=0.0, broken=()):
    """A table whose columns no station knows: seconds, places, feet, and a probe of its own."""
    lines = ["when;Lat;Lon;Depth (ft);probe 7"]
    for row in rows:
        value = "oops" if row in broken else f"{10.0 + 0.01 * row + shift:.4f}"
        place = f"{48.9 + 1e-4 * row:.4f};{-130.6:.1f}"
        lines.append(f"{BEGIN_S + 30 * row};{place};{10 * (row % 7)};{value}")
    return "\n".join(lines) + "\n"


async def ended(client, answer):
    assert answer.status_code == 202, answer.text
    async with asyncio.timeout(200):
        while True:
            job = (await client.get(f"/api/jobs/{answer.json()['id']}")).json()
            if job["state"] not in {"queued", "running"}:
                return job
            await asyncio.sleep(0.1)


async def sent(client, *files):
    """Return the job that reads some files of an upload."""
    parts = [("files", (name, text)) for name, text in files]
    return await ended(client, await client.post("/api/imports/uploads", files=parts))


def meant(proposal, **unusual):
    """Return the proposed mapping with a person's word on some columns."""
    mapping = copy.deepcopy(proposal["mapping"])
    told = {"when": ("time", "", "s"), "probe 7": ("variable", "temperature", "degC")} | unusual
    for column in mapping["columns"]:
        if column["name"] in told:
            role, target, unit = told[column["name"]]
            column |= {"role": role, "target": target, "unit": unit}
    return mapping | {"is_utc": True}


async def confirmed(client, proposal, **more):
    body = {"robot": "eva", "mapping": meant(proposal), **more}
    return await client.post(f"/api/imports/uploads/{proposal['upload']}", json=body)


def counts(report):
    kinds = ("read", "new", "duplicate", "differs", "faults")
    assert report["read"] == sum(report[kind] for kind in kinds[1:])
    return tuple(report[kind] for kind in kinds)


async def test_a_file_that_waits_for_other_work_says_so(app, pilot):
    places = app.state.foundation.workers._places
    taken = 0
    while not places.locked():
        await places.acquire()
        taken += 1
    answer = await pilot.post("/api/imports/uploads", files={"files": ("a.csv", table(range(9)))})

    async def message():
        job = await pilot.get(f"/api/jobs/{answer.json()['id']}")
        return job.json()["message"]

    async with asyncio.timeout(60):
        while True:
            if await message() == "Waiting for a free process":
                break
            await asyncio.sleep(0.05)
    for _ in range(taken):
        places.release()
    assert (await ended(pilot, answer))["state"] == "done"


async def test_a_table_is_proposed_confirmed_and_every_row_is_told_of(app, pilot):
    proposal = (await sent(pilot, ("odd.csv", table(range(30), broken=(4,)))))["result"]
    roles = {one["name"]: one["role"] for one in proposal["columns"]}
    assert (roles["Lat"], roles["Lon"], roles["Depth (ft)"]) == ("latitude", "longitude", "depth")
    assert roles["probe 7"] == "ignore"
    assert (await pilot.get("/api/deployments")).json()["deployments"] == []
    refused = await ended(pilot, await confirmed(pilot, proposal))
    assert refused["state"] == "failed"
    assert refused["message"].endswith("Nothing was imported.")
    assert "line 6" in refused["result"]["named_faults"][0]["place"]
    assert (await pilot.get("/api/deployments")).json()["deployments"] == []
    job = await ended(pilot, await confirmed(pilot, proposal, policy="skip", template="odd"))
    assert job["state"] == "done", job["message"]
    assert counts(job["result"]) == (30, 29, 0, 0, 1)
    [deployment] = (await pilot.get("/api/deployments")).json()["deployments"]
    assert (deployment["samples"], deployment["variables"]) == (29, ["temperature"])
    assert list(folder_of(app.state.foundation.settings.data_dir).iterdir()) == []

    again = (await sent(pilot, ("odd.csv", table(range(30), broken=(4,)))))["result"]
    assert (again["template"], again["missing"]) == ("odd", [])
    answer = await confirmed(pilot, again, policy="skip")
    assert answer.status_code == 409
    assert answer.json()["detail"].endswith("there already, as deployment-1 of eva.")
    other = (await sent(pilot, ("more.csv", table(range(20, 40)))))["result"]
    job = await ended(pilot, await confirmed(pilot, other))
    assert counts(job["result"]) == (20, 10, 10, 0, 0)
    assert job["result"]["deployment"] == "deployment-1"
    shifted = (await sent(pilot, ("shifted.csv", table(range(30, 35), shift=1.0))))["result"]
    job = await ended(pilot, await confirmed(pilot, shifted))
    assert counts(job["result"]) == (5, 0, 0, 5, 0)


async def test_a_kept_mapping_is_listed_and_forgotten(pilot):
    proposal = (await sent(pilot, ("odd.csv", table(range(5)))))["result"]
    job = await ended(pilot, await confirmed(pilot, proposal, template="odd"))
    assert job["state"] == "done", job["message"]
    [kept] = (await pilot.get("/api/imports/templates")).json()["templates"]
    assert (kept["name"], kept["columns"]) == ("odd", 5)
    assert (await pilot.delete("/api/imports/templates/odd")).status_code == 204
    assert (await pilot.delete("/api/imports/templates/odd")).status_code == 404


async def test_a_kept_mapping_is_not_overwritten_by_another_of_its_name(pilot):
    first = (await sent(pilot, ("odd.csv", table(range(5)))))["result"]
    second = (await sent(pilot, ("more.csv", table(range(10, 15)))))["result"]
    assert (second["template"], second["template_at"]) == ("", "")
    job = await ended(pilot, await confirmed(pilot, first, template="odd"))
    assert job["state"] == "done", job["message"]
    other = meant(second, Lat=("latitude", "", "DDMM.mm"))
    body = {"robot": "eva", "mapping": other, "template": "odd"}
    path = f"/api/imports/uploads/{second['upload']}"
    answer = await pilot.post(path, json=body)
    assert answer.status_code == 409
    assert answer.json()["detail"].startswith("ann keeps another mapping as 'odd', since ")
    same = await ended(pilot, await confirmed(pilot, second, template="odd"))
    assert same["state"] == "done", same["message"]
    third = (await sent(pilot, ("third.csv", table(range(20, 25)))))["result"]
    assert third["template"] == "odd"
    body = {**body, "mapping": meant(third) | {"water": "fresh"}}
    path = f"/api/imports/uploads/{third['upload']}"
    assert (await pilot.post(path, json=body)).status_code == 409
    job = await ended(
        pilot, await pilot.post(path, json={**body, "template_at": third["template_at"]})
    )
    assert job["state"] == "done", job["message"]
    fourth = (await sent(pilot, ("fourth.csv", table(range(30, 35)))))["result"]
    assert fourth["mapping"]["water"] == "fresh"


async def test_files_that_are_no_recording_are_refused_in_a_sentence(pilot):
    job = await sent(pilot, ("empty.dbd", ""))
    assert job["state"] == "failed"
    assert "empty.dbd" in job["message"]
    job = await sent(pilot, ("photo.nc", b"\x89HDF\r\n\x1a\nno more"))
    assert job["state"] == "failed"
    assert "photo.nc" in job["message"]
    proposal = (await sent(pilot, ("odd.csv", table(range(5)))))["result"]
    body = {"robot": "eva", "mapping": proposal["mapping"]}
    path = f"/api/imports/uploads/{proposal['upload']}"
    job = await ended(pilot, await pilot.post(path, json=body))
    assert (job["state"], job["message"].split(":")[0]) == (
        "failed",
        "The mapping cannot be followed",
    )
    unknown = await pilot.post("/api/imports/uploads/abc", json=body)
    assert unknown.status_code == 404


async def test_an_import_that_is_cancelled_keeps_nothing_and_can_be_confirmed_again(
    pilot, monkeypatch
):
    begun, let_go = threading.Event(), threading.Event()

    def held(*more):
        begun.set()
        let_go.wait(60)
        insert_samples(*more)

    insert_samples = imported.insert_samples
    monkeypatch.setattr(imported, "insert_samples", held)
    proposal = (await sent(pilot, ("odd.csv", table(range(30)))))["result"]
    job = (await confirmed(pilot, proposal)).json()["id"]
    await asyncio.to_thread(begun.wait, 60)
    cancelling = asyncio.create_task(pilot.delete(f"/api/jobs/{job}"))
    await until_cancelled(f"import {job}")
    let_go.set()
    assert (await cancelling).json()["state"] == "cancelled"
    assert (await pilot.get("/api/deployments")).json()["deployments"] == []
    job = await ended(pilot, await confirmed(pilot, proposal))
    assert counts(job["result"]) == (30, 30, 0, 0, 0)


def test_flags_that_are_not_taken_over_are_counted_in_the_report():
    rows = 2010
    told = np.arange(float(rows))
    flags = np.tile(np.array([4, 1], dtype=np.int8), rows // 2)
    files = Converted(told, told, told, told, {"temperature": told}, {}, {"temperature": flags},
                      rows, (), ())  # fmt: skip
    deployment = SimpleNamespace(id="deployment-1", robot="eva")
    assert report_of(Kept(deployment, rows, 0, 0), files, ())["notes"] == [
        "temperature: the first 1,000 stretches of flags were taken over, 5 were not."
    ]
    assert report_of(Kept(deployment, 0, rows, 0), files, ())["notes"] == []


async def test_a_card_is_known_by_its_content_and_needs_no_mapping(app, pilot, tmp_path):
    store = app.state.foundation.store
    await store.write(lambda session: add_robot(session, robot_record()))
    entries = [measurement(number) for number in range(12)]
    told = [by_radio(number, entries[number]) for number in range(0, 12, 2)]
    await store.write(lambda session: append_telemetry(session, told))
    card = card_file(tmp_path / "card", entries).read_bytes()
    proposal = (await sent(pilot, ("samples", card)))["result"]
    assert (proposal["format"], proposal["rows"], proposal["columns"]) == ("card", 12, [])
    body = {"robot": "mini-1", "mapping": proposal["mapping"]}
    job = await ended(
        pilot, await pilot.post(f"/api/imports/uploads/{proposal['upload']}", json=body)
    )
    assert job["state"] == "done", job["message"]
    assert counts(job["result"]) == (12, 6, 6, 0, 0)
    assert job["result"]["deployment"] == "deployment-1"
    again = (await sent(pilot, ("copy", card)))["result"]
    answer = await pilot.post(f"/api/imports/uploads/{again['upload']}", json=body)
    assert answer.status_code == 409
    assert answer.json()["detail"].endswith("as deployment-1 of mini-1.")


async def test_a_clock_that_was_ahead_is_said_by_a_person_and_told_of(pilot):
    proposal = (await sent(pilot, ("odd.csv", table(range(5)))))["result"]
    job = await ended(pilot, await confirmed(pilot, proposal, clock_offset_s=12.5))
    assert job["state"] == "done", job["message"]
    assert "Every time was moved by -12.500 s, as ann said." in job["result"]["notes"]
    [deployment] = (await pilot.get("/api/deployments")).json()["deployments"]
    begun = datetime.fromisoformat(deployment["started_at"])
    assert begun.timestamp() == BEGIN_S - 12.5


async def test_columns_that_are_no_channel_are_named_or_kept_as_other_series(pilot):
    """Twice, with a part in common: no value of a series is there twice."""
    for rows, kept in ((range(20), 20), (range(10, 30), 30)):
        text = table(rows).replace("probe 7", "probe 7;mood;note").split("\n")
        lines = [
            text[0],
            *(f"{line};{n % 5};fine" for n, line in zip(rows, text[1:], strict=False)),
        ]
        proposal = (await sent(pilot, (f"{kept}.csv", "\n".join(lines))))["result"]
        mapping = meant(proposal, mood=("other", "", "furlong"))
        body = {"robot": "eva", "mapping": mapping}
        job = await ended(
            pilot, await pilot.post(f"/api/imports/uploads/{proposal['upload']}", json=body)
        )
        assert job["state"] == "done", job["message"]
        notes = job["result"]["notes"]
        assert "1 columns are left out: note." in notes
        assert "1 columns are kept as other series: mood." in notes
        path = "/api/deployments/deployment-1/series"
        [series] = (await pilot.get(path)).json()["series"]
        assert (series["name"], series["unit"], series["count"]) == ("mood", "furlong", kept)
        assert (series["least"], series["greatest"]) == (0.0, 4.0)
    told = (await pilot.get(f"{path}/{series['id']}")).text.splitlines()
    assert told[0] == "time,mood (furlong)"
    assert [line.split(",")[1] for line in told[1:]] == [f"{n % 5}.0" for n in range(30)]
    assert told[1].startswith("2019-07-21T23:25:02.000000Z,")
    assert (await pilot.get(f"{path}/series-99")).status_code == 404
