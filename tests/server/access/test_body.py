"""A body is read for who may send it, in time and in size."""

import asyncio
import json

import pytest

from server.access import body
from server.access.body import FILE_BYTES_MAX
from server.access.role import Role
from tests.server.conftest import application
from tests.server.station_app import bearer, client_of, token_of

STOPS = b"stops"


async def answered(app, path, parts, headers):
    """Return status and body of the answer to a POST, and how many parts of the body were read."""
    read, sent = 0, []

    async def receive():
        nonlocal read
        await asyncio.sleep(0)
        if len(parts) > 1000:
            await asyncio.sleep(0.001)
        if parts[read] is STOPS:
            await asyncio.Event().wait()
        read += 1
        return {"type": "http.request", "body": parts[read - 1], "more_body": read < len(parts)}

    async def send(message):
        sent.append(message)

    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": "POST",
        "scheme": "http",
        "path": path,
        "raw_path": path.encode(),
        "root_path": "",
        "query_string": b"",
        "server": ("127.0.0.1", 8000),
        "client": ("127.0.0.1", 9),
        "headers": [
            (name.lower().encode(), value.encode())
            for name, value in {"Host": "127.0.0.1:8000", **headers}.items()
        ],
    }
    async with asyncio.timeout(60):
        await app(scope, receive, send)
    content = b"".join(message.get("body", b"") for message in sent[1:])
    return sent[0]["status"], json.loads(content), read


JSON = {"Content-Type": "application/json"}
FILE = {"Content-Type": "multipart/form-data; boundary=x"}


@pytest.mark.parametrize(
    ("path", "kind"), [("/api/imports", FILE), ("/api/robots", JSON), ("/api/tokens", JSON)]
)
async def test_nothing_of_a_strangers_body_is_read(app, path, kind):
    status, _, read = await answered(app, path, [b"x" * 1000] * 3, kind)
    assert (status, read) == (401, 0)
    viewer = bearer(await token_of(app, Role.VIEWER))
    status, _, read = await answered(app, path, [b"x" * 1000] * 3, kind | viewer)
    assert (status, read) == (403, 0)


async def test_a_sign_in_of_many_bytes_is_cut_off(app):
    parts = [b"x" * 2**14] * 64
    status, _, read = await answered(app, "/api/session", parts, JSON)
    assert status == 413
    assert read == body.STRANGER_BYTES_MAX // 2**14 + 1
    told = {"Content-Length": str(2**20)}
    assert (await answered(app, "/api/session", parts, JSON | told))[::2] == (413, 0)


FORM = {"Content-Type": "application/x-www-form-urlencoded"}


async def test_what_is_kept_in_memory_is_no_longer_on_a_route_of_files(app):
    pilot = bearer(await token_of(app, Role.PILOT))
    parts = [b" " * 2**18] * 12
    status, _, read = await answered(app, "/api/imports", parts, FORM | pilot)
    assert (status, read) == (413, body.BODY_BYTES_MAX // 2**18 + 1)
    told = {"Content-Length": str(body.BODY_BYTES_MAX + 1)}
    assert (await answered(app, "/api/imports", parts, FORM | pilot | told))[::2] == (413, 0)
    assert (await answered(app, "/api/imports", [b"--x--\r\n"], FILE | pilot | told))[0] == 422


async def test_a_body_that_stops_is_given_up(app, monkeypatch):
    monkeypatch.setattr(body, "PAUSE_MAX_S", 0.05)
    status, problem, _ = await answered(app, "/api/session", [b"{", STOPS], JSON)
    assert status == 408
    assert "too slowly" in problem["detail"]


async def test_a_body_that_drips_is_given_up(app, monkeypatch):
    monkeypatch.setattr(body, "JSON_MAX_S", 0.1)
    status, _, read = await answered(app, "/api/session", [b" "] * 10_000, JSON)
    assert status == 408
    assert read < 10_000


@pytest.mark.parametrize(
    ("sent", "reason"),
    [
        (b"{", "truncated"),
        (b'{"name": "a",}', "trailing comma"),
        (rb'{"name": "\ud800"}', "not JSON"),
        (b'{"name": 1e999}', "out of range"),
        (b'{"name": NaN}', "not JSON"),
        (b'{"name": "\xff"}', "utf-8"),
        (b"[" * 50_000, "deeply"),
    ],
)
async def test_what_is_no_json_is_called_that(app, sent, reason):
    async with client_of(app) as client:
        answer = await client.post("/api/session", content=sent, headers=JSON)
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["detail"].startswith("The body is not JSON: ")
    assert reason in answer.json()["detail"]


def test_every_route_that_takes_a_file_says_how_large_it_may_be():
    paths = application().openapi()["paths"]
    taking = {
        path
        for path, verbs in paths.items()
        for verb in verbs.values()
        if "multipart/form-data" in verb.get("requestBody", {}).get("content", {})
    }
    assert taking == set(FILE_BYTES_MAX)
