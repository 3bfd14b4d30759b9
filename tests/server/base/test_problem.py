"""Every refusal has one shape, and the same request twice acts once."""

import asyncio

import pytest
from fastapi import APIRouter

from db.fault import StoreUnavailableError, UnknownIdError
from server.access.dependency import Pilot
from server.access.idempotency import OUTCOME_HEADER, IdempotentRoute
from server.base.dependency import FoundationDep
from server.base.problem import FieldError, Problem, conflict
from server.base.view import Body
from tests.server.conftest import until
from tests.server.station_app import running, signed_in


class Order(Body):
    amount: int


SECOND_STEPS = {
    "stored nothing": StoreUnavailableError("The disk is full."),
    "broke": ZeroDivisionError("second step"),
    "reached nobody": Problem(502, "Nobody answers."),
    "was refused": conflict("Not now."),
}
"""How a request may end whose first step was committed."""


def routes(calls, may_act):
    """Routes that fail in every way, and some that count how often they act."""
    router = APIRouter(route_class=IdempotentRoute)

    @router.get("/api/test/{what}")
    async def fail(what: str) -> None:
        match what:
            case "unknown":
                raise UnknownIdError("plan", "plan-9")
            case "unavailable":
                raise StoreUnavailableError("The disk is full.")
            case "conflict":
                raise conflict("No.", [FieldError(loc=["legs", 0], msg="too deep")])
            case _:
                raise ZeroDivisionError(what)

    @router.post("/api/test/order", status_code=202)
    async def order(caller: Pilot, body: Order) -> dict[str, int]:
        await may_act.wait()
        if body.amount < 0:
            raise conflict("Less than nothing.")
        calls.append(body.amount)
        return {"order": len(calls)}

    @router.post("/api/test/steps/{second}", status_code=202)
    async def two_steps(caller: Pilot, second: str, foundation: FoundationDep) -> None:
        await foundation.store.write(lambda session: calls.append(second))
        if second in SECOND_STEPS:
            raise SECOND_STEPS[second]
        if len(calls) == 1:
            await asyncio.Event().wait()

    return router


@pytest.fixture
def calls():
    return []


@pytest.fixture
async def may_act():
    """Lets orders go on."""
    gate = asyncio.Event()
    gate.set()
    return gate


@pytest.fixture
async def admin(tmp_path, calls, may_act):
    async with running(tmp_path) as app:
        # Before the operator app, which answers at every address that is left.
        catch_all = app.router.routes.pop()
        app.include_router(routes(calls, may_act))
        app.router.routes.append(catch_all)
        async with signed_in(app) as client:
            yield client


REFUSALS = (
    ("/api/test/unknown", 404, "There is no plan 'plan-9'."),
    ("/api/test/unavailable", 503, "The disk is full. Try again when"),
    ("/api/test/conflict", 409, "No."),
    ("/api/test/else", 500, "The station failed at this; its log says why."),
    ("/api/nowhere", 404, "There is nothing at /api/nowhere."),
    ("/api/jobs/job-7", 404, "There is no job 'job-7'."),
    ("/api/jobs/plan-7", 404, "There is no job 'plan-7'."),
    ("/api/config/engine", 404, "There is no configuration 'engine'; there are planner, field"),
    ("/api/config/planner?robot=nobody", 404, "There is no robot 'nobody'."),
    ("/api/events?limit=0", 422, "1 field is wrong."),
)


async def test_every_refusal_is_a_problem_with_a_sentence(admin):
    for path, status, detail in REFUSALS:
        answer = await admin.get(path)
        problem = answer.json()
        assert answer.status_code == problem["status"] == status, path
        assert answer.headers["content-type"] == "application/problem+json"
        assert problem["detail"].startswith(detail)
        assert problem["title"]
        assert problem["type"] == "about:blank"


async def test_a_wrong_method_is_named(admin):
    answer = await admin.put("/api/test/order", json={})
    assert answer.status_code == 405
    assert answer.json()["detail"] == "/api/test/order does not take PUT."


async def test_violations_are_listed_with_their_path(admin):
    assert (await admin.get("/api/test/conflict")).json()["errors"] == [
        {"loc": ["legs", 0], "msg": "too deep"}
    ]
    answer = await admin.post("/api/test/order", json={"amount": "x", "amuont": 3})
    assert answer.status_code == 422
    assert {tuple(error["loc"]) for error in answer.json()["errors"]} == {("amount",), ("amuont",)}


