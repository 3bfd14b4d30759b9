"""How much a script may ask; what brings a robot up is never limited."""

import asyncio
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx
from fastapi import APIRouter, FastAPI
from fastapi.routing import APIRoute

from server.access.dependency import Pilot
from server.access.rate import TokenLimits, calls_of
from server.access.role import Role
from server.base.dependency import FoundationDep
from server.base.job import JobProgress
from server.base.problem import conflict
from server.base.work.job_view import JobBegun, JobView
from server.base.work.started import (
    CalculatedAnswer,
    CalculationStarted,
    Started,
    StartedView,
)
from server.document import ROUTERS
from tests.server.conftest import FAST, MINI, api_client, open_station, until
from tests.server.fake_link import World, current_report, state_report
from tests.server.fake_worker import FakeWorkers
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


class Workshop:
    """Routes that begin work, which lasts until a test says so."""

    def __init__(self) -> None:
        self.go_on = asyncio.Event()
        self.plans: set[str] = set()
        self.router = APIRouter()

        @self.router.post("/api/test/job", status_code=202)
        async def begin_job(caller: Pilot, foundation: FoundationDep, begun: JobBegun) -> JobView:
            async def work(progress: JobProgress) -> dict[str, object]:
                await self.go_on.wait()
                return {}

            return await begun((await foundation.jobs.start("test", work, by=caller.name)).id)

        @self.router.post("/api/test/plan", status_code=202)
        async def begin_plan(caller: Pilot, started: CalculationStarted) -> StartedView:
            self.plans.add(f"plan-{len(self.plans) + 1}")
            return started(f"plan-{len(self.plans)}")

        @self.router.post("/api/test/refused", status_code=202)
        async def refuse(caller: Pilot, started: CalculationStarted) -> StartedView:
            raise conflict("Not now.")

        @self.router.post("/api/test/broken", status_code=202)
        async def fail(caller: Pilot, begun: JobBegun) -> JobView:
            raise ZeroDivisionError

        @self.router.post("/api/test/order", status_code=202)
        async def order(caller: Pilot, started: Started) -> StartedView:
            return started("command-1")


@asynccontextmanager
async def workshop_at(folder: Path, jobs: int) -> AsyncGenerator[tuple[FastAPI, Workshop]]:
    shop = Workshop()
    async with running(folder, token_jobs=jobs) as app:
        # Before the operator app, which answers at every address that is left.
        catch_all = app.router.routes.pop()
        app.include_router(shop.router)
        app.router.routes.append(catch_all)
        limits = app.state.foundation.services.get(TokenLimits)
        limits.add_work("plan", lambda plan: plan in shop.plans)
        yield app, shop
        shop.go_on.set()


async def statuses(client: httpx.AsyncClient, *names: str) -> list[int]:
    return [(await client.post(f"/api/test/{name}")).status_code for name in names]


async def test_a_token_has_so_many_jobs_and_plans_under_way(tmp_path: Path):
    async with workshop_at(tmp_path, 2) as (app, shop), signed_in(app, name="ann") as client:
        assert await statuses(client, "job", "plan", "job", "plan") == [202, 202, 429, 429]
        refusal = await client.post("/api/test/plan")
        assert "token_jobs" in refusal.json()["detail"]
        assert int(refusal.headers["Retry-After"]) > 0
        assert await statuses(client, "order") == [202]
        shop.plans.clear()
        assert await statuses(client, "plan", "plan") == [202, 429]
        shop.go_on.set()
        await until(lambda: not app.state.foundation.jobs.running)
        assert await statuses(client, "plan", "plan") == [202, 429]


async def test_work_of_a_person_or_of_another_token_of_the_same_name_is_counted_apart(
    tmp_path: Path,
):
    async with workshop_at(tmp_path, 1) as (app, _), admin_of(app) as page:
        assert await statuses(page, "job", "job") == [202, 202]
        for _ in range(2):
            async with signed_in(app, name="ann") as client:
                assert await statuses(client, "job", "job") == [202, 429]


async def test_requests_that_come_at_once_do_not_slip_through_together(tmp_path: Path):
    async with workshop_at(tmp_path, 2) as (app, _), signed_in(app) as client:
        answers = await asyncio.gather(*(client.post("/api/test/job") for _ in range(5)))
    assert sorted(answer.status_code for answer in answers) == [202, 202, 429, 429, 429]


async def test_what_began_nothing_does_not_count(tmp_path: Path):
    async with workshop_at(tmp_path, 1) as (app, _), signed_in(app) as client:
        assert await statuses(client, "refused", "broken", "refused", "broken") == 2 * [409, 500]
        assert await statuses(client, "job") == [202]


def test_every_request_that_begins_a_search_or_a_rehearsal_counts():
    counted = {
        route.path
        for router in ROUTERS
        for route in router.routes
        if isinstance(route, APIRoute) and CalculatedAnswer in calls_of(route.dependant)
    }
    assert counted == {
        "/api/robots/{robot}/plans",
        "/api/plans/{plan}/choose",
        "/api/plans/{plan}/continue",
        "/api/plans/{plan}/rehearse",
        "/api/designs/{design}/plan",
    }


async def test_a_plan_counts_while_it_is_searched_for(
    tmp_path: Path, world: World, workers: FakeWorkers
):
    body = {"kind": "adaptive_survey", "config": FAST}
    plans = f"/api/robots/{MINI}/plans"
    async with (
        open_station(tmp_path, world, token_jobs=1) as station,
        api_client(station, Role.PILOT) as client,
    ):
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        workers.may_plan.clear()
        first = await client.post(plans, json=body)
        assert first.status_code == 202, first.text
        refusal = await client.post(plans, json=body)
        assert refusal.status_code == 429, refusal.text
        cancelled = await client.post(f"/api/plans/{first.json()['id']}/cancel")
        assert cancelled.status_code == 202, cancelled.text
        workers.may_plan.set()
        assert (await client.post(plans, json=body)).status_code == 202
