"""People with rights on chosen robots read and write of these, and unused pictures go."""

import io
import os
import time

import httpx
import pytest
from PIL import Image

from server.logbook.log_book import UNUSED_KEPT_S, LogBook
from tests.server.access.test_grants import person
from tests.server.conftest import GRACE, MINI
from tests.server.logbook.test_entries import read, texts, write

PICTURES = "/api/logbook/attachments"


def png(colour: str) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (4, 3), colour).save(file, "PNG")
    return file.getvalue()


async def sent(client: httpx.AsyncClient, colour: str) -> str:
    answer = await client.post(PICTURES, files={"file": ("a.png", png(colour), "image/png")})
    assert answer.status_code == 201, answer.text
    return answer.json()["sha256"]


async def status(client: httpx.AsyncClient, method: str, path: str, **more: object) -> int:
    return (await client.request(method, path, **more)).status_code


@pytest.fixture
async def cem(client):
    """A pilot of mini-1 who may not see grace-1."""
    return await person(client, "cem", "none", grants=[{"robot": MINI, "role": "pilot"}])


@pytest.fixture
async def dora(client):
    """She may look at mini-1 alone."""
    return await person(client, "dora", "none", grants=[{"robot": MINI, "role": "viewer"}])


async def test_they_see_the_entries_of_their_robots_and_no_others(client, cem, dora):
    red, blue = await sent(client, "red"), await sent(client, "blue")
    mine = await write(client, "Of mini.", robot=MINI,
                       attachments=[{"sha256": red, "name": "r"}])  # fmt: skip
    other = await write(client, "Of grace.", robot=GRACE, tags=["secret"],
                        attachments=[{"sha256": blue, "name": "b"}])  # fmt: skip
    await write(client, "Of all.")
    for one in (cem, dora):
        assert texts(await read(one)) == ["Of mini."]
        assert await status(one, "GET", f"/api/logbook/entries/{mine['id']}") == 200
        assert await status(one, "GET", f"/api/logbook/entries/{other['id']}") == 404
        assert await status(one, "GET", f"/api/logbook?robot={GRACE}") == 404
        assert await status(one, "GET", f"{PICTURES}/{red}") == 200
        assert await status(one, "GET", f"{PICTURES}/{blue}") == 404
        assert "secret" not in (await one.get("/api/logbook/words")).text
        for path in ("/api/logbook/report", "/api/logbook/export"):
            text = (await one.get(path)).text
            assert ("Of mini." in text, "Of grace." in text, "Of all." in text) == (
                True, False, False
            ), path  # fmt: skip
        assert "<h2>On watch</h2>" not in (await one.get("/api/logbook/report")).text
        for path in ("shifts", "handover", "pages", "pages/page-1"):
            assert await status(one, "GET", f"/api/logbook/{path}") == 403, path


async def test_a_pilot_of_one_robot_writes_about_it_and_signs_for_nobody(client, cem):
    other = await write(client, "Of grace.", robot=GRACE)
    entry = await write(cem, "Trim set.", robot=MINI)
    path = f"/api/logbook/entries/{entry['id']}"
    changed = {"text": "Trim set to 3 mm.", "robot": MINI, "version": 1}
    assert await status(cem, "PATCH", path, json=changed) == 200
    moved = {"text": "Trim set.", "robot": GRACE, "version": 2}
    assert await status(cem, "PATCH", path, json=moved) == 404, "to a robot they may not see"
    entries = "/api/logbook/entries"
    assert await status(cem, "POST", entries, json={"text": "x", "robot": GRACE}) == 404
    assert await status(cem, "POST", entries, json={"text": "x"}) == 403, "of the whole station"
    corrects = {"text": "x", "robot": MINI, "corrects": other["id"]}
    assert await status(cem, "POST", entries, json=corrects) == 404
    foreign = f"{entries}/{other['id']}"
    assert await status(cem, "DELETE", foreign, params={"version": 1}) == 404
    assert await status(cem, "PATCH", foreign, json={**changed, "robot": MINI}) == 404
    assert await status(cem, "POST", "/api/logbook/shifts") == 403
    body = {"seen": "0" * 64, "weather": {}}
    assert await status(cem, "POST", "/api/logbook/pages", json=body) == 403
    assert await status(cem, "DELETE", path, params={"version": 2}) == 200


async def test_who_may_only_look_writes_nothing(client, dora):
    entry = await write(client, "Of mini.", robot=MINI)
    path = f"/api/logbook/entries/{entry['id']}"
    said = {"text": "x", "robot": MINI}
    assert await status(dora, "POST", "/api/logbook/entries", json=said) == 403
    assert await status(dora, "PATCH", path, json={**said, "version": 1}) == 403
    assert await status(dora, "DELETE", path, params={"version": 1}) == 403
    picture = {"file": ("a.png", png("red"), "image/png")}
    assert await status(dora, "POST", PICTURES, files=picture) == 403, "nor fills the disk"
    assert texts(await read(client)) == ["Of mini."]


async def test_what_an_entry_said_of_a_robot_they_may_not_see_is_not_in_its_history(client, cem):
    entry = await write(client, "Grace leaks.", robot=GRACE)
    moved = {"text": "It was mini.", "robot": MINI, "version": 1}
    path = f"/api/logbook/entries/{entry['id']}"
    assert await status(client, "PATCH", path, json=moved) == 200
    assert [one["text"] for one in (await cem.get(path)).json()["versions"]] == ["It was mini."]
    assert len((await client.get(path)).json()["versions"]) == 2


async def test_pictures_that_no_entry_has_go_after_their_time_and_others_stay(client, station):
    book = station.foundation.services.get(LogBook)
    folder = station.foundation.settings.data_dir / "log_pictures"
    used, struck, unused, young = [await sent(client, c) for c in ("red", "blue", "lime", "gold")]
    await write(client, "See.", attachments=[{"sha256": used, "name": "a"}])
    gone = await write(client, "See.", attachments=[{"sha256": struck, "name": "a"}])
    await client.delete(f"/api/logbook/entries/{gone['id']}", params={"version": 1})
    long_ago = time.time() - UNUSED_KEPT_S - 60.0
    for digest in (used, struck, unused):
        os.utime(folder / digest, (long_ago, long_ago))
    (folder / "a file of somebody").write_bytes(b"x")
    os.utime(folder / "a file of somebody", (long_ago, long_ago))
    assert await book.clean_once(time.time() - UNUSED_KEPT_S) == 1
    left = {one.name for one in folder.iterdir()}
    assert left == {used, struck, young, "a file of somebody"}
    again = {"text": "See.", "attachments": [{"sha256": unused, "name": "a"}]}
    refused = await client.post("/api/logbook/entries", json=again)
    assert (refused.status_code, "send it first" in refused.text) == (422, True)


async def test_a_picture_that_is_written_down_as_it_is_about_to_go_stays(client, station):
    pictures = station.foundation.services.get(LogBook).pictures
    digest = await sent(client, "red")
    long_ago = time.time() - UNUSED_KEPT_S - 60.0
    folder = station.foundation.settings.data_dir / "log_pictures"
    os.utime(folder / digest, (long_ago, long_ago))
    before = time.time() - UNUSED_KEPT_S
    assert pictures.older_than(before) == {digest}
    await write(client, "See.", attachments=[{"sha256": digest, "name": "a"}])
    assert pictures.remove({digest}, before) == 0, "it was taken since it was looked at"
    assert await status(client, "GET", f"{PICTURES}/{digest}") == 200
