"""Who did what: every change of a person or a script is in the log, with their name."""

import hashlib
import json

from server.access.deed import TOLD_ELSEWHERE
from server.access.role import Role
from tests.server.conftest import MINI, api_client, application


async def newest(client, **query):
    answer = await client.get("/api/events", params=query)
    assert answer.status_code == 200, answer.text
    return answer.json()["events"]


async def test_an_event_names_who_caused_it(client):
    answer = await client.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"})
    assert answer.status_code == 202, answer.text
    (ordered,) = await newest(client, kind="command.surface")
    me = (await client.get("/api/session")).json()["name"]
    assert (ordered["by"], ordered["by_kind"]) == (me, "script")


async def test_what_no_event_tells_of_gets_one(client):
    body = {"name": "Way", "document": {}, "parameters": []}
    answer = await client.post("/api/design-templates", json=body)
    assert answer.status_code == 201, answer.text
    (deed,) = await newest(client, kind="request.done")
    assert deed["data"] == {"method": "POST", "path": "/api/design-templates"}
    assert deed["by"] in deed["text"]


async def test_what_changes_nothing_or_was_refused_is_no_event(client):
    before = await newest(client, limit=1000)
    assert (await client.post("/api/session/ticket")).status_code == 201
    assert (await client.post("/api/robots/nobody/commands", json={"kind": "surface"})).is_error
    assert (await client.post(f"/api/robots/{MINI}/commands", json={"kind": "fly"})).is_error
    assert await newest(client, limit=1000) == before


async def test_a_repeated_request_is_one_event(client):
    headers = {"Idempotency-Key": "once"}
    for _ in range(3):
        path = f"/api/robots/{MINI}/commands"
        answer = await client.post(path, json={"kind": "surface"}, headers=headers)
        assert answer.status_code == 202
    assert len(await newest(client, kind="command.surface")) == 1
    assert await newest(client, kind="request.done") == []


def test_routes_whose_changes_are_no_events_exist():
    paths = application().openapi()["paths"]
    routes = {(method.upper(), path) for path, methods in paths.items() for method in methods}
    assert routes >= TOLD_ELSEWHERE


async def test_the_log_is_searched_by_person_and_words(client, station):
    await client.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"})
    me = (await client.get("/api/session")).json()["name"]
    assert me in (await client.get("/api/events/actors")).json()["names"]
    mine = await newest(client, by=me)
    assert mine
    assert {one["by"] for one in mine} == {me}
    assert await newest(client, by="nobody") == []
    assert all(one["by"] for one in await newest(client, by_anybody=True))
    assert {one["kind"] for one in await newest(client, text="COMMAND.surf")} == {"command.surface"}
    assert await newest(client, text="100%_") == []
    everything = await newest(client, limit=1000)
    older = await newest(client, before=everything[-1]["cursor"], limit=1000)
    assert [one["cursor"] for one in older] == [one["cursor"] for one in everything[:-1]]
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.get("/api/events", params={"text": "x" * 201})).status_code == 422


async def test_the_saved_log_carries_its_chain(client):
    await client.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"})
    answer = await client.get("/api/events/export")
    previous = bytes(32)
    lines = [json.loads(line) for line in answer.text.splitlines()]
    for line in lines:
        previous = hashlib.sha256(previous + line["hashed"].encode()).digest()
        assert line["hash"] == previous.hex()
    assert "command.surface" in {line["kind"] for line in lines}
