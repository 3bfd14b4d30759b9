"""How much a script may ask; what brings a robot up is never limited."""

import asyncio

import pytest

from server.access.role import Role
from tests.server.conftest import MINI, api_client, open_station
from tests.server.fake_link import state_report
from tests.server.station_app import admin_of, running, signed_in

SLOW = {"token_requests_per_s": 0.001, "token_burst": 3, "token_jobs": 1}


async def test_a_script_that_asks_too_much_is_told_when_to_come_again(tmp_path):
    async with running(tmp_path, **SLOW) as app, signed_in(app) as client:
        answers = [await client.get("/api/jobs") for _ in range(4)]
    assert [answer.status_code for answer in answers] == [200, 200, 200, 429]
    assert [answer.headers["RateLimit-Remaining"] for answer in answers] == ["2", "1", "0", "0"]
    assert {answer.headers["RateLimit-Limit"] for answer in answers} == {"3"}
    assert 0 < int(answers[-1].headers["Retry-After"]) <= 1000
    assert "token_requests_per_s" in answers[-1].json()["detail"]


async def test_each_token_is_counted_by_itself(tmp_path):
    async with running(tmp_path, **SLOW) as app, signed_in(app) as client:
        for _ in range(4):
            await client.get("/api/jobs")
        async with signed_in(app, name="other") as other:
            assert (await other.get("/api/jobs")).status_code == 200


async def test_a_page_is_not_counted(tmp_path):
    async with running(tmp_path, **SLOW) as app, admin_of(app) as page:
        answers = [await page.get("/api/jobs") for _ in range(10)]
    assert {answer.status_code for answer in answers} == {200}
    assert not any("RateLimit-Limit" in answer.headers for answer in answers)


async def test_surface_now_goes_out_when_nothing_else_does(tmp_path, world):
    async with (
        open_station(tmp_path, world, **SLOW) as station,
        api_client(station, Role.PILOT) as client,
    ):
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        while (await client.get("/api/jobs")).status_code != 429:  # noqa: ASYNC110
            await asyncio.sleep(0)
        for key in ({}, {"Idempotency-Key": "up"}):
            answer = await client.post(
                f"/api/robots/{MINI}/commands", json={"kind": "surface"}, headers=key
            )
            assert answer.status_code == 202, answer.text
        assert (await client.get("/api/jobs")).status_code == 429


@pytest.mark.parametrize("named", ["script", "other"])
async def test_a_token_has_so_many_jobs_under_way(tmp_path, named):
    limits = {"token_jobs": 1}
    async with running(tmp_path, **limits) as app, signed_in(app, name=named) as client:
        go_on = asyncio.Event()

        async def work(progress):
            await go_on.wait()
            return {}

        await app.state.foundation.jobs.start("test", work, by="script")
        answer = await client.post("/api/imports/uploads", files={"files": ("a.csv", b"x\n1\n")})
        go_on.set()
    assert answer.status_code == (429 if named == "script" else 202)
    if named == "script":
        assert "token_jobs" in answer.json()["detail"]
