"""One shape of answer for work under way, and requests that wait for its next change."""

import asyncio

import pytest

from server.base.job import JobError
from tests.server.conftest import application
from tests.server.station_app import client_of, running, signed_in

_SHAPES = {"JobView", "StartedView"}
_SEVERAL = {"/api/surveys"}
"""What begins several missions at once names each."""


@pytest.fixture
async def app(tmp_path):
    async with running(tmp_path) as app:
        yield app


@pytest.fixture
async def client(app):
    async with signed_in(app) as client:
        yield client


class Work:
    """Work that gets further when it is told to."""

    def __init__(self, app):
        self._jobs = app.state.foundation.jobs
        self._go_on = asyncio.Event()
        self._progress = None

    async def begin(self):
        return (await self._jobs.start("test", self._run, by="ann")).id

    def report(self, share):
        self._progress.report(share, "half way")

    def end(self):
        self._go_on.set()

    async def _run(self, progress):
        self._progress = progress
        await self._go_on.wait()
        return {"answer": 42}


@pytest.fixture
def work(app):
    return Work(app)


def waiting(app):
    return app.state.foundation.changes._waiting


async def is_waited_for(app, job):
    async with asyncio.timeout(30.0):
        while job not in waiting(app):  # noqa: ASYNC110
            await asyncio.sleep(0.01)


def test_every_route_that_begins_work_answers_in_one_of_two_shapes():
    document = application().openapi()
    found = {}
    for path, methods in document["paths"].items():
        for operation in methods.values():
            if "202" in operation["responses"]:
                content = operation["responses"]["202"]["content"]["application/json"]
                found[path] = content["schema"]["$ref"].rpartition("/")[2]
    assert len(found) > 30
    others = {path for path, shape in found.items() if shape not in _SHAPES}
    assert others == _SEVERAL


def test_no_answer_names_a_job_beside_a_202():
    document = application().openapi()
    job = {"$ref": "#/components/schemas/JobView"}
    begun = [
        path
        for path, methods in document["paths"].items()
        for verb, operation in methods.items()
        for status in ("200", "201")
        if verb == "post"
        and operation["responses"].get(status, {}).get("content", {}).get("application/json", {})
        .get("schema") == job
    ]  # fmt: skip
    assert begun == []


async def test_an_ended_job_is_told_at_once(client, work):
    job = await work.begin()
    work.end()
    found = (await client.get(f"/api/jobs/{job}?wait_s=30&until=end")).json()
    again = (await client.get(f"/api/jobs/{job}?wait_s=30")).json()
    assert found["state"] == again["state"] == "done"
    assert found["result"] == {"answer": 42}


async def test_a_request_that_waits_is_answered_by_the_next_progress(app, client, work):
    job = await work.begin()
    asked = asyncio.create_task(client.get(f"/api/jobs/{job}?wait_s=30"))
    await is_waited_for(app, job)
    work.report(0.5)
    assert (await asked).json()["progress"] == 0.5
    assert waiting(app) == {}


async def test_a_request_for_the_end_sleeps_through_progress(app, client, work):
    job = await work.begin()
    asked = asyncio.create_task(client.get(f"/api/jobs/{job}?wait_s=30&until=end"))
    await is_waited_for(app, job)
    work.report(0.25)
    work.report(0.5)
    await client.get("/api/health")
    assert not asked.done()
    work.end()
    assert (await asked).json()["state"] == "done"


async def test_a_wait_that_is_over_tells_how_it_stands(client, work):
    job = await work.begin()
    found = await client.get(f"/api/jobs/{job}?wait_s=0.05")
    assert (found.status_code, found.json()["state"]) == (200, "running")


async def test_a_change_between_two_requests_is_not_waited_for(client, work):
    job = await work.begin()
    seen = await client.get(f"/api/jobs/{job}")
    work.report(0.5)
    headers = {"If-None-Match": seen.headers["ETag"]}
    found = await client.get(f"/api/jobs/{job}?wait_s=30", headers=headers)
    assert found.json()["progress"] == 0.5


async def test_a_job_that_fails_ends_the_wait(app, client):
    go_on = asyncio.Event()

    async def fail(progress):
        await go_on.wait()
        raise JobError("The file is empty.")

    job = (await app.state.foundation.jobs.start("test", fail, by="ann")).id
    asked = asyncio.create_task(client.get(f"/api/jobs/{job}?wait_s=30&until=end"))
    await is_waited_for(app, job)
    go_on.set()
    assert (await asked).json()["message"] == "The file is empty."


async def test_nothing_waits_for_a_client_that_has_left(app, client, work):
    job = await work.begin()
    gone, sent = asyncio.Event(), []

    async def receive():
        if not sent:
            sent.append(True)
            return {"type": "http.request", "body": b"", "more_body": False}
        await gone.wait()
        return {"type": "http.disconnect"}

    async def send(message):
        del message

    scope = {
        "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": "GET",
        "scheme": "http", "path": f"/api/jobs/{job}", "raw_path": f"/api/jobs/{job}".encode(),
        "query_string": b"wait_s=30", "root_path": "", "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", 8000),
        "headers": [
            (b"host", b"127.0.0.1:8000"),
            (b"authorization", client.headers["Authorization"].encode()),
        ],
    }  # fmt: skip
    asked = asyncio.create_task(app(scope, receive, send))
    await is_waited_for(app, job)
    gone.set()
    async with asyncio.timeout(30.0):
        await asked
    assert waiting(app) == {}


async def test_a_station_that_stops_keeps_nobody_waiting(app, client, work):
    job = await work.begin()
    asked = asyncio.create_task(client.get(f"/api/jobs/{job}?wait_s=30"))
    await is_waited_for(app, job)
    app.state.foundation.changes.close()
    assert (await asked).json()["state"] == "running"


async def test_a_wait_beyond_the_limit_names_field_and_limit(app, work):
    async with client_of(app) as stranger:
        assert (await stranger.get("/api/jobs/job-1?wait_s=1")).status_code == 401
    async with signed_in(app, name="bob") as client:
        answer = await client.get(f"/api/jobs/{await work.begin()}?wait_s=31")
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert (error["loc"], "30" in error["msg"]) == (["query", "wait_s"], True)