async def test_a_body_that_is_not_json_is_a_problem_too(admin):
    headers = {"Content-Type": "application/json"}
    answer = await admin.post("/api/test/order", content=b"{", headers=headers)
    assert answer.status_code == 422
    assert answer.json()["errors"]


async def test_the_same_request_twice_acts_once(admin, calls):
    headers = {"Idempotency-Key": "a"}
    first = await admin.post("/api/test/order", json={"amount": 3}, headers=headers)
    second = await admin.post("/api/test/order", json={"amount": 3}, headers=headers)
    assert calls == [3]
    assert (second.status_code, second.json()) == (first.status_code, first.json())
    assert second.headers["Idempotent-Replayed"] == "true"
    other = await admin.post(
        "/api/test/order", json={"amount": 3}, headers={"Idempotency-Key": "b"}
    )
    assert other.json() == {"order": 2}


async def test_two_at_the_same_moment_act_once(admin, calls, may_act):
    headers = {"Idempotency-Key": "a"}
    may_act.clear()
    asked = [
        asyncio.create_task(admin.post("/api/test/order", json={"amount": 3}, headers=headers))
        for _ in range(4)
    ]
    await until(lambda: sum(one.done() for one in asked) == 3)
    may_act.set()
    answers = await asyncio.gather(*asked)
    assert calls == [3]
    assert sorted(answer.status_code for answer in answers) == [202, 409, 409, 409]


async def test_a_key_stands_for_one_request_only(admin, calls):
    headers = {"Idempotency-Key": "a"}
    await admin.post("/api/test/order", json={"amount": 3}, headers=headers)
    answer = await admin.post("/api/test/order", json={"amount": 4}, headers=headers)
    assert answer.status_code == 422
    assert calls == [3]


async def test_a_refused_request_leaves_its_key_free(admin, calls):
    headers = {"Idempotency-Key": "a"}
    assert (
        await admin.post("/api/test/order", json={"amount": -1}, headers=headers)
    ).status_code == 409
    assert (
        await admin.post("/api/test/order", json={"amount": 1}, headers=headers)
    ).status_code == 202
    assert calls == [1]


@pytest.mark.parametrize("second", sorted(SECOND_STEPS.keys() - {"was refused"}))
async def test_a_request_that_failed_after_it_acted_does_not_act_again(admin, calls, second):
    headers = {"Idempotency-Key": "a"}
    first = await admin.post(f"/api/test/steps/{second}", headers=headers)
    assert first.status_code >= 500
    assert "Nothing was changed" not in first.json()["detail"]
    again = await admin.post(f"/api/test/steps/{second}", headers=headers)
    assert (again.status_code, again.headers[OUTCOME_HEADER]) == (409, "unknown")
    assert calls == [second]


async def test_a_request_that_is_cancelled_after_it_acted_does_not_act_again(admin, calls):
    headers = {"Idempotency-Key": "a"}
    first = asyncio.create_task(admin.post("/api/test/steps/waits", headers=headers))
    await until(lambda: calls)
    first.cancel()
    with pytest.raises(asyncio.CancelledError):
        await first
    again = await admin.post("/api/test/steps/waits", headers=headers)
    assert (again.status_code, again.headers[OUTCOME_HEADER]) == (409, "unknown")
    assert calls == ["waits"]


async def test_what_is_refused_may_be_asked_again_whatever_it_did_before(admin, calls):
    for _ in range(2):
        answer = await admin.post("/api/test/steps/was refused", headers={"Idempotency-Key": "a"})
        assert (answer.status_code, answer.json()["detail"]) == (409, "Not now.")
        assert OUTCOME_HEADER not in answer.headers
    assert len(calls) == 2


async def test_a_key_does_not_open_the_door(admin):
    del admin.headers["Authorization"]
    answer = await admin.post(
        "/api/test/order", json={"amount": 1}, headers={"Idempotency-Key": "a"}
    )
    assert answer.status_code == 401


async def test_a_body_without_end_is_refused(admin):
    async def endless():
        while True:
            yield b" " * 2**20

    answer = await admin.post("/api/test/order", content=endless())
    assert answer.status_code == 413
    assert answer.json()["detail"] == "This is longer than the 1 MB that are taken."


async def test_browsers_are_told_to_be_careful(admin):
    headers = (await admin.get("/api/session")).headers
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Cache-Control"] == "no-store"
